// Canvases in the screen's own pixels, and the hatching that stands for "unknown".

/** Fit a canvas to its element; its context with one unit a CSS pixel, and the size in CSS pixels. */
export function fit(canvas) {
  const ratio = Math.min(globalThis.devicePixelRatio || 1, 3);
  const width = Math.max(1, canvas.clientWidth);
  const height = Math.max(1, canvas.clientHeight);
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  return { context, width, height };
}

let cache = null;
let looks = 0;

/** A number that changes when everything has to be drawn anew: theme or size. */
export const look = () => looks;

/** The window has another size. */
export function noteResize() {
  looks += 1;
}

/** The colours of the theme, as the style sheet has them. */
export function colours() {
  if (cache !== null) return cache;
  const style = getComputedStyle(document.documentElement);
  const of = (name) => style.getPropertyValue(`--${name}`).trim();
  cache = {
    ink: of("ink"),
    muted: of("muted"),
    panel: of("panel"),
    line: of("line"),
    obstacle: of("obstacle"),
    warn: of("warn"),
    clear: of("clear"),
    clearFill: of("clear-fill"),
    hatch: of("hatch"),
    hatchFill: of("hatch-fill"),
    margin: of("margin"),
  };
  return cache;
}

/** Read the theme anew. */
export function forgetColours() {
  cache = null;
  looks += 1;
  patterns.clear();
}

const patterns = new Map();

/** Diagonal lines on the ground of "unknown". */
export function hatching(context) {
  const { hatch, hatchFill } = colours();
  const key = `${hatch}${hatchFill}`;
  let tile = patterns.get(key);
  if (tile === undefined) {
    tile = document.createElement("canvas");
    tile.width = tile.height = 20;
    const pen = tile.getContext("2d");
    pen.fillStyle = hatchFill;
    pen.fillRect(0, 0, 20, 20);
    pen.strokeStyle = hatch;
    pen.lineWidth = 3;
    pen.beginPath();
    for (const shift of [-20, -10, 0, 10, 20]) {
      pen.moveTo(shift - 2, 22);
      pen.lineTo(shift + 22, -2);
    }
    pen.stroke();
    patterns.set(key, tile);
  }
  const pattern = context.createPattern(tile, "repeat");
  const ratio = Math.min(globalThis.devicePixelRatio || 1, 3);
  pattern.setTransform(new DOMMatrix().scale(ratio > 1 ? 1 / 1.4 : 0.8));
  return pattern;
}

/** Text with a border of the ground's colour, so that it reads on anything. */
export function label(context, text, x, y, { size = 14, align = "center", weight = 600 } = {}) {
  const { ink, panel } = colours();
  context.font = `${weight} ${size}px ${FONT}`;
  context.textAlign = align;
  context.textBaseline = "middle";
  context.lineJoin = "round";
  context.lineWidth = 4;
  context.strokeStyle = panel;
  context.strokeText(text, x, y);
  context.fillStyle = ink;
  context.fillText(text, x, y);
}

export const FONT = 'system-ui, "Segoe UI", Roboto, "DejaVu Sans", sans-serif';
