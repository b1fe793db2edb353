/* Sends a page's answers without leaving the page before they are stored. */

import { Delivery } from "./delivery.js";
import { keepDraft } from "./draft.js";
import { RETRY_AFTER_MS, showSending } from "./guard.js";
import { forget } from "./kept.js";

/**
 * Send every form marked `data-send` in the background, and go on where the server says.
 *
 * The server stores a page once however often it comes, so that a lost answer can be asked for again. What it does not
 * answer with an address, such as a page that lacks an answer, is sent once more as without scripts, and the person
 * sees what the server has to say.
 */
export function sendForms(root) {
  root.querySelectorAll("form[data-send]").forEach((form) => {
    keepDraft(form);
    send(form);
  });
}

function send(form) {
  const delivery = new Delivery(form, { whenBusy: (isBusy) => showSending(form, isBusy) });
  let isSending = false;
  let isNative = false;
  let timer = null;

  function open() {
    clearTimeout(timer);
    isSending = false;
    showSending(form, false);
  }

  form.addEventListener("submit", async (event) => {
    if (isNative) {
      return;
    }
    event.preventDefault();
    if (isSending) {
      delivery.hurry();
      return;
    }
    isSending = true;
    const { submitter } = event;
    const makeBody = () => new URLSearchParams(new FormData(form, submitter));
    const answer = await delivery.send(form.getAttribute("action"), makeBody);
    // A page can get lost on its way like an answer; then the next press must find the form open.
    timer = setTimeout(open, RETRY_AFTER_MS);
    if (typeof answer?.next === "string") {
      forget(form.elements.nonce.value);
      location.assign(answer.next);
    } else {
      isNative = true;
      form.requestSubmit(submitter);
      isNative = false;
    }
  });

  // A key that is held down would ask a server in trouble thirty times a second.
  form.addEventListener("keydown", (event) => {
    if (event.repeat && event.key === "Enter" && event.target.type !== "textarea") {
      event.preventDefault();
    }
  });
  window.addEventListener("pageshow", (event) => {
    if (event.persisted && !delivery.isWaiting) {
      open();
    }
  });
}
