// Forward picture and depth picture. A picture that is too old is taken away: nobody flies by a frozen one.

import { FONT, colours, fit, hatching, look } from "./canvas.js";

const INVALID = 0;
const NEARER = 1;
const LEVELS = 253; // of the codec: codes 2 to 255, logarithmic from near to far

/** From near to far, light to dark in every kind of colour vision: the viridis map, from its light end. */
const STOPS = [
  [253, 231, 37],
  [181, 222, 43],
  [110, 206, 88],
  [53, 183, 121],
  [31, 158, 137],
  [38, 130, 142],
  [49, 104, 142],
  [62, 74, 137],
  [72, 40, 120],
  [68, 1, 84],
];

function colourAt(share) {
  const at = Math.min(1, Math.max(0, share)) * (STOPS.length - 1);
  const index = Math.min(STOPS.length - 2, Math.floor(at));
  return STOPS[index].map((value, channel) =>
    Math.round(value + (STOPS[index + 1][channel] - value) * (at - index)),
  );
}

const TABLE = new Uint32Array(256);
const isLittle = new Uint8Array(new Uint32Array([1]).buffer)[0] === 1;
for (let code = NEARER; code < 256; code += 1) {
  const [red, green, blue] = colourAt((code - NEARER) / (255 - NEARER));
  TABLE[code] = isLittle
    ? ((255 << 24) | (blue << 16) | (green << 8) | red) >>> 0
    : ((red << 24) | (green << 16) | (blue << 8) | 255) >>> 0;
}
TABLE[INVALID] = 0; // transparent: the hatching behind it shows

/** One picture on a canvas. */
export class Picture {
  #scratch = null;

  constructor(figure, canvas, isDepth) {
    this.figure = figure;
    this.canvas = canvas;
    this.isDepth = isDepth;
    this.bornMs = null;
    this.count = 0;
  }

  /** Show JPEG or PNG bytes; resolves when they are on the canvas. What is no picture is not shown. */
  async show(bytes, bornMs, isWanted) {
    const type = this.isDepth ? "image/png" : "image/jpeg";
    const options = { colorSpaceConversion: "none", premultiplyAlpha: "none" };
    const bitmap = await createImageBitmap(new Blob([bytes], { type }), options);
    if (isWanted()) {
      if (this.isDepth) this.#paintDepth(bitmap);
      else this.#paint(bitmap);
      this.bornMs = bornMs;
      this.count += 1;
      this.canvas.dataset.count = String(this.count);
    }
    bitmap.close();
  }

  /** Take the picture away. */
  clear() {
    this.bornMs = null;
    this.canvas.getContext("2d").clearRect(0, 0, this.canvas.width, this.canvas.height);
  }

  #size(bitmap) {
    if (this.canvas.width !== bitmap.width || this.canvas.height !== bitmap.height) {
      this.canvas.width = bitmap.width;
      this.canvas.height = bitmap.height;
    }
    return this.canvas.getContext("2d");
  }

  #paint(bitmap) {
    this.#size(bitmap).drawImage(bitmap, 0, 0);
  }

  #paintDepth(bitmap) {
    const context = this.#size(bitmap);
    if (this.#scratch === null) {
      this.#scratch = document.createElement("canvas").getContext("2d", { willReadFrequently: true });
    }
    const scratch = this.#scratch;
    scratch.canvas.width = bitmap.width;
    scratch.canvas.height = bitmap.height;
    scratch.drawImage(bitmap, 0, 0);
    const image = scratch.getImageData(0, 0, bitmap.width, bitmap.height);
    const codes = image.data;
    const pixels = new Uint32Array(codes.buffer);
    for (let index = 0; index < pixels.length; index += 1) pixels[index] = TABLE[codes[index * 4]];
    scratch.putImageData(image, 0, 0);
    context.fillStyle = hatching(context);
    context.fillRect(0, 0, bitmap.width, bitmap.height);
    context.drawImage(scratch.canvas, 0, 0);
  }
}

let drawn = "";

/** The strip that says which colour is how far. */
export function drawScale(canvas, nearM, farM) {
  const key = `${look()} ${nearM} ${farM}`;
  if (key === drawn) return;
  drawn = key;
  const { context, width } = fit(canvas);
  const { ink, muted, line } = colours();
  const top = 4;
  const thick = 12;
  const known = nearM > 0 && farM > nearM;
  for (let x = 0; x < width; x += 1) {
    const [red, green, blue] = colourAt(x / width);
    context.fillStyle = `rgb(${red} ${green} ${blue})`;
    context.fillRect(x, top, 1.5, thick);
  }
  context.strokeStyle = line;
  context.lineWidth = 1;
  context.strokeRect(0.5, top + 0.5, width - 1, thick - 1);
  context.font = `600 13px ${FONT}`;
  context.textBaseline = "top";
  context.fillStyle = known ? ink : muted;
  if (!known) {
    context.textAlign = "left";
    context.fillText("near", 0, top + thick + 3);
    context.textAlign = "right";
    context.fillText("far", width, top + thick + 3);
    return;
  }
  let free = -Infinity;
  for (const metres of [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000]) {
    if (metres < nearM * 0.999 || metres > farM * 1.001) continue;
    const share = (1 + (LEVELS * Math.log(metres / nearM)) / Math.log(farM / nearM)) / (LEVELS + 1);
    const x = share * width;
    const text = `${metres} m`;
    const half = context.measureText(text).width / 2;
    const at = Math.min(width - half, Math.max(half, x));
    if (at - half < free + 6) continue;
    free = at + half;
    context.fillRect(x - 0.75, top + thick - 4, 1.5, 6);
    context.textAlign = "center";
    context.fillText(text, at, top + thick + 4);
  }
}
