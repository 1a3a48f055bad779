// The gateway's clock as seen from here. The fastest frame of the last minutes is taken to have come without
// delay, so that a frame which waited on the way, or in a browser that was busy, is as old as it is.

const WINDOW_MS = 300_000;

export class ServerClock {
  #offset = Infinity;
  #previous = Infinity;
  #windowEnds = 0;

  /** Note that the gateway's time was `serverMs` when it sent what came at `nowMs`. */
  hear(serverMs, nowMs) {
    if (nowMs >= this.#windowEnds) {
      this.#windowEnds = nowMs + WINDOW_MS;
      this.#previous = this.#offset;
      this.#offset = Infinity;
    }
    this.#offset = Math.min(this.#offset, nowMs - serverMs);
  }

  /** The moment, on this browser's clock, at which something of `ageMs` at the gateway's `serverMs` began. */
  born(serverMs, ageMs) {
    return serverMs + Math.min(this.#offset, this.#previous) - ageMs;
  }
}
