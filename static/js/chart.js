/* Draws a table of mean ratings as bars. The table stays: a canvas says nothing to a screen reader. */

const COLOURS = [
  "#4c63d2", "#d98a1f", "#1d9a83", "#b1508f", "#7a8190", "#8c5a2b",
  "#2f9fc4", "#c2453d", "#6b8e23", "#8a63c9", "#c9a227", "#3d4658",
];
const LOWEST = 1;

/** Draw the means of one experiment, grouped by item, one bar per kind of explanation. */
export function startChart(ratings) {
  const rows = Array.from(ratings.querySelectorAll("tr[data-mean]"), (row) => row.dataset);
  const items = [...new Set(rows.map((row) => row.item))];
  const kinds = [...new Set(rows.map((row) => row.kind))];
  const mean = (item, kind) => {
    const row = rows.find((candidate) => candidate.item === item && candidate.kind === kind);
    return row?.mean ? Number(row.mean) : null;
  };
  const holder = ratings.querySelector("[data-canvas]");
  const canvas = document.createElement("canvas");
  canvas.setAttribute("role", "img");
  canvas.setAttribute("aria-label", `Mean ratings as bars, ${ratings.querySelector("h3").textContent}; the table has the numbers`);
  holder.append(canvas);
  holder.hidden = false;
  const style = getComputedStyle(document.documentElement);
  const ink = style.getPropertyValue("--ink-soft");
  const line = style.getPropertyValue("--line");
  const datasets = kinds.map((kind, i) => ({
    label: kind,
    data: items.map((item) => mean(item, kind)),
    backgroundColor: COLOURS[i % COLOURS.length],
    borderRadius: 4,
    maxBarThickness: 48,
    minBarLength: 3, // A mean of 1 stands on the axis; it is still a bar.
  }));
  return new window.Chart(canvas, { type: "bar", data: { labels: items, datasets }, options: options(ink, line, Number(ratings.dataset.highest)) });
}

function options(ink, line, highest) {
  return {
    animation: false,
    maintainAspectRatio: false,
    font: { family: getComputedStyle(document.body).fontFamily, size: 13 },
    scales: {
      x: { grid: { display: false }, border: { color: line }, ticks: { color: ink } },
      y: { min: LOWEST, max: highest, grid: { color: line }, border: { display: false }, ticks: { color: ink, stepSize: 1 } },
    },
    plugins: {
      legend: { position: "bottom", labels: { color: ink, usePointStyle: true, pointStyle: "rectRounded", padding: 16 } },
      tooltip: { callbacks: { label: (bar) => `${bar.dataset.label}: ${bar.parsed.y.toFixed(2)}` } },
    },
  };
}
