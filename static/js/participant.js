/* Starts what a participant's page holds. Every page works without this. */

import { guardForms } from "./guard.js";
import { startPlayer } from "./player.js";
import { easeReturning } from "./returning.js";
import { startTiming } from "./timing.js";

guardForms(document);
easeReturning(document);
document.querySelectorAll("[data-player]").forEach((section) => startPlayer(section));
document.querySelectorAll("form[data-timed]").forEach((form) => {
  startTiming(form, document.querySelectorAll("[data-explanation] img"));
});
