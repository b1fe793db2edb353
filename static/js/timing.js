/* Measures each item's response time: from the first paint to the last change of that item. */

import { keep, recall } from "./kept.js";

/**
 * Fill the hidden `time-<item>` inputs of a form, in milliseconds.
 *
 * A page that comes back with errors, or is loaded anew, goes on with the times of its first paint. An answer given
 * before the clock runs has no time.
 */
export function startTiming(form, clock) {
  const nonce = form.elements.nonce.value;
  const times = restore(form, recall(nonce, "times") ?? {});
  form.addEventListener("change", (event) => {
    const item = itemOf(event.target);
    if (clock.isRunning && timeOf(form, item)) {
      times[item] = clock.elapsed();
      timeOf(form, item).value = String(times[item]);
      keep(nonce, "times", times);
    }
  });
}

/** Return what a control's answer is called: a rating's name without the prefix that its control has. */
export function itemOf(control) {
  return control.name.replace(/^rating-/, "");
}

function timeOf(form, item) {
  return form.elements[`time-${item}`];
}

/* Only answers that came back with the page keep their times. */
function restore(form, kept) {
  const isAnswered = ([item]) => timeOf(form, item) && (form.elements[`rating-${item}`] ?? form.elements[item])?.value;
  const answered = Object.entries(kept).filter(isAnswered);
  answered.forEach(([item, milliseconds]) => (timeOf(form, item).value = String(milliseconds)));
  return Object.fromEntries(answered);
}
