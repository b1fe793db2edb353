/* Starts what a researcher's page holds. Every page works without this; then it shows the moment it was loaded. */

import { guardForms } from "./guard.js";
import { showTimes, startLivePage } from "./live.js";

guardForms(document);
showTimes(document);
document.querySelectorAll("[data-status]").forEach((page) => startLivePage(page));
document.querySelectorAll("[data-select]").forEach((field) => field.addEventListener("focus", () => field.select()));
/* On a narrow screen the navigation scrolls sideways: the page that is shown is in sight. */
document.querySelector(".dash-nav [aria-current]")?.scrollIntoView({ block: "nearest", inline: "center" });
