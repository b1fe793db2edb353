/* The log of what happens on a page. */

import { keep, recall } from "./kept.js";
import { itemOf } from "./timing.js";

const MAX_EVENTS = 400;

/**
 * Entries `[event, target, value, at_ms]`, sent in the form's hidden `events` however the form is sent.
 *
 * Before the first paint the time is 0. The log goes on when the page is loaded anew. What is full stays as it is,
 * but sums always find a place.
 */
export class EventLog {
  #nonce;
  #clock;
  #entries;
  #sums = [];

  constructor(form, clock) {
    this.#nonce = form.elements.nonce.value;
    this.#clock = clock;
    this.#entries = recall(this.#nonce, "events") ?? [];
    form.addEventListener("formdata", (event) => {
      if (event.formData.has("events")) {
        form.elements.events.value = JSON.stringify(this.#complete());
        event.formData.set("events", form.elements.events.value);
      }
    });
  }

  get length() {
    return this.#entries.length;
  }

  add(event, target = "", value = "") {
    if (this.length < MAX_EVENTS) {
      this.#entries.push(this.#entry(event, target, value));
      keep(this.#nonce, "events", this.#entries);
    }
  }

  /** Have a list of `[event, target, value]` made each time the log is sent; it ends the log. */
  addSums(makeSums) {
    this.#sums.push(makeSums);
  }

  #entry(event, target, value) {
    return [event, String(target), String(value), this.#clock.elapsed()];
  }

  #complete() {
    const sums = this.#sums.flatMap((makeSums) => makeSums()).map((sum) => this.#entry(...sum));
    return [...this.#entries.slice(0, MAX_EVENTS - sums.length), ...sums];
  }
}

/** Log each change of an answer, and when the window is left and entered. */
export function logPage(form, log) {
  form.addEventListener("change", ({ target }) => log.add("changed", itemOf(target), answerOf(target)));
  watchFocus(
    () => log.add("focus_lost"),
    () => log.add("focus_regained"),
  );
}

/**
 * Call `lost` when the window is no longer in front and `regained` when it is again, in turn, however often and in
 * whatever order the browser reports it. Leaving the page is neither.
 */
export function watchFocus(lost, regained) {
  let isLost = false;
  let isLeaving = false;
  const update = (isLostNow) => {
    if (!isLeaving && isLostNow !== isLost) {
      isLost = isLostNow;
      (isLost ? lost : regained)();
    }
  };
  window.addEventListener("blur", () => update(true));
  window.addEventListener("focus", () => update(false));
  document.addEventListener("visibilitychange", () => update(document.hidden || !document.hasFocus()));
  window.addEventListener("pagehide", () => (isLeaving = true));
  window.addEventListener("pageshow", () => (isLeaving = false));
  update(document.hidden);
}

/* What somebody writes in their own words is an answer, nothing for a log: there it only has a length. */
function answerOf(control) {
  if (control.type === "checkbox") {
    return control.checked ? control.value : "";
  }
  const isOwnWords = control.type === "text" || control.type === "textarea";
  return isOwnWords ? `${control.value.length} characters` : control.value;
}
