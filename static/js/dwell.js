/* Measures how long things last that begin and end, with the window in front. */

/** Calls `report(key, milliseconds)` whenever something ends, and when it is interrupted. */
export class Dwell {
  #report;
  #present = new Set();
  #since = new Map();
  #isPaused = false;

  constructor(report) {
    this.#report = report;
  }

  enter(key) {
    this.#present.add(key);
    if (!this.#isPaused && !this.#since.has(key)) {
      this.#since.set(key, performance.now());
    }
  }

  leave(key) {
    this.#present.delete(key);
    this.#end(key);
  }

  pause() {
    this.#isPaused = true;
    [...this.#since.keys()].forEach((key) => this.#end(key));
  }

  resume() {
    this.#isPaused = false;
    this.#present.forEach((key) => this.enter(key));
  }

  /** Report what lasts, up to now. */
  flush() {
    if (!this.#isPaused) {
      this.pause();
      this.resume();
    }
  }

  #end(key) {
    if (this.#since.has(key)) {
      const milliseconds = performance.now() - this.#since.get(key);
      this.#since.delete(key);
      this.#report(key, milliseconds);
    }
  }
}
