/* Takes what only the server can write, tables and charts, from the page as it is now. */

const EARLY_MS = 100; // An interval is not kept to the millisecond.
const FOCUSABLE = "a[href], button, input, select, textarea, [tabindex]";

/** Return what brings every `[data-refresh]` up to date once something happened, at most once in `everyMs`.
 *
 * @param {Element} page What holds them; `data-page` is its address.
 * @param {number} everyMs How long to wait between two looks.
 * @param {(root: Element) => void} finish What has to be done to new content.
 */
export function startRefreshing(page, everyMs, finish) {
  const parts = Array.from(page.querySelectorAll("[data-refresh]"), (part) => part.id);
  const written = new Map(parts.map((id) => [id, null]));
  let seen = page.querySelector("[data-value=head_number]").textContent;
  let counted = null;
  let fetchedAt = -Infinity;
  return async function bringUpToDate(status, askedAt) {
    const counts = JSON.stringify(status.counts);
    const isNew = String(status.head.number) !== seen || (counted !== null && counts !== counted);
    counted ??= counts;
    if (parts.length === 0 || !isNew || askedAt - fetchedAt < everyMs - EARLY_MS) {
      return;
    }
    fetchedAt = askedAt;
    const response = await fetch(page.dataset.page, { headers: { "X-Poll": "1" }, redirect: "manual" });
    if (!response.ok) {
      throw new Error(`the page was answered with ${response.status}`);
    }
    const now = new DOMParser().parseFromString(await response.text(), "text/html");
    parts.forEach((id) => replace(id, now.getElementById(id), written, finish));
    seen = String(status.head.number);
    counted = counts;
  };
}

function replace(id, fresh, written, finish) {
  const old = document.getElementById(id);
  if (!old || !fresh || written.get(id) === fresh.outerHTML) {
    return;
  }
  written.set(id, fresh.outerHTML);
  const focused = Array.from(old.querySelectorAll(FOCUSABLE)).indexOf(document.activeElement);
  const scrolled = Array.from(old.querySelectorAll(".table-frame"), ({ scrollLeft, scrollTop }) => [scrollLeft, scrollTop]);
  const shown = document.importNode(fresh, true);
  finish(shown);
  old.replaceWith(shown);
  shown.querySelectorAll(".table-frame").forEach((frame, i) => frame.scrollTo(...(scrolled[i] ?? [0, 0])));
  if (focused >= 0) {
    shown.querySelectorAll(FOCUSABLE)[focused]?.focus({ preventScroll: true });
  }
}
