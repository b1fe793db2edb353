/* Turns a list of pictures into a player. */

/**
 * Show one picture at a time, with play, pause, steps and speed.
 *
 * It starts once by itself, unless the person prefers reduced motion, and stops at the last picture.
 */
export function startPlayer(section) {
  const steps = Array.from(section.querySelectorAll(".strip__step"));
  const actions = steps.map((step) => step.querySelector(".strip__words")?.textContent ?? "");
  const announcer = section.querySelector("[data-announcer]");
  const toggle = section.querySelector("[data-toggle]");
  const speed = section.querySelector("[data-speed]");
  let current = 0;
  let timer = null;

  const isLast = () => current === steps.length - 1;
  const position = () =>
    section.dataset.position.replace("{number}", String(current + 1)).replace("{total}", String(steps.length));
  const caption = () => (current === 0 ? section.dataset.start : actions[current - 1]);

  function show(index) {
    current = Math.min(Math.max(index, 0), steps.length - 1);
    steps.forEach((step, i) => step.toggleAttribute("hidden", i !== current));
    section.querySelector(".player__position").textContent = position();
    section.querySelector(".player__action").textContent = caption();
    section.querySelector("progress").value = current + 1;
    showControls();
    report("shown");
  }

  /* For whoever follows how the pictures are looked at. */
  function report(what) {
    const detail = steps[current].querySelector("img");
    section.dispatchEvent(new CustomEvent(`player-${what}`, { detail }));
  }

  function showControls() {
    const state = timer !== null ? "pause" : isLast() ? "replay" : "play";
    toggle.querySelector(".player__label").textContent = section.dataset[state];
    toggle.querySelectorAll("[data-icon]").forEach((icon) => {
      icon.toggleAttribute("hidden", icon.dataset.icon !== state);
    });
    setEnabled(section.querySelector("[data-step='-1']"), current > 0);
    setEnabled(section.querySelector("[data-step='1']"), !isLast());
  }

  /* While playing, the position and the action; after a step by hand, also what the picture shows. */
  function announce(withPicture) {
    const picture = withPicture ? ` ${steps[current].querySelector("img").alt}` : "";
    const end = /[.。]$/.test(caption()) ? "" : ".";
    announcer.textContent = `${position()}: ${caption()}${end}${picture}`;
  }

  function pause() {
    clearTimeout(timer);
    timer = null;
    showControls();
  }

  function play() {
    clearTimeout(timer);
    timer = setTimeout(() => {
      show(current + 1);
      announce(false);
      if (isLast()) {
        pause();
      } else {
        play();
      }
    }, Number(speed.value));
    showControls();
  }

  toggle.addEventListener("click", () => {
    if (timer !== null) {
      pause();
    } else {
      if (isLast()) {
        show(0);
        announce(false);
        report("replayed");
      }
      play();
    }
  });
  section.querySelectorAll("[data-step]").forEach((button) => {
    button.addEventListener("click", () => {
      if (button.getAttribute("aria-disabled") === "true") {
        return;
      }
      pause();
      show(current + Number(button.dataset.step));
      announce(true);
      if (Number(button.dataset.step) < 0) {
        report("stepped-back");
      }
    });
  });
  speed.addEventListener("change", () => {
    if (timer !== null) {
      play();
    }
  });

  section.classList.add("player--ready");
  section.querySelector(".player__panel").hidden = false;
  show(0);
  if (steps.length > 1 && !window.matchMedia("(prefers-reduced-motion: reduce)").matches) {
    play();
  }
}

/* A button that loses its use under the finger keeps its focus: it is not `disabled`. */
function setEnabled(button, isEnabled) {
  button.setAttribute("aria-disabled", String(!isEnabled));
}
