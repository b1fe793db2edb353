/* A page's clock: it starts with the first paint, and a reload does not set it back. */

import { keep, recall } from "./kept.js";

/** Whole milliseconds since a page was first painted, on a clock that the loads of a page in one tab share. */
export class Clock {
  #nonce;
  #paintedAt;

  constructor(nonce) {
    const kept = recall(nonce, "paintedAt");
    this.#nonce = nonce;
    this.#paintedAt = kept !== null && kept <= now() ? kept : null;
  }

  get isRunning() {
    return this.#paintedAt !== null;
  }

  /** Zero before the first paint. */
  elapsed() {
    return this.isRunning ? Math.round(now() - this.#paintedAt) : 0;
  }

  /** Start when two frames have been drawn, unless it runs from an earlier load. */
  async start() {
    await nextFrame();
    await nextFrame();
    if (!this.isRunning) {
      this.#paintedAt = now();
      keep(this.#nonce, "paintedAt", this.#paintedAt);
    }
  }
}

function now() {
  return performance.timeOrigin + performance.now();
}

function nextFrame() {
  return new Promise((resolve) => requestAnimationFrame(resolve));
}
