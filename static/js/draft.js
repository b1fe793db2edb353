/* Keeps the answers of a form that was not sent, in the tab's own storage. */

import { keep, recall } from "./kept.js";

/**
 * Keep what is answered with every change, and put it back when the page is loaded anew.
 *
 * A page that the server filled in, because it came back with errors, holds what was sent; nothing is put back there.
 */
export function keepDraft(form) {
  const nonce = form.elements.nonce.value;
  const controls = () => Array.from(form.elements).filter(isAnswer);
  if (document.querySelector("[data-error-summary]") === null && !controls().some(isFilledByServer)) {
    restore(controls(), recall(nonce, "draft") ?? {});
  }
  const keepNow = () => keep(nonce, "draft", read(controls()));
  form.addEventListener("input", keepNow);
  form.addEventListener("change", keepNow);
}

function isAnswer(control) {
  return Boolean(control.name) && !["hidden", "submit", "button", "fieldset"].includes(control.type);
}

function isChoice(control) {
  return control.type === "radio" || control.type === "checkbox";
}

function isFilledByServer(control) {
  if (isChoice(control)) {
    return control.defaultChecked;
  }
  return control.options ? control.querySelector("[selected]") !== null : control.defaultValue !== "";
}

/* A list of values by name: several boxes may share one. */
function read(controls) {
  const draft = {};
  for (const control of controls) {
    draft[control.name] ??= [];
    if (!isChoice(control) || control.checked) {
      draft[control.name].push(control.value);
    }
  }
  return draft;
}

function restore(controls, draft) {
  for (const control of controls.filter(({ name }) => name in draft)) {
    const values = draft[control.name];
    if (isChoice(control)) {
      control.checked = values.includes(control.value);
    } else {
      control.value = values[0];
    }
  }
}
