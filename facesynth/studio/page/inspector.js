// What is chosen, in words and numbers: everything that the canvases do can be done here with the keyboard.

import { store, watch, changed, currentTake, change, changeTake, isDoubted, startOf, regionStart, say } from "/page/store.js";
import { ask } from "/page/link.js";
import * as sound from "/page/sound.js";
import { make, labelled, choice, refill, draft } from "/page/dom.js";
import { qualityOf } from "/page/lanes.js";
import { choosePhone } from "/page/timeline.js";
import { lookAt } from "/page/map.js";

const panel = document.getElementById("inspector");
const PHONES = "pau ae ax ah aa ao y iy ih ay aw ey eh el em en er b p m r k g ng f v ow oy th dh hh ch sh jh n d t l s z zh w uw uh".split(" ");
export const QUALITY = { right: "● right phone", viseme: "◐ other phone, right viseme", other: "○ other viseme" };
const tabs = { phone: showPhone, emotion: showEmotion, table: showTable, nodes: showNodes, options: showOptions };
let tab = "phone";

export function begin() {
  for (const name of Object.keys(tabs)) document.getElementById(`show-${name}`).addEventListener("click", () => turnTo(name));
  document.querySelector('#inspector-pane [role="tablist"]').addEventListener("keydown", (event) => {
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (!step) return;
    const names = Object.keys(tabs);
    const next = names[(names.indexOf(tab) + step + names.length) % names.length];
    turnTo(next);
    document.getElementById(`show-${next}`).focus();
  });
  watch("project choice selection choices jobs", show);
}

export function turnTo(name) {
  tab = name;
  for (const other of Object.keys(tabs)) document.getElementById(`show-${other}`).setAttribute("aria-selected", String(other === name));
  show();
}

function show() {
  const take = currentTake();
  refill(panel, ...(take ? tabs[tab](take) : [make("p", { textContent: "Choose or add a line first." })]));
}

function number(id, value, least, most, done) {
  const field = make("input", { id, type: "number", step: "0.001", min: least, max: most, value: value.toFixed(4) });
  field.addEventListener("change", () => done(Number(field.value)));
  return field;
}

const sureness = (row) => `${isDoubted(row) ? "? " : ""}${Math.round(100 * row[2])} % sure`;

function showPhone(take) {
  const k = store.phone;
  const [label, end, confidence = 1] = take.phones[k];
  const pin = new Map(take.pins).get(k);
  const row = store.choices[k];
  const last = k === take.phones.length - 1;
  return [
    make("div", { className: "row" },
      make("button", { id: "phone-before", textContent: "◀", "aria-label": "Phone before", disabled: k === 0, onclick: () => choosePhone(k - 1) }),
      make("h3", { textContent: `Phone ${k} of ${take.phones.length}` }),
      make("button", { id: "phone-after", textContent: "▶", "aria-label": "Phone after", disabled: last, onclick: () => choosePhone(k + 1) }),
      labelled("Label", choice(PHONES, label, { id: "phone-label", onchange: (event) => changeTake("relabel", { phone: k, label: event.target.value }) })),
      confidence < 1 ? make("span", { id: "phone-confidence", className: isDoubted(take.phones[k]) ? "doubted" : "", textContent: sureness(take.phones[k]) }) : null),
    make("div", { className: "row" },
      make("span", { textContent: `from ${startOf(take, k).toFixed(3)} s` }),
      last ? make("span", { textContent: `to ${end.toFixed(3)} s, with the sound` })
        : labelled("to", number("phone-end", end, startOf(take, k) + 0.005, take.phones[k + 1][1] - 0.005, (end_s) => changeTake("move_boundary", { phone: k, end_s }))),
      make("button", { id: "phone-split", textContent: "Split at the playhead", onclick: () => changeTake("split_phone", { phone: k, at_s: sound.time(), label }) }),
      make("button", { id: "phone-join", textContent: "Join with the next", disabled: last, onclick: () => changeTake("join_phones", { phone: k }) })),
    ...nodeRows(k, row, pin),
  ];
}

function nodeRows(k, row, pin) {
  if (!store.model?.explains) return [make("p", { className: "note", textContent: "This model does not tell what it chose." })];
  if (!row) return [make("p", { className: "note", textContent: "…" })];
  const quality = qualityOf(row);
  if (!quality) return [make("p", { className: "note", textContent: "Silence: no node is chosen here." })];
  const rows = [
    make("div", { className: "row" },
      make("h3", { textContent: "Node" }), make("code", { textContent: row.node }),
      make("span", { className: `quality ${quality}`, textContent: QUALITY[quality] }),
      make("span", { textContent: `${row.node_phone}, ${row.node_emotion}${row.captured ? ", recorded in a row with the one before" : row.captured === false ? ", joined to the one before" : ""}` })),
  ];
  if (store.model.pins) {
    rows.push(make("div", { className: "row" },
      pin ? make("span", { textContent: `constrained: ${pin}` }) : null,
      pin ? make("button", { id: "unpin", textContent: "Let the search choose", onclick: () => changeTake("unpin", { phone: k }) })
        : make("button", { id: "pin-chosen", textContent: "Keep this node", onclick: () => changeTake("pin", { phone: k, node: row.node }) }),
      removeButton(row.node)));
  }
  const found = store.runners?.key === runnersKey(k) ? store.runners.rows : null;
  rows.push(make("div", { className: "row" }, make("h3", { textContent: "Next best" }),
    found ? null : make("button", { id: "next-best", textContent: "Show", onclick: () => askRunners(k) })));
  if (found) rows.push(runnersUp(k, found));
  return rows;
}

function removeButton(node) {
  if (!store.model?.edits) return null;
  return make("button", { id: "remove-node", textContent: "Remove this node", onclick: () => change("remove_node", { node }, `${node} is not used any more`) });
}

const runnersKey = (k) => [store.line, store.take, k, store.project.revision].join("\n");

async function askRunners(k) {
  const key = runnersKey(k);
  try {
    const { rows } = await ask("next_best", { line: store.line, take: store.take, phone: k });
    store.runners = { key, rows };
    show();
  } catch (error) {
    say(error.message, true);
  }
}

function runnersUp(k, found) {
  const body = found.map(({ node, extra_cost }) =>
    make("tr", {}, make("td", {}, make("code", { textContent: node })), make("td", { textContent: `costs ${extra_cost.toFixed(2)} more` }),
      make("td", {}, store.model.pins ? make("button", { textContent: "Use", "aria-label": `Use ${node}`, onclick: () => changeTake("pin", { phone: k, node }) }) : "")));
  return make("table", {}, make("tbody", {}, ...body));
}

function showEmotion(take) {
  const k = store.region;
  const [emotion, end, intensity] = take.emotions[k];
  const emotions = store.model?.emotions ?? store.corpus.emotions;
  const last = k === take.emotions.length - 1;
  const slider = make("input", { id: "intensity", type: "range", min: 0, max: 1, step: 0.01, value: intensity });
  slider.addEventListener("change", () => changeTake("set_emotion", { region: k, emotion, intensity: Number(slider.value) }));
  const move = (step) => { store.region = k + step; changed("selection"); };
  return [
    make("div", { className: "row" },
      make("button", { id: "region-before", textContent: "◀", "aria-label": "Emotion before", disabled: k === 0, onclick: () => move(-1) }),
      make("h3", { textContent: `Emotion ${k + 1} of ${take.emotions.length}` }),
      make("button", { id: "region-after", textContent: "▶", "aria-label": "Emotion after", disabled: last, onclick: () => move(1) }),
      labelled("Emotion", choice(emotions, emotion, { id: "emotion", onchange: (event) => changeTake("set_emotion", { region: k, emotion: event.target.value, intensity }) })),
      labelled("Intensity", slider), make("output", { textContent: `${Math.round(100 * intensity)} %` })),
    make("div", { className: "row" },
      make("span", { textContent: `from ${regionStart(take, k).toFixed(3)} s` }),
      last ? make("span", { textContent: `to ${end.toFixed(3)} s, with the sound` })
        : labelled("to", number("region-end", end, regionStart(take, k) + 0.02, take.emotions[k + 1][1] - 0.02, (end_s) => changeTake("move_emotion", { region: k, end_s }))),
      make("button", { id: "cross-fade", textContent: "Cross-fade to the next", disabled: last, onclick: () => changeTake("cross_fade", { region: k, length_s: 0.4 }) })),
    ...painting(take, emotions),
    ...curveRows(take),
  ];
}

function painting(take, emotions) {
  const words = take.words.length ? take.words.map(([label, start], n) => [n, `${label} (${start.toFixed(2)} s)`]) : take.phones.map(([label], n) => [n, `${label} ${n}`]);
  const span = (n) => (take.words.length ? [take.words[n][1], take.words[n][2]] : [startOf(take, n), take.phones[n][1]]);
  const from = choice(words, 0, { id: "paint-from", ...draft(0) });
  const to = choice(words, words.length - 1, { id: "paint-to", ...draft(words.length - 1) });
  const emotion = choice(emotions, emotions[0], { id: "paint-emotion", ...draft(emotions[0]) });
  const strength = make("input", { id: "paint-intensity", ...draft(1), type: "number", min: 0, max: 1, step: 0.05, value: 1 });
  const paint = () => changeTake("paint_emotion", { start_s: span(Number(from.value))[0], end_s: span(Number(to.value))[1], emotion: emotion.value, intensity: Number(strength.value) });
  return [make("h3", { textContent: "A new region" }),
    make("div", { className: "row" }, labelled("from", from), labelled("to", to), labelled("felt", emotion), labelled("intensity", strength),
      make("button", { id: "paint", textContent: "Set", onclick: paint }))];
}

function curveRows(take) {
  const put = () => {
    const time = Number(sound.time().toFixed(4));
    const value = Number(document.getElementById("curve-value").value);
    const points = [...take.curve.filter(([t]) => Math.abs(t - time) > 1e-3), [time, value]].sort((a, b) => a[0] - b[0]);
    changeTake("set_curve", { points });
  };
  const rows = take.curve.map(([time, value], n) => make("tr", {}, make("td", { textContent: `${time.toFixed(3)} s` }), make("td", { textContent: `${Math.round(100 * value)} %` }),
    make("td", {}, make("button", { textContent: "Remove", "aria-label": `Remove the point at ${time.toFixed(3)} s`, onclick: () => changeTake("set_curve", { points: take.curve.filter((_, i) => i !== n) }) }))));
  return [make("h3", { textContent: "Intensity over time (times that of each region)" }),
    make("div", { className: "row" }, labelled("value", make("input", { id: "curve-value", ...draft(0.5), type: "number", min: 0, max: 1, step: 0.05, value: 0.5 })),
      make("button", { id: "curve-put", textContent: "Put a point at the playhead", onclick: put }),
      make("button", { id: "curve-clear", textContent: "No curve", disabled: !take.curve.length, onclick: () => changeTake("set_curve", { points: [] }) })),
    make("table", {}, make("tbody", {}, ...rows))];
}

const SHOWN = 200; // rows of the table at once

function showTable(take) {
  const pins = new Map(take.pins);
  const first = Math.max(0, Math.min(store.phone - SHOWN / 2, take.phones.length - SHOWN));
  const rows = take.phones.slice(first, first + SHOWN).map(([label, end], n) => {
    const k = first + n;
    const quality = qualityOf(store.choices[k]);
    const field = make("input", { type: "number", step: "0.001", value: end.toFixed(3), "aria-label": `End of phone ${k}`, disabled: k === take.phones.length - 1 });
    field.addEventListener("change", () => changeTake("move_boundary", { phone: k, end_s: Number(field.value) }));
    return make("tr", { className: k === store.phone ? "selected" : "" },
      make("td", {}, make("button", { textContent: k, "aria-label": `Choose phone ${k}`, onclick: () => choosePhone(k) })),
      make("td", {}, choice(PHONES, label, { "aria-label": `Label of phone ${k}`, onchange: (event) => changeTake("relabel", { phone: k, label: event.target.value }) }),
        (take.phones[k][2] ?? 1) < 1 ? make("span", { className: isDoubted(take.phones[k]) ? "doubted" : "", textContent: ` ${sureness(take.phones[k])}` }) : ""),
      make("td", { textContent: startOf(take, k).toFixed(3) }), make("td", {}, field),
      make("td", { className: `quality ${quality ?? ""}` }, quality ? `${QUALITY[quality].slice(0, 1)} ${store.choices[k].node}` : "",
        pins.get(k) ? make("div", { className: "note", textContent: "constrained" }) : null));
  });
  const heads = ["No.", "Label", "From", "To", "Node"].map((text) => make("th", { textContent: text, scope: "col" }));
  return [make("table", {}, make("thead", {}, make("tr", {}, ...heads)), make("tbody", {}, ...rows))];
}

function showNodes() {
  const { removed, drawn } = store.project;
  const gone = removed.map((node) => make("div", { className: "row" }, make("code", { textContent: node }),
    make("button", { textContent: "Restore", "aria-label": `Restore ${node}`, onclick: () => change("restore_node", { node }, `${node} may be used again`) })));
  const made = drawn.map(({ title, phone, emotion, frames, node }) => make("div", { className: "row" }, make("strong", { textContent: title || "untitled" }),
    make("code", { textContent: node }), make("span", { textContent: `${phone}, ${emotion}, ${frames} frames` }),
    removed.includes(node) ? null : make("button", { textContent: `Use at phone ${store.phone}`, "aria-label": `Use at phone ${store.phone}: ${node}`, onclick: () => changeTake("pin", { phone: store.phone, node }, `${node} is used`) }),
    removed.includes(node) ? null : make("button", { textContent: "Remove", "aria-label": `Remove ${node}`, onclick: () => change("remove_node", { node }) })));
  const none = make("p", { className: "note", textContent: store.model?.edits ? "none" : "This model takes no edits of its nodes." });
  const keeping = store.model?.edits ? [make("div", { className: "row" },
    make("button", { id: "keep-edits", textContent: "Keep in the corpus", onclick: keepEdits }),
    make("span", { className: "note", textContent: "Whatever is trained on the corpus from then on goes by what is removed and drawn here." }))] : [];
  return [...suspects(removed), ...keeping, make("h3", { textContent: "Removed nodes" }), ...(gone.length ? gone : [none]), make("h3", { textContent: "Drawn nodes" }), ...(made.length ? made : [none.cloneNode(true)])];
}

const keepEdits = () => ask("keep_edits").then(({ count }) => say(`${count} edits are in the corpus now`)).catch((error) => say(error.message, true));

/** Nodes that had better be looked at, the worst first, as the newest search for them found. */
function suspects(removed) {
  if (!store.model?.mapped.length) return [];
  const job = [...store.jobs.values()].reverse().find((one) => one.title === "find suspicious nodes");
  const find = make("button", { id: "find-suspects", textContent: "Find them", disabled: job?.code === null, onclick: () => ask("suspects").catch((error) => say(error.message, true)) });
  const head = make("div", { className: "row" }, make("h3", { textContent: "Suspicious nodes" }), find, make("span", { textContent: job?.code === null ? "looking …" : "" }));
  if (job?.code !== 0) return [head];
  const rows = JSON.parse(job.output).suspects.filter(({ node }) => !removed.includes(node)).map(({ node, phone, reasons }) => make("div", { className: "row" },
    make("button", { textContent: node, "aria-label": `Look at ${node}`, onclick: () => lookAt(phone, node) }),
    store.model.edits ? make("button", { textContent: "Remove", "aria-label": `Remove ${node}`, onclick: () => change("remove_node", { node }, `${node} is not used any more`) }) : null,
    make("span", { className: "note", textContent: `${phone}: ${reasons.join("; ")}` })));
  return [head, ...(rows.length ? rows : [make("p", { className: "note", textContent: "none is left" })])];
}

const OF_SPEAK = [
  { name: "mouth", type: "float", help: "Factor on the movement of mouth and jaw; 1 as it is.", least: 0, most: null },
  { name: "head", type: "str", help: "off, recorded, or a factor on the head's motion; 1 as it is." },
  { name: "eyes", type: "str", help: "off, recorded, or a factor on the gaze; 1 as it is." },
  { name: "size", type: "str", help: "Of exported video, WIDTHxHEIGHT in pixels; 1280x720 otherwise." },
  { name: "seed", type: "int", help: "Of everything random.", least: 0, most: null },
];

/** Controls of everything that `speak` and the model's method state, whatever method it is. */
function showOptions(take) {
  return [...OF_SPEAK, ...(store.model?.options ?? [])].map((option) => {
    const value = take.options[option.name];
    const set = (chosen) => changeTake("set_option", { name: option.name, value: chosen });
    return make("div", { className: "row option" }, labelled(option.name.replaceAll("_", " "), optionField(option, value, set)),
      make("button", { textContent: "Default", "aria-label": `Default ${option.name}`, disabled: value === undefined, onclick: () => set(null) }),
      make("span", { className: "note", textContent: option.help }));
  });
}

function optionField(option, value, set) {
  const id = `option-${option.name}`;
  if (option.type === "bool") return make("input", { id, type: "checkbox", checked: Boolean(value), onchange: (event) => set(event.target.checked) });
  if (option.type === "str") return make("input", { id, value: value ?? "", onchange: (event) => set(event.target.value || null) });
  const field = make("input", { id, type: "number", step: option.type === "int" ? 1 : "any", value: value ?? "" });
  if (option.least !== null && option.least !== undefined) field.min = option.least;
  if (option.most !== null && option.most !== undefined) field.max = option.most;
  field.addEventListener("change", () => set(field.value === "" ? null : Number(field.value)));
  return field;
}
