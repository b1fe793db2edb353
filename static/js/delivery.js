/* Brings something to the server, however long the connection is gone. */

const TIMEOUT_MS = 15000;
const FIRST_WAIT_MS = 1000;
const LONGEST_WAIT_MS = 30000;

/* The server is there but cannot take it now, as with every status from 500. */
const NOT_NOW = new Set([408, 425, 429]);

/** Sends for a form, one request at a time, and tells the person below it when something does not arrive. */
export class Delivery {
  #texts;
  #notice;
  #whenBusy;
  #whenLost;
  #endWait = null;

  /** The form's `data-offline` and `data-retrying` are the texts; `whenBusy` is told when a try begins and ends. */
  constructor(form, { whenBusy = () => {}, whenLost = () => {} }) {
    this.#texts = form.dataset;
    this.#notice = addNotice(form);
    this.#whenBusy = whenBusy;
    this.#whenLost = whenLost;
  }

  /** Whether the last try failed and the next is still to come. */
  get isWaiting() {
    return this.#endWait !== null;
  }

  /** Try again now instead of later. */
  hurry() {
    this.#endWait?.();
  }

  /**
   * Send until there is an answer; return it, or null if the server wants the person to see a page instead.
   *
   * `makeBody` is asked anew for each try, which sends what is on the page by then.
   */
  async send(address, makeBody) {
    for (let wait = FIRST_WAIT_MS; ; wait = Math.min(2 * wait, LONGEST_WAIT_MS)) {
      this.#whenBusy(true);
      const { isLost, answer } = await ask(address, makeBody());
      if (!isLost) {
        this.#tell("");
        return answer;
      }
      this.#whenBusy(false);
      this.#whenLost();
      this.#tell((navigator.onLine ? this.#texts.retrying : this.#texts.offline) ?? "");
      await this.#wait(wait);
    }
  }

  /* The same words again would be read out again. */
  #tell(text) {
    if (this.#notice.textContent !== text) {
      this.#notice.textContent = text;
    }
  }

  #wait(milliseconds) {
    return new Promise((resolve) => {
      const end = () => {
        clearTimeout(timer);
        window.removeEventListener("online", end);
        this.#endWait = null;
        resolve();
      };
      const timer = setTimeout(end, milliseconds);
      window.addEventListener("online", end);
      this.#endWait = end;
    });
  }
}

async function ask(address, body) {
  const limit = new AbortController();
  const timer = setTimeout(() => limit.abort(), TIMEOUT_MS);
  try {
    const headers = { Accept: "application/json" };
    const response = await fetch(address, { method: "POST", headers, body, signal: limit.signal });
    if (response.status >= 500 || NOT_NOW.has(response.status)) {
      return { isLost: true };
    }
    const isAnswer = response.status === 200 && response.headers.get("Content-Type")?.startsWith("application/json");
    return { isLost: false, answer: isAnswer ? await response.json() : null };
  } catch {
    return { isLost: true };
  } finally {
    clearTimeout(timer);
  }
}

/* It is there from the start: a screen reader announces what changes, not what appears. */
function addNotice(form) {
  const notice = document.createElement("p");
  notice.className = "sending-notice";
  notice.setAttribute("role", "status");
  const actions = form.querySelector(".actions");
  if (actions) {
    actions.before(notice);
  } else {
    form.append(notice);
  }
  return notice;
}
