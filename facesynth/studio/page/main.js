// The studio's page: what the windows have in common, and the keys that work everywhere.

import { connect, on, ask } from "/page/link.js";
import { store, watch, changed, takeIn, choose, show, currentLine, currentTake, change, motionOf, rowAt, reportTo, say } from "/page/store.js";
import * as sound from "/page/sound.js";
import { openFace } from "/page/face.js";
import * as timeline from "/page/timeline.js";
import * as inspector from "/page/inspector.js";
import * as map from "/page/map.js";
import * as recording from "/page/recording.js";
import * as exporting from "/page/export.js";
import * as corpus from "/page/corpus.js";
import { beginning } from "/page/view.js";
import { measured, faceCame, timed, next } from "/page/measure.js";

const byId = (id) => document.getElementById(id);
let face = null;

async function begin() {
  reportTo((text, bad) => {
    byId("status").textContent = text;
    byId("status").classList.toggle("bad", bad);
  });
  listen();
  buttons();
  keys();
  for (const part of [timeline, inspector, exporting, corpus]) part.begin();
  face = await openFace(byId("face-canvas"), byId("face-note"));
  await Promise.all([recording.begin(), map.begin()]);
  watch("motion time recording", pose);
  watch("time", () => (byId("clock").textContent = `${sound.time().toFixed(3)} s`));
  watch("time", run);
  watch("choice project", lists);
  watch("choice", () => Promise.resolve(sound.loadLine()).then(loaded));
  connect();
}

function loaded() {
  byId("loop").checked = sound.loop.on;
  beginning();
  timeline.draw();
}

function listen() {
  on("all", (message) => {
    Object.assign(store, { corpus: message.corpus, model: message.model, outputs: message.outputs, reports: message.reports });
    for (const job of message.jobs) store.jobs.set(job.number, job);
    corpus.setMethods(message.methods);
    if (face) byId("face-note").textContent = message.model ? "" : "There is no model yet: train one on the page of the corpus.";
    document.title = `${message.folder.split("/").at(-1)} – facesynth studio`;
    changed("corpus");
    store.places = message.markers;
    if (face) markers();
    takeIn(message.project);
    show();
    measured.ready = true;
  });
  on("project", takeIn);
  on("face", heardFace);
  on("choices", (message) => {
    if (message.line !== store.line || message.take !== store.take) return;
    store.choices = message.rows;
    store.choicesRevision = message.revision;
    changed("choices");
  });
  on("corpus", (message) => {
    store.corpus = message.corpus;
    if (message.changed.length) say(`changed on disk: ${message.changed.join(", ")}`);
    changed("corpus");
  });
  on("note", ({ lines }) => lines.length && say(lines.join("; "), true));
  on("closed", ({ reason }) => say(reason || "the studio was closed; what was done is kept", true));
}

function markers() {
  store.markers ??= face.mark(store.places);
  byId("markers").disabled = !store.markers;
}

function heardFace(message) {
  if (message.line === undefined || message.line !== store.line) return;
  if (message.ghost) {
    if (byId("ghost").value !== `take:${message.take}`) return undefined;
    store.compared = motionOf(message);
    return changed("motion");
  }
  if (message.take !== store.take) return;
  const motion = motionOf(message, store.motion);
  store.motion = motion;
  if (!message.trial && message.last) settle(message.revision);
  faceCame(message);
  changed("motion");
}

/** The motion is whole again: what it was before stays as a ghost. */
function settle(revision) {
  const key = [store.line, store.take].join("\n");
  if (store.settled?.key === key && store.settled.revision !== revision) store.before = store.settled.motion;
  if (store.settled?.revision !== revision || store.settled.key !== key) {
    store.settled = { key, revision, motion: { ...store.motion, rows: store.motion.rows.slice() } };
  }
  store.shownRevision = revision;
}

function pose() {
  if (!face) return;
  if (!store.motion) return store.picked ? face.pose(store.picked.rows, store.picked.names) : undefined;
  const time = sound.time();
  const row = rowAt(store.motion, time);
  if (store.picked) face.pose(store.picked.rows, store.picked.names);
  else face.pose(row, store.motion.names);
  const wanted = byId("ghost").value;
  const own = store.recording?.own ? store.recording : null;
  const pale = store.compared ?? { before: store.before, recording: own }[wanted];
  if (pale || face.pale) face.ghost(pale ? rowAt(pale, time) : null, pale?.names);
  const heat = byId("heat").checked;
  if (heat || face.heated) face.heat(heat && own ? row : null, own ? rowAt(own, time) : null);
  face.heated = heat;
}

/** While the sound plays, everything follows its clock. */
function run() {
  byId("play").textContent = sound.playing() ? "Pause" : "Play";
  if (!sound.playing() || run.going) return;
  run.going = true;
  const tick = () => {
    run.going = sound.playing();
    if (!run.going) return;
    byId("clock").textContent = `${sound.time().toFixed(3)} s`;
    sound.compare();
    pose();
    recording.follow();
    timeline.draw();
    requestAnimationFrame(tick);
  };
  requestAnimationFrame(tick);
}

function lists() {
  const lines = store.project.order;
  byId("line").replaceChildren(...lines.map((name) => new Option(name, name, false, name === store.line)));
  const takes = currentLine()?.takes ?? [];
  byId("take").replaceChildren(...takes.map((take) => new Option(take.name, take.name, false, take.name === store.take)));
  byId("undo").disabled = !store.project.can_undo;
  byId("redo").disabled = !store.project.can_redo;
  ghosts(takes);
  for (const id of ["new-take", "remove-take", "play", "export"]) byId(id).disabled = !store.line;
}

/** Any other take of the line can be seen over the face. */
function ghosts(takes) {
  const list = byId("ghost");
  const chosen = list.value;
  for (const old of [...list.options].filter((one) => one.value.startsWith("take:"))) old.remove();
  for (const { name } of takes) if (name !== store.take) list.add(new Option(`take ${name}`, `take:${name}`));
  list.value = [...list.options].some((one) => one.value === chosen) ? chosen : "";
  if (list.value !== chosen || (chosen.startsWith("take:") && !store.compared)) ghostChosen();
}

function buttons() {
  const press = (id, action) => byId(id).addEventListener("click", action);
  press("undo", () => change("undo", {}, "undone"));
  press("redo", () => change("redo", {}, "done again"));
  press("play", () => (sound.playing() ? sound.stop() : sound.play()));
  press("new-take", async () => {
    if (await change("add_take", { line: store.line, take: store.take }, "a new take")) choose(store.line, currentLine().takes.at(-1).name);
  });
  press("remove-take", () => change("remove_take", { line: store.line, take: store.take }, "the take is removed; undo brings it back"));
  press("face-reset", () => face?.reset());
  press("tab-perform", () => turnTo("perform"));
  press("tab-corpus", () => turnTo("corpus"));
  press("new-line", openNewLine);
  press("new-line-upload", (event) => upload(event));
  press("new-line-add", (event) => addUtterance(event));
  byId("line").addEventListener("change", (event) => choose(event.target.value, null));
  byId("take").addEventListener("change", (event) => choose(store.line, event.target.value));
  byId("ghost").addEventListener("change", ghostChosen);
  byId("markers").addEventListener("change", () => {
    store.markers.show(byId("markers").checked);
    face.ask();
  });
  byId("heat").addEventListener("change", () => {
    if (byId("heat").checked && !store.recording?.own) say("there is no recording of this line to compare with", true);
    pose();
  });
}

function ghostChosen() {
  const [, take] = /^take:(.+)$/.exec(byId("ghost").value) ?? [];
  if (take) return void ask("compare", { line: store.line, take }).catch((error) => say(error.message, true));
  store.compared = null;
  return changed("motion");
}

function turnTo(page) {
  for (const name of ["perform", "corpus"]) {
    byId(name).hidden = name !== page;
    byId(`tab-${name}`).setAttribute("aria-pressed", String(name === page));
  }
  corpus.refresh();
}

function openNewLine() {
  const rows = store.corpus.utterances.filter((row) => row.usable);
  byId("new-line-utterance").replaceChildren(...rows.map((row) => new Option(`${row.id}: ${row.text}`, row.id)));
  byId("new-line-dialog").showModal();
}

async function upload(event) {
  event.preventDefault();
  const file = byId("new-line-file").files[0];
  if (!file) return say("choose a file first", true);
  say(`${file.name}: its phones are being found …`);
  const address = `/upload?${new URLSearchParams({ name: file.name, text: byId("new-line-text").value })}`;
  const answer = await fetch(address, { method: "POST", body: file });
  const facts = await answer.json().catch(() => ({ error: "the studio refused the file" }));
  if (!answer.ok) return say(facts.error, true);
  byId("new-line-dialog").close();
  say(`${facts.line} was added`);
  return choose(facts.line, null);
}

async function addUtterance(event) {
  event.preventDefault();
  try {
    const { line } = await ask("add_utterance", { utterance: byId("new-line-utterance").value, base: store.project.revision });
    byId("new-line-dialog").close();
    say(`${line} was added`);
    choose(line, null);
  } catch (error) {
    say(error.message, true);
  }
}

/** Space, undo and redo work wherever no text is being written. */
function keys() {
  document.addEventListener("keydown", (event) => {
    const writing = event.target.matches("input:not([type=checkbox]):not([type=range]), textarea");
    const control = event.ctrlKey || event.metaKey;
    if (control && event.key.toLowerCase() === "z" && !writing) {
      event.preventDefault();
      change(event.shiftKey ? "redo" : "undo", {}, event.shiftKey ? "done again" : "undone");
    } else if (control && event.key.toLowerCase() === "y" && !writing) {
      event.preventDefault();
      change("redo", {}, "done again");
    } else if (event.key === " " && !writing && !event.target.matches("button, select, a, input")) {
      event.preventDefault();
      if (sound.playing()) sound.stop();
      else sound.play();
    }
  });
}

// For benchmarks and tests.
window.facesynth = {
  store, measured, sound, timeline, map,
  get face() { return face; },
  timed: (name, facts) => timed(store.project.revision, name, facts),
  next: (phone) => next(store.line, store.take, phone),
};
begin().catch((error) => say(`the page cannot begin: ${error.message}`, true));
