// The nearest distance over the last minutes. Unknown is hatched, a pause is empty, nothing is drawn through it.

import { FONT, colours, fit, hatching, look } from "./canvas.js";
import { CLEAR, OBSTACLE, UNKNOWN, metres } from "./words.js";

const JOIN_MS = 1000; // a longer pause is "stale" and is left empty

const GRAVITY = { [CLEAR]: 0, [UNKNOWN]: 1, [OBSTACLE]: 2 };

export class History {
  #points = []; // {bornMs, verdict, cm}, oldest first, one a step
  #spanMs = 120_000;
  #stepMs = 250;
  #drawnMs = -Infinity;
  #look = -1;

  constructor(canvas) {
    this.canvas = canvas;
  }

  /** Forget everything. */
  reset() {
    this.#points = [];
    this.#drawnMs = -Infinity;
  }

  /** Take the gateway's history; `bornOf(ageMs)` is the moment on this browser's clock. */
  load(document, bornOf) {
    this.#spanMs = document.span_ms;
    this.#stepMs = document.step_ms;
    this.#points = document.points.map(([ageMs, verdict, cm]) => ({ bornMs: bornOf(ageMs), verdict, cm }));
  }

  /** Take one scan. */
  add(bornMs, verdict, cm) {
    const last = this.#points.at(-1);
    const point = { bornMs, verdict, cm };
    if (last !== undefined && bornMs <= last.bornMs) return;
    if (last !== undefined && Math.floor(last.bornMs / this.#stepMs) === Math.floor(bornMs / this.#stepMs)) {
      const isWorse =
        GRAVITY[verdict] > GRAVITY[last.verdict] ||
        (verdict === OBSTACLE && last.verdict === OBSTACLE && cm < last.cm);
      if (isWorse) Object.assign(last, { verdict, cm });
      return;
    }
    this.#points.push(point);
    const oldest = bornMs - this.#spanMs - 2 * this.#stepMs;
    while (this.#points.length > 0 && this.#points[0].bornMs < oldest) this.#points.shift();
  }

  /** Least distance of the span in centimetres, or null. */
  least(nowMs) {
    const all = this.#points.filter((point) => point.verdict === OBSTACLE && nowMs - point.bornMs <= this.#spanMs);
    return all.length === 0 ? null : Math.min(...all.map((point) => point.cm));
  }

  /** Draw; `maxM` is what a scan covers, `marginM` the distance that the autopilot keeps, or null. */
  draw(nowMs, maxM, marginM) {
    if (nowMs - this.#drawnMs < this.#stepMs && this.#look === look()) return;
    this.#drawnMs = nowMs;
    this.#look = look();
    const { context, width, height } = fit(this.canvas);
    const { ink, muted, line, clear, clearFill, obstacle, warn, margin } = colours();
    const left = 42;
    const right = width - 10;
    const top = 10;
    const bottom = height - 24;
    const xOf = (bornMs) => right - ((nowMs - bornMs) / this.#spanMs) * (right - left);
    const yOf = (m) => bottom - (Math.min(m, maxM) / maxM) * (bottom - top);

    context.save();
    context.beginPath();
    context.rect(left, top - 4, right - left, bottom - top + 4);
    context.clip();
    const hatch = hatching(context);
    const joinMs = JOIN_MS;
    this.#points.forEach((point, index) => {
      // A scan holds until the next one, unless that is long in coming.
      const next = this.#points[index + 1]?.bornMs ?? nowMs;
      const x = xOf(point.bornMs);
      const stepWidth = xOf(next - point.bornMs <= joinMs ? next : point.bornMs + this.#stepMs) - x + 0.5;
      if (x < left - stepWidth) return;
      if (point.verdict === UNKNOWN) {
        context.fillStyle = hatch;
        context.fillRect(x, top, stepWidth, bottom - top);
      } else if (point.verdict === CLEAR) {
        context.fillStyle = clearFill;
        context.fillRect(x, top, stepWidth, bottom - top);
        context.fillStyle = clear;
        context.fillRect(x, top - 3, stepWidth, 5);
      } else {
        const m = point.cm / 100;
        context.fillStyle = clearFill;
        context.fillRect(x, yOf(m), stepWidth, bottom - yOf(m));
        context.fillStyle = m < maxM / 4 ? obstacle : warn;
        context.fillRect(x, yOf(m) - 7, stepWidth, 7);
      }
    });
    context.strokeStyle = ink;
    context.lineWidth = 2.5;
    context.lineJoin = "round";
    context.beginPath();
    let previous = null;
    for (const point of this.#points) {
      if (point.verdict !== OBSTACLE) {
        previous = null;
        continue;
      }
      const x = xOf(point.bornMs);
      const y = yOf(point.cm / 100);
      if (previous === null || point.bornMs - previous.bornMs > joinMs) context.moveTo(x, y);
      context.lineTo(x + 1, y);
      previous = point;
    }
    context.stroke();
    context.restore();

    context.strokeStyle = line;
    context.lineWidth = 1;
    context.font = `600 13px ${FONT}`;
    context.fillStyle = ink;
    context.textAlign = "right";
    context.textBaseline = "middle";
    for (const share of [0, 0.25, 0.5, 0.75, 1]) {
      const y = Math.round(yOf(maxM * share)) + 0.5;
      context.globalAlpha = share === 0 ? 1 : 0.45;
      context.beginPath();
      context.moveTo(left, y);
      context.lineTo(right, y);
      context.stroke();
      context.globalAlpha = 1;
      if (share !== 0.25 && share !== 0.75) {
        context.fillText(share === 1 ? `${Math.round(maxM)} m` : `${Math.round(maxM * share)}`, left - 6, y);
      }
    }
    if (marginM !== null && marginM < maxM) {
      context.setLineDash([8, 6]);
      context.strokeStyle = margin;
      context.lineWidth = 2;
      context.beginPath();
      context.moveTo(left, yOf(marginM));
      context.lineTo(right, yOf(marginM));
      context.stroke();
      context.setLineDash([]);
    }
    context.fillStyle = muted;
    context.textBaseline = "top";
    for (const seconds of width < 460 ? [120, 60, 0] : [120, 90, 60, 30, 0]) {
      const x = right - ((seconds * 1000) / this.#spanMs) * (right - left);
      context.textAlign = seconds === 0 ? "right" : seconds === 120 ? "left" : "center";
      context.fillText(seconds === 0 ? "now" : `−${seconds} s`, x, bottom + 6);
    }
    const least = this.least(nowMs);
    this.canvas.setAttribute(
      "aria-label",
      least === null ? "No obstacle in the last 2 minutes" : `Nearest in the last 2 minutes: ${metres(least)} m`,
    );
  }
}
