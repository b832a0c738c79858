// The timeline: what is said, felt and chosen over time; boundaries are dragged here.

import { ask, lastNumber } from "/page/link.js";
import { store, watch, changed, currentTake, changeTake, startOf, indexAt, duration, seen, sightFrom, say } from "/page/store.js";
import * as sound from "/page/sound.js";
import { trialAsked } from "/page/measure.js";
import { view, x, at, all, beginning, zoom, scroll, follow, snapped } from "/page/view.js";
import { make } from "/page/dom.js";
import { LARGEST_MM } from "/page/markers.js";
import * as lanes from "/page/lanes.js";

const canvas = document.getElementById("timeline-canvas");
const context = canvas.getContext("2d");
const curve = document.getElementById("curve");
let layout = lanes.lanesOf(200);
let drag = null;
let wanted = false;
export const counted = { drawn: 0, took: [] }; // for the benchmark

export function begin() {
  sightFrom(() => ({ at: sound.time(), from: view.start, to: view.end }));
  new ResizeObserver(fit).observe(canvas);
  watch("project selection motion choices recording time", draw);
  watch("choice", () => {
    beginning();
    draw();
  });
  watch("motion", listCurves);
  canvas.addEventListener("pointerdown", down);
  canvas.addEventListener("pointermove", moved);
  canvas.addEventListener("pointerup", up);
  canvas.addEventListener("dblclick", () => document.getElementById("phone-label")?.focus());
  canvas.addEventListener("wheel", wheel, { passive: false });
  canvas.addEventListener("keydown", key);
  curve.addEventListener("change", draw);
  const press = (id, action) => document.getElementById(id).addEventListener("click", () => { action(); draw(); });
  press("zoom-in", () => zoom(0.6, sound.time()));
  press("zoom-out", () => zoom(1 / 0.6, sound.time()));
  press("zoom-all", all);
  document.getElementById("snap").addEventListener("change", (event) => (view.snap = event.target.value));
  document.getElementById("loop").addEventListener("change", (event) => setLoop(event.target.checked));
}

/** Play what is in sight, or what was chosen on the ruler, over and over. */
function setLoop(on) {
  if (on && !(sound.loop.end > sound.loop.start)) {
    sound.loop.start = view.start;
    sound.loop.end = Math.min(view.end, duration());
  }
  sound.loop.on = on;
  if (sound.playing()) {
    sound.stop();
    sound.play();
  }
  draw();
}

function fit() {
  const scale = Math.min(devicePixelRatio, 2);
  canvas.width = Math.round(canvas.clientWidth * scale);
  canvas.height = Math.round(canvas.clientHeight * scale);
  context.setTransform(scale, 0, 0, scale, 0, 0);
  view.width = Math.max(1, canvas.clientWidth);
  layout = lanes.lanesOf(canvas.clientHeight);
  draw();
}

/** Draw before the screen shows its next picture. */
export function draw() {
  if (wanted) return;
  wanted = true;
  requestAnimationFrame(() => {
    wanted = false;
    const begun = performance.now();
    paint();
    counted.took.push(performance.now() - begun);
    if (counted.took.length > 1000) counted.took.length = 0;
  });
}

function paint() {
  counted.drawn += 1;
  const c = context;
  const take = shownTake();
  c.fillStyle = "#1d2229";
  c.fillRect(0, 0, view.width, canvas.clientHeight);
  c.font = "12px system-ui, sans-serif";
  if (!take) {
    c.fillStyle = lanes.COLOURS.soft;
    c.fillText("No line yet: press “New line…” and choose a sound or an utterance of the corpus.", 16, 40);
    return;
  }
  if (sound.playing()) follow(sound.time());
  lanes.drawRuler(c, layout.ruler);
  lanes.drawWave(c, layout.wave);
  lanes.drawWords(c, layout.words, take);
  lanes.drawPhones(c, layout.phones, take);
  lanes.drawNodes(c, layout.nodes, take);
  lanes.drawEmotions(c, layout.emotions, take);
  lanes.drawCurve(c, layout.curve, curve.value);
  c.fillStyle = lanes.COLOURS.soft;
  c.fillText(`${curve.value}${store.markers?.curves.includes(curve.value) ? `, ±${LARGEST_MM} mm` : ", 0 to 1"}`, 6, layout.curve.top + 13);
  c.fillStyle = "#ffffff";
  c.fillRect(x(sound.time()) - 0.75, 0, 1.5, canvas.clientHeight);
}

/** The take with what is being dragged in it. */
const shownTake = () => drag?.take ?? currentTake();

function listCurves() {
  if (!store.motion || curve.options.length >= store.motion.names.length) return;
  const before = curve.value || "jawOpen";
  const group = (label, names) => make("optgroup", { label }, ...names.map((name) => new Option(name, name, false, name === before)));
  curve.replaceChildren(group("Weights, 0 to 1", store.motion.names), ...(store.markers ? [group(`Markers, ±${LARGEST_MM} mm`, store.markers.curves)] : []));
}

function laneAt(y) {
  return Object.keys(layout).find((name) => y >= layout[name].top && y < layout[name].top + layout[name].height) ?? "curve";
}

/** The boundary within reach of a place, or -1; the last end is that of the sound and stays. */
function boundaryAt(rows, place) {
  const k = indexAt(rows, at(place));
  const reach = Math.min(6, (x(rows[k][1]) - x(k > 0 ? rows[k - 1][1] : 0)) / 3); // of a narrow phone most is left to be clicked
  const near = [k - 1, k].filter((n) => n >= 0 && n < rows.length - 1 && Math.abs(x(rows[n][1]) - place) < reach);
  return near.sort((a, b) => Math.abs(x(rows[a][1]) - place) - Math.abs(x(rows[b][1]) - place))[0] ?? -1;
}

function down(event) {
  const take = currentTake();
  if (!take || event.button !== 0) return;
  canvas.setPointerCapture(event.pointerId);
  canvas.focus();
  const place = event.offsetX;
  const lane = laneAt(event.offsetY);
  if (lane === "phones" || lane === "nodes") {
    const boundary = lane === "phones" ? boundaryAt(take.phones, place) : -1;
    if (boundary >= 0) drag = { kind: "boundary", boundary, take };
    else choosePhone(indexAt(take.phones, at(place)));
  } else if (lane === "emotions") {
    const boundary = boundaryAt(take.emotions, place);
    store.region = boundary >= 0 ? boundary : indexAt(take.emotions, at(place));
    drag = boundary >= 0 ? { kind: "emotion", boundary, take } : { kind: "intensity", region: store.region, take, y: event.offsetY };
    changed("selection");
  } else if (lane === "ruler" && event.shiftKey) {
    drag = { kind: "loop", from: snapped(at(place)), take };
  } else {
    drag = { kind: "scrub", take };
    sound.seek(at(place));
  }
}

function moved(event) {
  if (!drag) {
    const take = currentTake();
    const lane = laneAt(event.offsetY);
    const rows = lane === "phones" ? take?.phones : lane === "emotions" ? take?.emotions : null;
    canvas.style.cursor = rows && boundaryAt(rows, event.offsetX) >= 0 ? "ew-resize" : "default";
    return;
  }
  const time = snapped(Math.min(Math.max(at(event.offsetX), 0), duration()));
  if (drag.kind === "scrub") return sound.seek(time);
  if (drag.kind === "loop") {
    sound.loop.start = Math.min(drag.from, time);
    sound.loop.end = Math.max(drag.from, time);
    document.getElementById("loop").checked = sound.loop.on = sound.loop.end - sound.loop.start > 0.02;
    return draw();
  }
  const [name, facts] = dragged(event, time);
  if (!name) return undefined;
  drag.last = [name, facts];
  drag.take = preview(currentTake(), name, facts);
  trial(name, facts);
  return draw();
}

/** The change that the drag has come to. */
function dragged(event, time) {
  if (drag.kind === "boundary") return ["move_boundary", { phone: drag.boundary, end_s: within(currentTake().phones, drag.boundary, time, 0.0051) }];
  if (drag.kind === "emotion") return ["move_emotion", { region: drag.boundary, end_s: within(currentTake().emotions, drag.boundary, time, 0.021) }];
  if (Math.abs(event.offsetY - drag.y) < 4 && !drag.last) return [null];
  const { top, height } = layout.emotions;
  const intensity = Math.round(100 * Math.min(Math.max((top + height - event.offsetY) / (height - 4), 0), 1)) / 100;
  return ["set_emotion", { region: drag.region, emotion: currentTake().emotions[drag.region][0], intensity }];
}

function within(rows, k, time, least) {
  const low = (k > 0 ? rows[k - 1][1] : 0) + least;
  return Math.min(Math.max(time, low), rows[k + 1][1] - least);
}

function preview(take, name, facts) {
  const copy = { ...take, phones: take.phones.map((row) => [...row]), emotions: take.emotions.map((row) => [...row]) };
  if (name === "move_boundary") copy.phones[facts.phone][1] = facts.end_s;
  else if (name === "move_emotion") copy.emotions[facts.region][1] = facts.end_s;
  else copy.emotions[facts.region][2] = facts.intensity;
  return copy;
}

let trying = false;
let nextTrial = null;
/** Let the face follow a drag: the newest place alone is asked for. */
async function trial(name, facts) {
  nextTrial = [name, facts];
  if (trying) return;
  trying = true;
  while (nextTrial) {
    const [doing, said] = nextTrial;
    nextTrial = null;
    const answer = ask("trial", { line: store.line, take: store.take, do: doing, with: { line: store.line, take: store.take, ...said }, ...seen() });
    trialAsked(lastNumber());
    await answer.catch((error) => say(error.message, true));
  }
  trying = false;
}

async function up() {
  const done = drag;
  if (!done) return;
  nextTrial = null;
  if (done.last) await changeTake(done.last[0], done.last[1]);
  drag = null;
  if (done.kind === "loop") setLoop(sound.loop.on);
  if (done.kind === "scrub") chooseUnder();
  draw();
}

function choosePhone(number) {
  const take = currentTake();
  store.phone = Math.min(Math.max(number, 0), take.phones.length - 1);
  const start = startOf(take, store.phone);
  const end = take.phones[store.phone][1];
  if (!sound.playing()) sound.seek((start + end) / 2);
  follow((start + end) / 2);
  store.region = indexAt(take.emotions, (start + end) / 2);
  changed("selection");
}

/** Choose the phone under the playhead, which stays where it is. */
function chooseUnder() {
  const take = currentTake();
  const phone = indexAt(take.phones, sound.time());
  if (phone === store.phone) return;
  store.phone = phone;
  store.region = indexAt(take.emotions, sound.time());
  changed("selection");
}

function step(time) {
  sound.seek(time);
  chooseUnder();
}

function wheel(event) {
  event.preventDefault();
  if (event.ctrlKey || event.metaKey) zoom(Math.exp(event.deltaY * 0.002), at(event.offsetX));
  else scroll(((event.deltaY + event.deltaX) / view.width) * (view.end - view.start));
  draw();
}

function key(event) {
  const take = currentTake();
  if (!take || event.ctrlKey || event.metaKey) return;
  const shift = event.altKey ? (event.shiftKey ? 0.02 : 0.005) : 0;
  const actions = {
    ArrowLeft: () => (shift ? nudge(-shift) : choosePhone(store.phone - 1)),
    ArrowRight: () => (shift ? nudge(shift) : choosePhone(store.phone + 1)),
    Enter: () => document.getElementById("phone-label")?.focus(),
    s: () => changeTake("split_phone", { phone: store.phone, at_s: sound.time(), label: take.phones[store.phone][0] }, "split"),
    j: () => changeTake("join_phones", { phone: store.phone }, "joined"),
    Home: () => step(0),
    End: () => step(duration()),
    "+": () => zoom(0.6, sound.time()),
    "=": () => zoom(0.6, sound.time()),
    "-": () => zoom(1 / 0.6, sound.time()),
    "[": () => step(sound.time() - 1 / (store.motion?.fps ?? 30)),
    "]": () => step(sound.time() + 1 / (store.motion?.fps ?? 30)),
  };
  if (!actions[event.key]) return;
  event.preventDefault();
  actions[event.key]();
  draw();
}

function nudge(seconds) {
  const take = currentTake();
  if (store.phone >= take.phones.length - 1) return say("the last phone ends with the sound");
  const end_s = within(take.phones, store.phone, take.phones[store.phone][1] + seconds, 0.0051);
  return changeTake("move_boundary", { phone: store.phone, end_s });
}

/** Where a moment is on a lane, px on the page: for tests and benchmarks. */
export function placeOf(time, lane) {
  const box = canvas.getBoundingClientRect();
  return [box.left + x(time), box.top + layout[lane].top + layout[lane].height / 2];
}

/** Number of the phone at a place of the page; null outside of the timeline. */
export function phoneUnder(pageX, pageY) {
  const box = canvas.getBoundingClientRect();
  const inside = pageX >= box.left && pageX <= box.right && pageY >= box.top && pageY <= box.bottom;
  return inside && currentTake() ? indexAt(currentTake().phones, at(pageX - box.left)) : null;
}

export { choosePhone };
