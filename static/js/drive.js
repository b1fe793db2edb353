/* Lets a person steer the agent without loading the page anew for every action. */

import { Delivery } from "./delivery.js";
import { KEYS } from "./drive_keys.js";
import { forget } from "./kept.js";
import { pause } from "./pictures.js";

/* A view that does not come must not keep the agent from moving: its words are there. */
const PATIENCE_MS = 3000;

/**
 * Send each action of the form within `section` and show what the agent sees then.
 *
 * Actions go out one at a time, in the order of the presses. Each carries its number: one that got lost is sent again
 * with the same number, and the server takes it once. Presses that nobody has seen the effect of are dropped when the
 * connection is lost, or when the drive went on in another window.
 */
export function startDrive(section, clock) {
  const form = section.querySelector("[data-drive-form]");
  const waiting = [];
  const delivery = new Delivery(form, { whenLost: () => (waiting.length = 0) });
  const views = new Views(section.querySelector("[data-view]"), section.dataset.preload?.split(" ") ?? []);
  // The attribute, because a browser may put back what scripts had written before.
  let step = Number(form.elements.step.getAttribute("value"));
  let isUnderWay = false;
  let next = null;

  form.addEventListener("submit", (event) => {
    event.preventDefault();
    if (next !== null) {
      location.assign(next);
    } else if (delivery.isWaiting) {
      delivery.hurry();
    } else {
      waiting.push({ action: event.submitter.value, elapsed: clock.isRunning ? String(clock.elapsed()) : "" });
      takeTurns();
    }
  });
  listenToKeys(section, form);
  window.addEventListener("pageshow", (event) => event.persisted && location.reload());

  async function takeTurns() {
    if (isUnderWay) {
      return;
    }
    isUnderWay = true;
    while (waiting.length > 0 && next === null) {
      const answer = await delivery.send(section.dataset.url, bodyOf(waiting.shift()));
      if (answer === null) {
        location.reload();
        return;
      }
      if (answer.stands || answer.step !== step + 1) {
        waiting.length = 0;
      }
      await show(answer);
    }
    isUnderWay = false;
  }

  function bodyOf({ action, elapsed }) {
    const nonce = form.elements.nonce.value;
    // The log goes along each time: which action ends the drive, only the server knows.
    return () => new URLSearchParams({ nonce, step, elapsed, action, events: new FormData(form).get("events") ?? "" });
  }

  async function show(answer) {
    if (answer.next) {
      next = answer.next;
      forget(form.elements.nonce.value);
      location.assign(next);
      return;
    }
    step = answer.step;
    await views.show(answer.picture, answer.alt);
    tell(section.querySelector("[data-drive-message]"), answer.message, answer.alt, "explains" in section.dataset);
    section.querySelector("[data-steps-left]").textContent = answer.steps_left;
    views.preload(answer.preload);
  }
}

/* Pictures of what the agent sees: the one on the page, and those that may come next. */
class Views {
  #view;
  #loaded = new Map();

  constructor(view, addresses) {
    this.#view = view;
    this.preload(addresses);
  }

  preload(addresses) {
    addresses.forEach((address) => this.#load(address));
  }

  /* The old picture stays until the new one can be painted. */
  async show(address, alt) {
    await Promise.race([this.#load(address).decode().catch(() => this.#loaded.delete(address)), pause(PATIENCE_MS)]);
    this.#view.src = address;
    this.#view.alt = alt;
  }

  #load(address) {
    if (!this.#loaded.has(address)) {
      const picture = new Image();
      picture.src = address;
      this.#loaded.set(address, picture);
    }
    return this.#loaded.get(address);
  }
}

/* What happened is for everybody; what the agent sees now is in the picture, and in words for whom the status is read to.
   Where the view is being explained, its words are for everybody too. */
function tell(status, message, alt, explains) {
  const words = document.createElement("span");
  words.className = explains ? "drive__view-words" : "visually-hidden";
  words.textContent = ` ${alt}`;
  status.replaceChildren(message, words);
}

/* Keys act while the focus is within the section, and a key that is held down acts once. A world of the study's own says
   itself which key presses which of its buttons. */
function listenToKeys(section, form) {
  section.tabIndex = -1; // A click anywhere in it brings the focus there.
  const own = [...form.querySelectorAll("button[data-key]")];
  const keys = own.length > 0 ? Object.fromEntries(own.map((button) => [button.dataset.key, button.value])) : KEYS;
  const buttonOf = (action) => action && form.querySelector(`button[value="${CSS.escape(action)}"]`);
  Object.entries(keys).forEach(([key, action]) => buttonOf(action)?.setAttribute("aria-keyshortcuts", key));
  section.addEventListener("keydown", (event) => {
    if (event.altKey || event.ctrlKey || event.metaKey) {
      return;
    }
    const button = buttonOf(keys[event.key] ?? keys[event.key.toLowerCase()]);
    const isPress = button || event.key === "Enter" || event.key === " ";
    if (button || (isPress && event.repeat)) {
      event.preventDefault();
    }
    if (button && !event.repeat) {
      form.requestSubmit(button);
    }
  });
}
