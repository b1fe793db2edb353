/* Lets the keyboard look at the pictures of a strip as the pointer does. */

const STEPS = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1, Home: -Infinity, End: Infinity };

/**
 * Make a group of pictures one stop of the tab key, within which the arrow keys move.
 *
 * A player has controls of its own, and a group without pictures nothing to stop at.
 */
export function startRoving(group) {
  const pictures = Array.from(group.querySelectorAll("img.picture:not([hidden])"));
  if (pictures.length === 0 || group.closest("[data-player]") !== null) {
    return;
  }
  pictures.forEach((picture, index) => (picture.tabIndex = index === 0 ? 0 : -1));
  group.addEventListener("keydown", (event) => {
    const current = pictures.indexOf(event.target);
    const step = STEPS[event.key];
    if (current < 0 || step === undefined || event.altKey || event.ctrlKey || event.metaKey) {
      return;
    }
    event.preventDefault();
    moveTo(Math.min(Math.max(current + step, 0), pictures.length - 1));
  });
  group.addEventListener("focusin", (event) => {
    if (pictures.includes(event.target)) {
      pictures.forEach((picture) => (picture.tabIndex = picture === event.target ? 0 : -1));
    }
  });

  function moveTo(index) {
    pictures[index].focus();
  }
}
