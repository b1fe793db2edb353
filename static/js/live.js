/* Keeps an open page of the dashboard up to date without loading it anew. */

import { startRefreshing } from "./refresh.js";

const EVERY_MS = 5000;
const UNITS = [
  ["day", 86400],
  ["hour", 3600],
  ["minute", 60],
  ["second", 1],
];
const COUNTS = {
  arrived: "agreed",
  in_progress: "in progress",
  stalled: "stalled",
  completed: "completed",
  withdrawn: "left",
  screened_out: "screened out",
};

/** Poll what the page shows while it is in view, and say politely what changed. */
export function startLivePage(overview) {
  const bringUpToDate = startRefreshing(overview, EVERY_MS, showTimes);
  let announced = null;
  let isAsking = false;
  async function refresh() {
    if (document.hidden || isAsking) {
      return;
    }
    isAsking = true;
    const askedAt = Date.now();
    try {
      const response = await fetch(overview.dataset.status, { headers: { Accept: "application/json" }, redirect: "manual" });
      if (!response.ok) {
        report(overview, isSignedOut(response) ? "You have been signed out. Load the page anew to sign in." : lost());
        return;
      }
      const status = await response.json();
      show(overview, status);
      await bringUpToDate(status, askedAt);
      report(overview, null);
      const sentence = summarise(overview, status);
      if (announced !== null && announced !== sentence) {
        overview.querySelector("[data-announcer]").textContent = sentence;
      }
      announced = sentence;
    } catch {
      report(overview, lost());
    } finally {
      isAsking = false;
    }
  }
  setInterval(refresh, EVERY_MS);
  document.addEventListener("visibilitychange", refresh);
  showTimes(overview);
  refresh();
}

function isSignedOut(response) {
  return response.type === "opaqueredirect" || response.status === 401 || response.status === 403;
}

function lost() {
  return "The server does not answer. The numbers may be old; trying again.";
}

function report(overview, problem) {
  const box = overview.querySelector("[data-problem]");
  box.hidden = problem === null;
  box.textContent = problem ?? "";
  const pulse = overview.querySelector("[data-pulse]");
  pulse.hidden = problem !== null;
  pulse.querySelector("[data-pulse-text]").textContent = `Live, updated ${new Date().toLocaleTimeString()}`;
}

/* What the study never does has no number on the page; a list of people has the number of those found. */
function summarise(overview, status) {
  if (!status.counts) {
    return `${status.num_found} found`;
  }
  return Object.entries(COUNTS)
    .filter(([name]) => overview.querySelector(`[data-count=${name}]`))
    .map(([name, words]) => `${status.counts[name]} ${words}`)
    .join(", ");
}

function show(overview, status) {
  for (const [name, value] of Object.entries(status.counts ?? {})) {
    setText(overview.querySelector(`[data-count="${CSS.escape(name)}"]`), value);
  }
  for (const { experiment, kind, layout, assigned, done } of status.cells ?? []) {
    const cell = overview.querySelector(`[data-cell="${CSS.escape([experiment, kind, layout].join("/"))}"]`);
    setText(cell?.querySelector("[data-value=assigned]"), assigned);
    setText(cell?.querySelector("[data-value=done]"), done);
  }
  (status.funnel ?? []).forEach((step, i) => showStep(overview.querySelector(`[data-step="${i}"]`), step));
  if (status.num_elsewhere !== undefined) {
    overview.querySelector("[data-elsewhere]")?.toggleAttribute("hidden", status.num_elsewhere === 0);
    setText(overview.querySelector("[data-value=num_elsewhere]"), status.num_elsewhere);
  }
  setText(overview.querySelector("[data-value=num_found]"), status.num_found ?? "");
  showHead(overview, status.head);
  if (overview.querySelector("#participants")) {
    showParticipants(overview, status.participants);
  }
  showTimes(overview);
}

function showStep(row, step) {
  for (const name of ["count", "of_previous", "of_first"]) {
    setText(row?.querySelector(`[data-value=${name}]`), step[name]);
  }
  row?.querySelector("[data-bar]").setAttribute("width", step.width);
}

function showHead(overview, head) {
  setText(overview.querySelector("[data-value=head_number]"), head.number);
  const hash = overview.querySelector("[data-value=head_hash]");
  setText(hash, head.hash.slice(0, 12));
  hash.title = head.hash;
}

/* Rows are kept and moved, so that a person who reads the table is not thrown out of it. */
function showParticipants(overview, participants) {
  const body = overview.querySelector("#participants");
  const template = overview.querySelector("#participant-row");
  const known = new Map(Array.from(body.rows, (row) => [row.dataset.participant, row]));
  participants.forEach((participant, i) => {
    const row = known.get(participant.code) ?? template.content.firstElementChild.cloneNode(true);
    known.delete(participant.code);
    showParticipant(row, participant, body.dataset.person);
    if (body.rows[i] !== row) {
      body.insertBefore(row, body.rows[i] ?? null);
    }
  });
  known.forEach((row) => row.remove());
  overview.querySelector("#no-participants").hidden = participants.length > 0;
  body.closest(".table-frame").hidden = participants.length === 0;
}

function showParticipant(row, participant, somewhere) {
  row.dataset.participant = participant.code;
  const link = row.querySelector("[data-value=code]");
  setText(link, participant.code);
  link.href = somewhere.replace("CODE", participant.code);
  const bar = row.querySelector("progress");
  bar.max = participant.num_pages;
  bar.value = participant.progress;
  bar.setAttribute("aria-label", `Pages sent by ${participant.code}`);
  setText(row.querySelector("[data-value=progress]"), `${participant.progress} of ${participant.num_pages}`);
  setText(row.querySelector("[data-value=minutes]"), participant.minutes);
  const state = row.querySelector("[data-value=state]");
  state.className = `state state--${participant.state}`;
  setText(state, participant.state_words);
  showMarks(row.querySelector("[data-value=marks]"), participant.marks);
  const cell = row.querySelector("[data-value=last_seen]");
  const time = cell.querySelector("time") ?? document.createElement("time");
  if (time.dateTime !== participant.last_seen) {
    time.dateTime = participant.last_seen;
    time.dataset.ago = "";
    cell.replaceChildren(time);
  }
}

function showMarks(cell, marks) {
  if (Array.from(cell.children, (mark) => mark.textContent).join() === marks.join()) {
    return;
  }
  const shown = marks.flatMap((words) => {
    const mark = document.createElement("span");
    mark.className = "mark";
    mark.textContent = words;
    return [mark, " "];
  });
  cell.replaceChildren(...shown);
}

/** Show each moment in the reader's own time; those of lists with how long ago it was. */
export function showTimes(root) {
  const words = new Intl.RelativeTimeFormat("en", { numeric: "auto" });
  root.querySelectorAll("time").forEach((time) => {
    const moment = new Date(time.dateTime);
    const local = moment.toLocaleString([], { dateStyle: "medium", timeStyle: "medium" });
    if (time.dataset.ago === undefined) {
      setText(time, local);
      time.title = time.dateTime;
      return;
    }
    const seconds = Math.min(0, Math.round((moment - Date.now()) / 1000));
    const [unit, size] = UNITS.find(([, length]) => -seconds >= length) ?? UNITS.at(-1);
    time.title = `${local}, ${time.dateTime}`;
    setText(time, words.format(Math.trunc(seconds / size), unit));
  });
}

function setText(element, value) {
  if (element && element.textContent !== String(value)) {
    element.textContent = String(value);
  }
}
