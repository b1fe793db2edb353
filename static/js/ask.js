/* Lets a person make a route without leaving the page: the same requests, and only what they change is put in anew. */

import { KEYS } from "./drive_keys.js";

const CHANGING = ["#languages", "[data-ask]", "#answer"];
const PATIENCE_MS = 3000;

let presses = Promise.resolve();
let numUnderWay = 0;
markKeys();

/* The form is another one after every press, so its page listens. */
document.addEventListener("submit", (event) => {
  const button = event.submitter;
  if (!event.target.matches("[data-ask]") || button === null) {
    return;
  }
  if (button.name === "action") {
    event.preventDefault();
    numUnderWay += 1;
    presses = presses.then(() => press(button.value));
  } else if (numUnderWay > 0) {
    event.preventDefault();
    presses.then(() => form().requestSubmit(form().querySelector(`[name="${button.name}"]`)));
  }
});
window.addEventListener("pageshow", (event) => event.persisted && location.reload());
document.addEventListener("keydown", (event) => {
  const action = KEYS[event.key] ?? KEYS[event.key.toLowerCase()];
  const isOurs = event.target.closest("[data-ask-keys]") !== null;
  if (action === undefined || !isOurs || event.altKey || event.ctrlKey || event.metaKey) {
    return;
  }
  event.preventDefault();
  if (!event.repeat && buttonOf(action) !== null) {
    form().requestSubmit(buttonOf(action));
  }
});

function form() {
  return document.querySelector("[data-ask]");
}

function buttonOf(action) {
  return form().querySelector(`button[name="action"][value="${action}"]`);
}

/* Presses go out one after the other: each continues the route that the one before has made, and so does a question. */
async function press(action) {
  const query = new URLSearchParams(new FormData(form()));
  query.set("action", action);
  const address = new URL(`?${query}`, location.href);
  try {
    const answer = await fetch(address);
    if (!answer.ok) {
      throw new Error(`the server answers ${answer.status}`);
    }
    const page = new DOMParser().parseFromString(await answer.text(), "text/html");
    await arrival(page.querySelector("[data-view]"));
    renew(page, action);
    history.replaceState(null, "", answer.url);
    numUnderWay -= 1;
  } catch {
    location.assign(address); // The browser shows what is the matter, or the page as it would be without scripts.
    await new Promise(() => {}); // Nothing more is to happen here.
  }
}

/* The old view stays until the new one can be painted. */
function arrival(view) {
  const picture = new Image();
  picture.src = view.getAttribute("src");
  return Promise.race([picture.decode().catch(() => {}), new Promise((resolve) => setTimeout(resolve, PATIENCE_MS))]);
}

/* What was open stays open, the focus stays on its button, and what happened is said. */
function renew(page, action) {
  const isOpen = form().querySelector("details").open;
  CHANGING.forEach((part) => document.querySelector(part)?.replaceWith(page.querySelector(part) ?? ""));
  document.title = page.title;
  form().querySelector("details").open = isOpen;
  markKeys();
  (buttonOf(action) ?? form().querySelector("[name=ask]")).focus({ preventScroll: true });
  const view = form().querySelector("[data-view]");
  const message = form().querySelector("[data-ask-message]").textContent;
  document.querySelector("[data-ask-status]").textContent = `${message} ${view.alt}`;
}

function markKeys() {
  Object.entries(KEYS).forEach(([key, action]) => form() && buttonOf(action)?.setAttribute("aria-keyshortcuts", key));
}
