/* Measures each item's response time: from the paint of the explanation to the last change of that item. */

/**
 * Fill the hidden `time-<item>` inputs of a form, in milliseconds.
 *
 * The clock starts when all pictures are decoded and two frames have been drawn. A page that comes back with errors,
 * or is loaded anew, goes on with the clock and the times of its first paint; they wait in the tab's own storage
 * under the page's nonce. An answer given before the pictures are there has no time.
 */
export async function startTiming(form, pictures) {
  const key = `timing-${form.dataset.timed}`;
  const times = new Map();
  const kept = recall(key);
  let paintedAt = kept.paintedAt;
  if (paintedAt !== null) {
    restore(form, kept.times, times);
  }
  form.addEventListener("change", (event) => {
    if (event.target.type !== "radio" || paintedAt === null) {
      return;
    }
    const item = event.target.name.replace(/^rating-/, "");
    times.set(item, Math.round(now() - paintedAt));
    write(form, item, times.get(item));
    keep(key, paintedAt, times);
  });
  if (paintedAt === null) {
    await Promise.allSettled(Array.from(pictures, (picture) => picture.decode()));
    await nextFrame();
    await nextFrame();
    paintedAt = now();
    keep(key, paintedAt, times);
  }
}

/* Milliseconds on a clock that pages of one tab share. */
function now() {
  return performance.timeOrigin + performance.now();
}

function nextFrame() {
  return new Promise((resolve) => requestAnimationFrame(resolve));
}

function write(form, item, milliseconds) {
  form.elements[`time-${item}`].value = String(milliseconds);
}

/* Only answers that came back with the page keep their times. */
function restore(form, kept, times) {
  for (const [item, milliseconds] of Object.entries(kept)) {
    if (form.elements[`rating-${item}`]?.value) {
      times.set(item, milliseconds);
      write(form, item, milliseconds);
    }
  }
}

function keep(key, paintedAt, times) {
  try {
    sessionStorage.setItem(key, JSON.stringify({ paintedAt, times: Object.fromEntries(times) }));
  } catch {
    // Storage can be switched off; the times of this load are still measured.
  }
}

function recall(key) {
  try {
    const kept = JSON.parse(sessionStorage.getItem(key));
    if (kept !== null && kept.paintedAt <= now()) {
      return kept;
    }
  } catch {
    // As above.
  }
  return { paintedAt: null, times: {} };
}
