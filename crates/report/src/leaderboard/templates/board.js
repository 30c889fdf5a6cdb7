"use strict";
// The leaderboard: which columns and rows are shown, how rows are sorted, and the table of pairs. All choices are kept
// in the address after the #, so that they can be linked to.

const table = document.getElementById("board");
const form = document.getElementById("controls");
const groups = ["picture", "views", "metric", "region"];
// Without enough houses there are no intervals, and thus no ranks and no pairs.
const hasRanks = Boolean(form.elements.intervals);
let sorted = { key: table.dataset.first, ascending: headOf(table.dataset.first).dataset.better === "lower" };

function headOf(key) {
  return [...table.tHead.rows[0].cells].find((head) => head.dataset.key === key);
}

// Columns that are not shown initially are in a script of their own, which is loaded when a choice asks for more than
// the page holds: it keeps the first page small.
let hasAllColumns = false;
function loadColumns(then) {
  if (hasAllColumns) return then();
  const script = document.createElement("script");
  script.src = "columns.js";
  script.onload = then;
  script.onerror = () => {
    document.getElementById("status").textContent = "columns.js is missing beside this page: the other columns cannot be shown.";
  };
  document.head.append(script);
}

function boardColumns(order, hidden) {
  if (hasAllColumns) return;
  hasAllColumns = true;
  const byKey = Object.fromEntries(hidden.map((column) => [column.key, column]));
  // From the last to the first, so that each is placed before one that the table already has.
  let next = [...table.tHead.rows[0].cells].findIndex((head, at) => at > 1 && !head.dataset.metric);
  for (const key of [...order].reverse()) {
    if (headOf(key)) next = headOf(key).cellIndex;
    else addColumn(byKey[key], next);
  }
}

function addColumn(column, at) {
  const place = (row, made) => row.insertBefore(Object.assign(made, { hidden: true }), row.cells[at]);
  place(table.tHead.rows[0], headCell(column));
  for (const row of table.tBodies[0].rows) {
    const isPredicted = !row.dataset.notPredicted.split(" ").includes(column.map);
    place(row, scoreCell(column.cells[row.dataset.id], isPredicted));
  }
  if (table.tFoot) place(table.tFoot.rows[0], cell("td", column.ceiling ?? "–"));
}

function headCell({ key, picture, views, metric, region, better, least_span: least, title, metric_title }) {
  const made = Object.assign(document.createElement("th"), { scope: "col" });
  Object.assign(made.dataset, { key, picture, views, metric, region, better, least });
  const arrow = cell("span", better === "higher" ? "↑" : "↓");
  arrow.setAttribute("aria-hidden", "true");
  const words = Object.assign(cell("span", `${better} is better`), { className: "unseen" });
  const bold = cell("b", `${metric_title} `);
  bold.append(arrow, words);
  const button = Object.assign(cell("button", `${title} `), { type: "button" });
  button.append(bold);
  made.append(button);
  return made;
}

function scoreCell(score, isPredicted) {
  if (!score) return cell("td", isPredicted ? "missing" : "–");
  const made = cell("td", score.text);
  Object.assign(made.dataset, { v: score.value, r: score.rank });
  if (score.low !== null) Object.assign(made.dataset, { l: score.low, h: score.high });
  if (!hasRanks) return made;
  const small = document.createElement("small");
  if (score.interval) small.append(cell("i", score.interval), " ");
  small.append(cell("span", `rank ${score.rank}`));
  made.append(small);
  return made;
}

function chosen(name) {
  return [...form.querySelectorAll(`input[name=${name}]:checked`)].map((box) => box.value);
}

function showColumns() {
  const words = Object.fromEntries(groups.map((name) => [name, chosen(name)]));
  for (const head of table.tHead.querySelectorAll("[data-metric]")) {
    const hide = !groups.every((name) => words[name].includes(head.dataset[name]));
    if (head.hidden === hide) continue;
    head.hidden = hide;
    for (const part of [table.tBodies[0], table.tFoot]) {
      for (const row of part ? part.rows : []) row.cells[head.cellIndex].hidden = hide;
    }
  }
  table.classList.toggle("plain-values", hasRanks && !form.elements.intervals.checked);
}

function showRows() {
  const name = form.elements.name.value.trim().toLowerCase();
  for (const row of table.tBodies[0].rows) {
    const fits = row.querySelector("th").dataset.v.toLowerCase().includes(name);
    row.hidden = !fits || (form.elements.verified.checked && row.dataset.verified !== "confirmed");
  }
}

function sortBoard() {
  const head = headOf(sorted.key);
  sortRows(table.tBodies[0], head.cellIndex, sorted.ascending);
  markSorted(head, sorted.ascending);
  if (!head.dataset.metric || !hasRanks) return;
  for (const row of table.tBodies[0].rows) row.cells[0].textContent = row.cells[head.cellIndex].dataset.r || "";
  drawIntervals(head);
}

// Draws intervals in the sorted column: a line from end to end and a dot at the value, on one scale for all rows.
function drawIntervals(head) {
  table.querySelectorAll("td svg").forEach((old) => old.remove());
  const cells = [...table.tBodies[0].rows].map((row) => row.cells[head.cellIndex]).filter((cell) => cell.dataset.l);
  if (!cells.length) return;
  // At least a part of the axis that matters, with the intervals in its middle.
  const ends = [Math.min(...cells.map((cell) => Number(cell.dataset.l))), Math.max(...cells.map((cell) => Number(cell.dataset.h)))];
  const span = Math.max(ends[1] - ends[0], Number(head.dataset.least));
  const low = (ends[0] + ends[1] - span) / 2;
  const x = (value) => 4 + (92 * (Number(value) - low)) / span;
  for (const cell of cells) {
    const { l, v, h } = cell.dataset;
    const svg = element("svg", { width: 100, height: 8, viewBox: "0 0 100 8", "aria-hidden": "true" });
    svg.append(element("line", { x1: x(l), x2: x(h), y1: 4, y2: 4, stroke: "currentColor", "stroke-width": 1.5 }));
    svg.append(element("circle", { cx: x(v), cy: 4, r: 3, fill: "currentColor" }));
    cell.append(svg);
  }
}

function element(name, attributes) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  return made;
}

// The title of a column, as in "Albedo, novel views PSNR".
function title(head) {
  const metric = head.querySelector("b");
  const words = head.querySelector("button").firstChild.textContent.trim();
  return metric ? `${words} ${metric.firstChild.textContent.trim()}` : words;
}

function showStatus() {
  const rows = [...table.tBodies[0].rows];
  const shown = rows.filter((row) => !row.hidden).length;
  const count = shown === rows.length ? "" : ` ${shown} of ${rows.length} methods are shown.`;
  document.getElementById("status").textContent = `Sorted by ${title(headOf(sorted.key))}.${count}`;
}

// Each key has its own script, since pages that are opened from the disk may not fetch.
const wins = {};
let winsKey = null;
function boardWins(key, data) {
  wins[key] = data;
  if (key === winsKey) showWins();
}

function loadWins() {
  if (!headOf(sorted.key).dataset.metric || !hasRanks) return;
  winsKey = sorted.key;
  if (wins[winsKey]) return showWins();
  const script = document.createElement("script");
  script.src = `wins/${winsKey}.js`;
  document.head.append(script);
}

function showWins() {
  const { names, wins: shares, sure } = wins[winsKey];
  const made = document.createElement("table");
  made.className = "wins";
  const head = made.createTHead().insertRow();
  head.append(cell("td", ""), ...names.map((name, at) => Object.assign(cell("th", at + 1), { title: name, scope: "col" })));
  const body = made.createTBody();
  names.forEach((name, row) => {
    const cells = names.map((other, column) => {
      const one = cell("td", shares[row][column] ?? "");
      if (sure[row][column]) one.classList.add("sure", sure[row][column] > 0 ? "over" : "under");
      return one;
    });
    body.insertRow().append(Object.assign(cell("th", `${row + 1} ${name}`), { scope: "row", title: name }), ...cells);
  });
  const words = cell("p", `Percentage of draws won, by ${title(headOf(winsKey))}.`);
  words.className = "small";
  document.getElementById("wins").replaceChildren(words, made);
}

function cell(name, text) {
  const made = document.createElement(name);
  made.textContent = text;
  return made;
}

function remember() {
  const words = new URLSearchParams();
  for (const name of groups) words.set(name, chosen(name).join(","));
  if (form.elements.name.value) words.set("name", form.elements.name.value);
  if (form.elements.verified.checked) words.set("verified", "1");
  if (hasRanks && !form.elements.intervals.checked) words.set("intervals", "0");
  words.set("sort", (sorted.ascending ? "" : "-") + sorted.key);
  history.replaceState(null, "", `#${words}`);
}

function recall() {
  const words = new URLSearchParams(location.hash.slice(1));
  const sort = words.get("sort");
  if (!sort) return;
  for (const name of groups) {
    const values = (words.get(name) || "").split(",");
    form.querySelectorAll(`input[name=${name}]`).forEach((box) => { box.checked = values.includes(box.value); });
  }
  form.elements.name.value = words.get("name") || "";
  form.elements.verified.checked = words.has("verified");
  if (hasRanks) form.elements.intervals.checked = words.get("intervals") !== "0";
  const key = sort.replace(/^-/, "");
  if (headOf(key)) sorted = { key, ascending: !sort.startsWith("-") };
}

// Shows what is chosen, once the page holds all columns.
function update() {
  loadColumns(() => {
    showColumns();
    showRows();
    showStatus();
    remember();
  });
}

form.addEventListener("input", update);
form.addEventListener("submit", (event) => event.preventDefault());
table.tHead.addEventListener("click", (event) => {
  const head = event.target.closest("button") && event.target.closest("th");
  if (!head) return;
  const key = head.dataset.key;
  const first = head.dataset.better !== "higher";
  sorted = { key, ascending: sorted.key === key ? !sorted.ascending : first };
  sortBoard();
  showStatus();
  remember();
  loadWins();
});
// Shows what the address holds. An address without choices needs the columns of the page only.
function start() {
  const show = () => {
    recall();
    showColumns();
    showRows();
    sortBoard();
    showStatus();
    loadWins();
  };
  if (location.hash.includes("sort=")) loadColumns(show);
  else show();
}

window.addEventListener("hashchange", start);
start();
