/* Starts what a researcher's page holds. Every page works without this; then it shows the moment it was loaded. */

import { startChart } from "./chart.js";
import { guardForms } from "./guard.js";
import { startLiveOverview } from "./overview.js";

guardForms(document);
document.querySelectorAll("[data-status]").forEach((overview) => startLiveOverview(overview));
document.querySelectorAll("[data-chart]").forEach((ratings) => startChart(ratings));
