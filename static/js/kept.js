/* What a page must not forget when it is loaded anew: one entry in the tab's own storage, under the page's nonce. */

const forgotten = new Set();

/** Return a part of what is kept of a page, or null. */
export function recall(nonce, part) {
  return read(nonce)[part] ?? null;
}

/** Keep a part of a page. Storage can be switched off; then a reload begins anew, and nothing else is different. */
export function keep(nonce, part, value) {
  if (forgotten.has(nonce)) {
    return;
  }
  try {
    sessionStorage.setItem(entry(nonce), JSON.stringify({ ...read(nonce), [part]: value }));
  } catch {
    // As said above.
  }
}

/** Drop what was kept of a page, for good: it is stored where it belongs. */
export function forget(nonce) {
  forgotten.add(nonce);
  try {
    sessionStorage.removeItem(entry(nonce));
  } catch {
    // As said above.
  }
}

function read(nonce) {
  try {
    return JSON.parse(sessionStorage.getItem(entry(nonce))) ?? {};
  } catch {
    return {};
  }
}

function entry(nonce) {
  return `page-${nonce}`;
}
