// The scan from above, nose up. The ground is "unknown": only what is known is drawn over it.

import { colours, fit, hatching, label, look } from "./canvas.js";
import { CLEAR, OBSTACLE, UNKNOWN } from "./words.js";

const RING_STEPS_M = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000];
const OPENINGS_DEG = [50, 75, 100, 180]; // half of what is drawn: the narrowest that holds all that was known
const radians = (degrees) => (degrees * Math.PI) / 180;

export class Radar {
  #opening = OPENINGS_DEG[0];

  #drawn = "";

  constructor(canvas) {
    this.canvas = canvas;
  }

  /** Another vehicle: begin narrow again. */
  reset() {
    this.#opening = OPENINGS_DEG[0];
    this.#drawn = "";
  }

  /**
   * @param {object|null} scan as the gateway tells it; null draws "unknown" everywhere.
   * @param {number|null} marginM distance that the autopilot keeps, metres.
   */
  draw(scan, marginM) {
    const key = `${look()} ${scan === null ? "" : `${scan.trusted} ${scan.state} ${scan.cm}`} ${marginM}`;
    if (key === this.#drawn) return;
    this.#drawn = key;
    const { context, width, height } = fit(this.canvas);
    context.fillStyle = hatching(context);
    context.fillRect(0, 0, width, height);
    const maxM = scan === null ? 20 : scan.max_m;
    if (scan !== null) this.#widen(scan);
    const place = this.#place(width, height);
    if (scan !== null && scan.trusted) {
      for (let index = 0; index < scan.state.length; index += 1) {
        drawSector(context, place, scan, index, maxM);
      }
    }
    drawRings(context, place, maxM);
    if (marginM !== null && marginM < maxM) drawMargin(context, place, (marginM / maxM) * place.radius);
    drawVehicle(context, place);
  }

  #widen(scan) {
    for (let index = 0; index < scan.state.length; index += 1) {
      if (Number(scan.state[index]) === UNKNOWN) continue;
      const bearing = Math.abs(((((scan.first_deg + index * scan.step_deg + 180) % 360) + 360) % 360) - 180);
      const needed = bearing + scan.step_deg / 2;
      if (needed > this.#opening) this.#opening = OPENINGS_DEG.find((opening) => opening >= needed) ?? 180;
    }
  }

  #place(width, height) {
    const opening = radians(this.#opening);
    const top = 26;
    const bottom = 26;
    const below = this.#opening > 90 ? -Math.cos(opening) : 0;
    const wide = this.#opening >= 90 ? 1 : Math.sin(opening);
    const radius = Math.max(40, Math.min((height - top - bottom) / (1 + below), (width / 2 - 24) / wide));
    const used = radius * (1 + below);
    const y = top + radius + Math.max(0, (height - top - bottom - used) / 2);
    return { x: width / 2, y, radius, opening };
  }
}

function drawSector(context, { x, y, radius }, scan, index, maxM) {
  const state = Number(scan.state[index]);
  if (state === UNKNOWN) return;
  const { obstacle, warn, clear, clearFill, ink } = colours();
  const middle = radians(scan.first_deg + index * scan.step_deg - 90);
  const half = radians(scan.step_deg / 2);
  const from = middle - half;
  const to = middle + half;
  const distanceM = state === CLEAR ? maxM : scan.cm[index] / 100;
  const inner = Math.min(1, Math.max(0, distanceM / maxM)) * radius;
  context.beginPath();
  context.moveTo(x, y);
  context.arc(x, y, inner, from - 0.003, to + 0.003);
  context.closePath();
  context.fillStyle = clearFill;
  context.fill();
  if (state === CLEAR) {
    context.beginPath();
    context.arc(x, y, radius, from - 0.003, to + 0.003);
    context.strokeStyle = clear;
    context.lineWidth = 5;
    context.stroke();
    return;
  }
  if (state !== OBSTACLE) return;
  const outer = Math.min(radius, inner + Math.max(14, radius * 0.09));
  context.beginPath();
  context.arc(x, y, outer, from, to);
  context.arc(x, y, inner, to, from, true);
  context.closePath();
  context.fillStyle = distanceM < maxM / 4 ? obstacle : warn;
  context.fill();
  context.beginPath();
  context.arc(x, y, inner, from, to);
  context.strokeStyle = ink;
  context.lineWidth = 4;
  context.stroke();
}

function drawRings(context, { x, y, radius, opening }, maxM) {
  const { line } = colours();
  const step = RING_STEPS_M.find((metres) => maxM / metres <= 4) ?? maxM;
  context.lineWidth = 1;
  context.strokeStyle = line;
  const from = -Math.PI / 2 - opening;
  const to = -Math.PI / 2 + opening;
  for (let metres = step; metres <= maxM + 1e-6; metres += step) {
    context.beginPath();
    context.arc(x, y, (metres / maxM) * radius, from, to);
    context.stroke();
  }
  context.beginPath();
  for (const bearing of [-90, -60, -30, 0, 30, 60, 90]) {
    if (radians(Math.abs(bearing)) > opening + 1e-6) continue;
    const angle = radians(bearing - 90);
    context.moveTo(x + Math.cos(angle) * radius * 0.12, y + Math.sin(angle) * radius * 0.12);
    context.lineTo(x + Math.cos(angle) * radius, y + Math.sin(angle) * radius);
  }
  context.stroke();
  // Beside the left edge of what is drawn, where they hide nothing.
  const edge = Math.min(opening, radians(100));
  const farthest = Math.floor(maxM / step + 1e-6);
  let free = 4;
  for (let ring = farthest; ring > 0; ring -= 1) {
    const at = ((ring * step) / maxM) * radius;
    const text = ring === farthest ? `${ring * step} m` : `${ring * step}`;
    const half = text.length * 4.5 + 2;
    const labelX = Math.max(free + half, x - Math.sin(edge) * at - 10);
    label(context, text, labelX, y - Math.cos(edge) * at + 14);
    free = labelX + half;
  }
}

function drawMargin(context, { x, y, opening }, at) {
  const { margin } = colours();
  context.beginPath();
  context.arc(x, y, at, -Math.PI / 2 - opening, -Math.PI / 2 + opening);
  context.setLineDash([8, 6]);
  context.strokeStyle = margin;
  context.lineWidth = 3;
  context.stroke();
  context.setLineDash([]);
}

function drawVehicle(context, { x, y }) {
  const { ink, panel } = colours();
  context.beginPath();
  context.moveTo(x, y - 15);
  context.lineTo(x + 11, y + 11);
  context.lineTo(x, y + 5);
  context.lineTo(x - 11, y + 11);
  context.closePath();
  context.fillStyle = ink;
  context.strokeStyle = panel;
  context.lineWidth = 3;
  context.stroke();
  context.fill();
}
