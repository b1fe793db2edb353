/* Logs how the pictures are looked at. Loaded only where the study declares it. */

import { Dwell } from "./dwell.js";
import { watchFocus } from "./events.js";
import { keep, recall } from "./kept.js";
import { startRoving } from "./roving.js";

/* A mouse on its way elsewhere attends to nothing. */
const SHORTEST_HOVER_MS = 100;

/* From here on visits are summed up, so that the log has room for the rest. */
const MOST_ENTRIES = 300;

/**
 * Log how long each picture was on the screen and attended to, and what was replayed, stepped back to and opened.
 *
 * A picture is attended to while the pointer is on it, a finger touches it, or the keyboard's focus is on it; in the
 * player, where the focus is on the controls, that is the picture shown. Pictures are numbered as on the page.
 */
export function startBehaviour(form, pictures, log) {
  const nonce = form.elements.nonce.value;
  const visible = new Sums(nonce, "visible");
  const attended = new Sums(nonce, "attended");
  const onScreen = new Dwell((number, milliseconds) => visible.add(number, milliseconds));
  const visits = new Dwell(({ number, hand }, milliseconds) => {
    if (hand === "pointer" && milliseconds < SHORTEST_HOVER_MS) {
      return;
    }
    if (log.length < MOST_ENTRIES) {
      log.add("attended", number, `${Math.round(milliseconds)} ${hand}`);
    } else {
      attended.add(`${number} ${hand}`, milliseconds);
    }
  });
  const all = [onScreen, visits];

  pictures.forEach((picture, index) => watchPicture(picture, index + 1, onScreen, visits));
  document.querySelectorAll(".strip, .stage--single").forEach(startRoving);
  document.querySelectorAll("[data-player]").forEach((player) => watchPlayer(player, pictures, visits, log));
  document.querySelectorAll("details.twin").forEach((twin, index) => {
    twin.addEventListener("toggle", () => log.add(twin.open ? "texts_opened" : "texts_closed", index + 1));
  });
  watchFocus(
    () => all.forEach((dwell) => dwell.pause()),
    () => all.forEach((dwell) => dwell.resume()),
  );
  log.addSums(() => {
    all.forEach((dwell) => dwell.flush());
    return [...visible.rows(), ...attended.rows()];
  });
  window.addEventListener("pagehide", () => {
    all.forEach((dwell) => dwell.pause());
    visible.keep();
    attended.keep();
  });
  window.addEventListener("pageshow", (event) => event.persisted && all.forEach((dwell) => dwell.resume()));
}

/* Milliseconds by key, over all loads of the page. */
class Sums {
  #nonce;
  #event;
  #sums;

  constructor(nonce, event) {
    this.#nonce = nonce;
    this.#event = event;
    this.#sums = new Map(recall(nonce, event) ?? []);
  }

  add(key, milliseconds) {
    const name = String(key);
    this.#sums.set(name, (this.#sums.get(name) ?? 0) + milliseconds);
  }

  keep() {
    keep(this.#nonce, this.#event, [...this.#sums]);
  }

  /* A key is a picture's number, and what else there is to say. */
  rows() {
    return [...this.#sums].map(([key, milliseconds]) => {
      const [number, ...rest] = key.split(" ");
      return [this.#event, number, [Math.round(milliseconds), ...rest].join(" ")];
    });
  }
}

function watchPicture(picture, number, onScreen, visits) {
  // Words may stand for the picture, now or later.
  const places = picture.hidden ? [picture, picture.nextElementSibling] : [picture];
  const hands = Object.fromEntries(["pointer", "touch", "keyboard"].map((hand) => [hand, { number, hand }]));
  for (const place of places) {
    observe(place, number, onScreen);
    place.addEventListener("pointerenter", (event) => visits.enter(hands[handOf(event)]));
    for (const end of ["pointerleave", "pointercancel"]) {
      place.addEventListener(end, (event) => visits.leave(hands[handOf(event)]));
    }
    place.addEventListener("focus", () => place.matches(":focus-visible") && visits.enter(hands.keyboard));
    place.addEventListener("blur", () => visits.leave(hands.keyboard));
  }
}

function handOf(event) {
  return event.pointerType === "touch" ? "touch" : "pointer";
}

function observe(place, number, onScreen) {
  const observer = new IntersectionObserver(
    (changes) => {
      const { intersectionRatio } = changes[changes.length - 1];
      if (intersectionRatio >= 0.5) {
        onScreen.enter(number);
      } else {
        onScreen.leave(number);
      }
    },
    { threshold: [0, 0.5] },
  );
  observer.observe(place);
}

function watchPlayer(player, pictures, visits, log) {
  const numberOf = (event) => pictures.indexOf(event.detail) + 1;
  let shown = null;
  let isInside = false;
  const show = (number) => {
    const last = shown;
    shown = { number, hand: "keyboard" };
    if (isInside) {
      visits.leave(last);
      visits.enter(shown);
    }
  };
  player.addEventListener("player-shown", (event) => show(numberOf(event)));
  player.addEventListener("player-replayed", () => log.add("replayed"));
  player.addEventListener("player-stepped-back", (event) => log.add("stepped_back", numberOf(event)));
  player.addEventListener("focusin", (event) => {
    isInside = event.target.matches(":focus-visible");
    if (isInside) {
      visits.enter(shown);
    }
  });
  player.addEventListener("focusout", () => {
    isInside = false;
    visits.leave(shown);
  });
  const step = player.querySelector(".strip__step:not([hidden])");
  show(pictures.indexOf(step.querySelector("img")) + 1);
}
