/* Loads a page's pictures, shows an explanation's all at once, and puts words where a picture does not come. */

const LIMIT_MS = 10000;
const WAITS_BEFORE_RETRY_MS = [500, 1500];
const PATIENCE_MS = 300;

/**
 * Wait until every picture can be painted, or has been given up, for ten seconds at most.
 *
 * Until then the styles hold back what is marked `data-explanation`; its place is reserved. A picture that comes even
 * later than that is still shown.
 */
export async function showPictures(pictures, stages, log) {
  const progress = showProgress(stages[0], pictures.length);
  const limit = pause(LIMIT_MS, "late");
  let numMissing = pictures.length;
  const arrive = () => {
    numMissing -= 1;
    progress.count(pictures.length - numMissing);
    if (numMissing === 0) {
      log.add("pictures_ready", "", Math.round(performance.now()));
    }
  };
  await Promise.all(
    pictures.map(async (picture, index) => {
      const loading = load(picture);
      const outcome = await Promise.race([loading, limit]);
      if (outcome === "there") {
        arrive();
        return;
      }
      log.add("picture_failed", index + 1, outcome);
      const takeBack = describe(picture);
      if (outcome === "late") {
        loading.then((laterOutcome) => {
          if (laterOutcome === "there") {
            takeBack();
            arrive();
          }
        });
      }
    }),
  );
  progress.end();
  stages.forEach((stage) => stage.setAttribute("data-shown", ""));
}

/** Return a promise of `value` after some time. */
export function pause(milliseconds, value) {
  return new Promise((resolve) => setTimeout(resolve, milliseconds, value));
}

/* A picture's address is its content's: all that can be done is to ask for it again. */
async function load(picture) {
  for (const wait of [0, ...WAITS_BEFORE_RETRY_MS]) {
    if (wait > 0) {
      await pause(wait);
      picture.src = picture.getAttribute("src");
    }
    try {
      await picture.decode();
      return "there";
    } catch {
      // The next try, or the words, will do.
    }
  }
  return "error";
}

/* The view of a drive changes with every step, and has words of its own. */
function describe(picture) {
  if (picture.matches("[data-view]")) {
    return () => {};
  }
  const words = make("p", "picture picture--words", picture.alt);
  words.tabIndex = 0; // Long words scroll, for keyboards too.
  picture.hidden = true;
  picture.after(words);
  const notice = tell(picture.closest("[data-picture-failed]"));
  return () => {
    words.remove();
    picture.hidden = false;
    if (notice?.parentElement.querySelector(".picture--words") === null) {
      notice.remove();
    }
  };
}

/* One notice however many pictures do not come. */
function tell(stage) {
  if (stage === null) {
    return null;
  }
  const present = stage.querySelector(".picture-notice");
  const notice = present ?? make("p", "picture-notice", stage.dataset.pictureFailed);
  if (present === null) {
    notice.setAttribute("role", "status");
    stage.append(notice);
  }
  return notice;
}

/* Pictures that come at once need no display that flashes. */
function showProgress(stage, total) {
  if (!stage?.dataset.loading) {
    return { count() {}, end() {} };
  }
  const label = make("label", "loading");
  const words = make("span", "loading__words");
  const bar = make("progress", "loading__bar");
  bar.max = total;
  label.append(words, bar);
  const count = (number) => {
    bar.value = number;
    words.textContent = stage.dataset.loading.replace("{number}", number).replace("{total}", total);
  };
  count(0);
  const timer = setTimeout(() => stage.append(label), PATIENCE_MS);
  const end = () => {
    clearTimeout(timer);
    label.remove();
  };
  return { count, end };
}

function make(name, className, text = "") {
  const element = document.createElement(name);
  element.className = className;
  element.textContent = text;
  return element;
}
