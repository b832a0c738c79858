// The page of the corpus: what is in it, what is wrong with it and where to mend it, transcripts, alignment, training.

import { ask, on } from "/page/link.js";
import { store, watch, say } from "/page/store.js";
import { make, labelled, choice } from "/page/dom.js";
import { jobRows } from "/page/export.js";

const page = document.getElementById("corpus");
const chosen = new Set();
let problems = null;
let methods = [];
/** What an evaluation is asked for, kept when the page is drawn anew. */
const settings = { "corpus-folds": 5, "corpus-references": true };

export function begin() {
  watch("corpus jobs", show);
  on("reports", ({ reports }) => {
    store.reports = reports;
    show();
  });
}

export function setMethods(names) {
  methods = names;
}

function show() {
  if (page.hidden || !store.corpus) return;
  const { corpus } = store;
  const focused = document.activeElement?.id;
  const scrolled = page.scrollTop;
  readCheck();
  page.replaceChildren(
    make("h2", { textContent: `Corpus of ${corpus.performer}${corpus.synthetic ? " (synthetic)" : ""}` }),
    make("p", { textContent: `${corpus.path}: ${corpus.utterances.length} utterances, ${minutes(corpus)} min, ${corpus.layout} at ${corpus.fps} fps; ${corpus.emotions.join(", ")}` }),
    make("div", { className: "row" },
      make("button", { id: "corpus-check", textContent: "Check it", onclick: () => run("check") }),
      make("button", { id: "corpus-align", textContent: "Place phones anew", title: "Of the utterances that are ticked; phones that were corrected by hand stay", onclick: align }),
      labelled("Method", choice(methods, store.model?.method ?? methods[0], { id: "corpus-method" })),
      make("button", { id: "corpus-train", textContent: "Train", onclick: () => run("train", { method: document.getElementById("corpus-method").value }) }),
      labelled("Folds", setting("corpus-folds", { type: "number", min: 2, max: 20, title: "So often it is trained and tested, each time on other sentences" })),
      labelled("Reference rows", setting("corpus-references", { type: "checkbox", title: "Beside the mean face and other methods that everything is measured by; each is trained, too" })),
      make("button", { id: "corpus-evaluate", textContent: "Evaluate", title: "On sentences that it did not see", onclick: evaluate })),
    ...reportRows(),
    make("div", { id: "corpus-jobs" }, ...jobRows().slice(0, 4)),
    ...problemRows(),
    table(corpus));
  page.scrollTop = scrolled;
  if (focused) document.getElementById(focused)?.focus();
}

export const refresh = show;

function reportRows() {
  if (!store.reports.length) return [];
  const links = store.reports.map((name) => make("a", { href: `/reports/${encodeURIComponent(name)}`, target: "_blank", rel: "noopener", textContent: name }));
  return [make("p", { className: "row" }, "Reports: ", ...links)];
}

function setting(id, facts) {
  const held = facts.type === "checkbox" ? "checked" : "value";
  const input = make("input", { id, ...facts, [held]: settings[id] });
  input.addEventListener("input", () => (settings[id] = input[held]));
  return input;
}

const minutes = (corpus) => (corpus.utterances.reduce((sum, row) => sum + row.duration_s, 0) / 60).toFixed(1);

function run(op, facts = {}) {
  ask(op, facts).catch((error) => say(error.message, true));
}

function evaluate() {
  run("evaluate", { method: document.getElementById("corpus-method").value, folds: Number(settings["corpus-folds"]), references: settings["corpus-references"] });
}

function align() {
  if (!chosen.size) return say("tick the utterances whose phones are to be placed anew", true);
  return run("align", { ids: [...chosen] });
}

/** What the newest check found. */
function readCheck() {
  const job = [...store.jobs.values()].reverse().find((one) => one.title === "check the corpus" && one.code !== null && one.output);
  if (!job) return;
  try {
    problems = JSON.parse(job.output).problems;
  } catch {
    problems = null;
  }
}

function problemRows() {
  if (problems === null) return [];
  const rows = problems.map(({ file, what, do: mend, grave }) => {
    const utterance = /^(?:audio|phones|motion|emotions)\/(.+)\.[^.]+$/.exec(file)?.[1] ?? what.split(":")[0];
    const there = store.corpus.utterances.some((row) => row.id === utterance);
    return make("p", { className: `problem ${grave ? "grave" : "note"}` }, make("strong", { textContent: `${file}: ` }), `${what} → ${mend} `,
      there ? make("a", { href: `#utterance-${utterance}`, textContent: "show it" }) : null);
  });
  return [make("h3", { textContent: problems.length ? `${problems.length} things were found` : "Nothing is wrong" }), make("div", { id: "problems" }, ...rows)];
}

function table(corpus) {
  const heads = ["Choose", "Utterance", "What is said", "Emotion", "Take", "Length", "Phones", "Usable"].map((text) => make("th", { textContent: text, scope: "col" }));
  return make("table", {}, make("thead", {}, make("tr", {}, ...heads)), make("tbody", {}, ...corpus.utterances.map(row)));
}

function row(facts) {
  const text = make("input", { id: `text-${facts.id}`, value: facts.text, "aria-label": `What ${facts.id} says` });
  text.addEventListener("change", () => ask("text", { utterance: facts.id, text: text.value }).then(() => say(`${facts.id}: the transcript is kept; place its phones anew to go with it`)).catch((error) => say(error.message, true)));
  const tick = make("input", { type: "checkbox", checked: chosen.has(facts.id), "aria-label": `Choose ${facts.id}` });
  tick.addEventListener("change", () => (tick.checked ? chosen.add(facts.id) : chosen.delete(facts.id)));
  return make("tr", { id: `utterance-${facts.id}` }, make("td", {}, tick), make("td", { textContent: facts.id }), make("td", {}, text), make("td", { textContent: facts.emotion }),
    make("td", { textContent: facts.take }), make("td", { textContent: `${facts.duration_s.toFixed(2)} s` }), make("td", { textContent: facts.by_hand ? "by hand" : "placed" }),
    make("td", { textContent: facts.usable ? "yes" : `no: ${facts.reason}` }));
}
