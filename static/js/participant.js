/* Starts what a participant's page holds. Every page works without this. */

import { Clock } from "./clock.js";
import { EventLog, logPage } from "./events.js";
import { guardForms } from "./guard.js";
import { showPictures } from "./pictures.js";
import { easeReturning } from "./returning.js";
import { sendForms } from "./sending.js";
import { startTiming } from "./timing.js";

guardForms(document);
easeReturning(document);
sendForms(document);
startPlayers();
const form = document.querySelector("form[data-nonce], form[data-timed]");
if (form !== null) {
  follow(form);
}

/* From here to the first paint, and then for as long as the page is open. */
async function follow(form) {
  const clock = new Clock(form.elements.nonce.value);
  const log = new EventLog(form, clock);
  logPage(form, log);
  if (form.matches("[data-timed]")) {
    startTiming(form, clock);
  }
  const drives = startDrives(clock);
  const behaviour = document.body.matches("[data-behaviour]") ? import("./behaviour.js") : null;
  // The view of a drive has no number: it is another picture after every step.
  const pictures = Array.from(document.querySelectorAll("img.picture:not([data-view])"));
  const views = Array.from(document.querySelectorAll("img[data-view]"));
  const stages = Array.from(document.querySelectorAll("[data-explanation]"));
  await showPictures([...pictures, ...views], stages, log);
  await clock.start();
  log.add("painted");
  (await behaviour)?.startBehaviour(form, pictures, log);
  // Until then a press goes out as it does without scripts.
  await drives;
  form.dataset.clock = "running";
}

async function startPlayers() {
  const players = document.querySelectorAll("[data-player]");
  if (players.length > 0) {
    const { startPlayer } = await import("./player.js");
    players.forEach(startPlayer);
  }
}

async function startDrives(clock) {
  const drives = document.querySelectorAll("[data-drive]");
  if (drives.length > 0) {
    const { startDrive } = await import("./drive.js");
    drives.forEach((drive) => startDrive(drive, clock));
  }
}
