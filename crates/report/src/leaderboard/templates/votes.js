"use strict";
// Shows pairs of methods' pictures beside the truth, and saves which of them is closer. Every sitting has its own random
// order of pairs and sides.

const board = JSON.parse(document.getElementById("ballot").dataset.board);
const state = document.getElementById("state");
const form = document.getElementById("voting");
const images = ["left", "truth", "right"].map((id) => document.getElementById(id));
const below = (count) => crypto.getRandomValues(new Uint32Array(1))[0] % count;
const sitting = [...crypto.getRandomValues(new Uint8Array(8))].map((byte) => byte.toString(16).padStart(2, "0")).join("");

const pairs = [];
for (const { scene, view, picture, truth, methods } of board.pictures) {
  methods.forEach((method, at) => {
    for (const other of methods.slice(at + 1)) {
      const [left, right] = below(2) ? [method, other] : [other, method];
      const vote = { scene, view, picture, left: left.id, right: right.id };
      pairs.push({ vote, files: [left.file, truth, right.file] });
    }
  });
}
// Fisher and Yates.
for (let last = pairs.length - 1; last > 0; last -= 1) {
  const other = below(last + 1);
  [pairs[last], pairs[other]] = [pairs[other], pairs[last]];
}

// The n-th vote is about the n-th pair.
const votes = [];
let saved = 0;
// When the pair was shown completely; null until then, so that nobody votes on pictures that are not there yet.
let since = null;

const sources = ({ files }) => files.map((file) => `${board.folder}/${file}`);

function buttons() {
  for (const button of form.querySelectorAll("button")) {
    const isChoice = !["back", "save"].includes(button.value);
    button.disabled = isChoice ? since === null : votes.length === 0;
  }
}

async function show() {
  const pair = pairs[votes.length];
  since = null;
  buttons();
  if (!pair) {
    state.textContent = `These were all ${pairs.length} pairs. Please save your votes.`;
    return;
  }
  const kind = board.kinds.find((one) => one.word === pair.vote.picture).title;
  state.textContent = `Pair ${votes.length + 1} of ${pairs.length}: ${kind}.`;
  sources(pair).forEach((source, at) => { images[at].src = source; });
  await Promise.allSettled(images.map((image) => image.decode()));
  if (pair !== pairs[votes.length]) return;
  since = performance.now();
  buttons();
  const next = pairs[votes.length + 1];
  if (next) sources(next).forEach((source) => { new Image().src = source; });
}

function save() {
  const { format, tool, protocol, fingerprint, methods } = board;
  const voter = form.elements.voter.value.trim() || sitting;
  const file = { format, tool, protocol, fingerprint, methods, voter, sitting, votes };
  const text = new Blob([`${JSON.stringify(file, null, 2)}\n`], { type: "application/json" });
  const link = Object.assign(document.createElement("a"), { href: URL.createObjectURL(text), download: `votes-${sitting}.json` });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  saved = votes.length;
}

function act(word) {
  if (word === "save") return save();
  if (word === "back") {
    if (!votes.pop()) return;
    saved = Math.min(saved, votes.length);
  } else {
    if (since === null) return;
    votes.push({ ...pairs[votes.length].vote, choice: word, seconds: Math.round(performance.now() - since) / 1000 });
  }
  show();
}

const keys = { ArrowLeft: "left", ArrowRight: "right", ArrowDown: "equal", Backspace: "back" };
document.addEventListener("keydown", (event) => {
  const word = keys[event.key];
  if (!word || event.repeat || event.altKey || event.ctrlKey || event.metaKey || event.target.matches("input")) return;
  event.preventDefault();
  act(word);
});
form.addEventListener("click", (event) => {
  const button = event.target.closest("button");
  if (button) act(button.value);
});
form.addEventListener("submit", (event) => event.preventDefault());
window.addEventListener("beforeunload", (event) => {
  if (votes.length > saved) event.preventDefault();
});
show();
