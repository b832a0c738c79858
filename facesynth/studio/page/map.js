// The map of a phone: its recorded frames as light, its nodes as curves with a direction.

import { ask, on, lastNumber } from "/page/link.js";
import { store, watch, changed, currentTake, change, changeTake, startOf, motionOf, seen, say } from "/page/store.js";
import * as sound from "/page/sound.js";
import { make, labelled, choice, refill, draft } from "/page/dom.js";
import { phoneUnder } from "/page/timeline.js";
import { path, bitmapOf, paintMarks } from "/page/map_paint.js";
import * as recording from "/page/recording.js";

const canvas = document.getElementById("map-canvas");
const context = canvas.getContext("2d");
const phoneList = document.getElementById("map-phone");
const kindList = document.getElementById("map-kind");
const emotionList = document.getElementById("map-emotion");
const note = document.getElementById("map-note");
let map = null; // nodes, points, starts
let picture = null; // a bitmap and the extent that it shows
let marks = null; // where nodes are at the playhead's relative time, and which stood between the same phones
let chosen = null; // a node
let drawing = null; // the path that is being drawn: null, or places
let drag = null;
let pressed = null;
let wantedPick = null;
let picking = false;
let wanted = false;
let asked = "";

export async function begin() {
  new ResizeObserver(() => load(true)).observe(canvas);
  phoneList.addEventListener("change", () => load(true));
  kindList.addEventListener("change", () => load(true));
  emotionList.addEventListener("change", () => load(true));
  watch("selection choice", follow);
  watch("choices", redraw);
  watch("project", () => load(false));
  watch("time", () => !sound.playing() && mark());
  canvas.addEventListener("pointermove", moved);
  canvas.addEventListener("pointerdown", down);
  canvas.addEventListener("pointerup", up);
  canvas.addEventListener("pointerleave", () => !drag && endPick());
  canvas.addEventListener("keydown", key);
  on("all", begun);
  on("map", heardMap);
  on("map_picture", heardPicture);
  on("map_highlights", heardMarks);
  on("face", heardFace);
}

function begun({ model }) {
  const there = Boolean(model?.mapped.length);
  for (const list of [phoneList, kindList, emotionList]) list.disabled = !there;
  note.textContent = there || !model ? "" : "This model has no nodes to look at.";
  phoneList.replaceChildren(...(model?.mapped ?? []).map((phone) => new Option(phone, phone)));
  emotionList.replaceChildren(new Option("all", ""), ...(model?.emotions ?? []).map((emotion) => new Option(emotion, emotion)));
  asked = "";
  if (there) load(true);
}

/** The map of the phone that is chosen on the timeline. */
function follow() {
  const label = currentTake()?.phones[store.phone]?.[0];
  if (label && [...phoneList.options].some((option) => option.value === label)) phoneList.value = label;
  load(false);
}

function load(again) {
  if (!store.model?.mapped.length || !phoneList.value || !canvas.clientWidth) return redraw();
  const facts = { phone: phoneList.value, map: kindList.value, emotion: emotionList.value, size: [canvas.clientWidth, Math.max(canvas.clientHeight, 16)] };
  const key = JSON.stringify([facts, store.project.removed, store.project.drawn]);
  if (key === asked && !again) return mark();
  if (key !== asked) ask("map", facts).then(mark).catch((error) => say(error.message, true));
  asked = key;
  fit();
  return undefined;
}

const mine = (message) => message.phone === phoneList.value && message.map === kindList.value;

function heardMap(message) {
  if (!mine(message)) return;
  if (map?.phone !== message.phone || map?.map !== message.map) chosen = drawing = null;
  if (chosen && !message.nodes.includes(chosen)) chosen = null;
  const starts = [];
  message.lengths.reduce((sum, length) => (starts.push(sum), sum + length), 0);
  map = { ...message, points: message.numbers, starts, place: new Map(message.nodes.map((node, k) => [node, k])) };
  marks = null;
  tools();
  redraw();
  found();
}

async function heardPicture(message) {
  if (!mine(message)) return;
  const { extent } = message;
  picture = { bitmap: await bitmapOf(message), extent };
  redraw();
}

/** Ask which nodes fit the phone under the playhead: at its time, between its neighbours. */
function mark() {
  const take = currentTake();
  if (!take || !map) return;
  const k = store.phone;
  const [label, end] = take.phones[k] ?? [];
  if (label !== map.phone) {
    marks = null;
    return redraw();
  }
  const start = startOf(take, k);
  const progress = Math.min(Math.max((sound.time() - start) / (end - start), 0), 1);
  const facts = { phone: map.phone, map: map.map, progress, before: take.phones[k - 1]?.[0] ?? "pau", after: take.phones[k + 1]?.[0] ?? "pau" };
  ask("highlight", facts).catch((error) => say(error.message, true));
}

function heardMarks(message) {
  if (!mine(message) || !map) return;
  marks = { context: message.context, places: message.numbers };
  list();
  redraw();
}

function fit() {
  const scale = Math.min(devicePixelRatio, 2);
  canvas.width = Math.round(canvas.clientWidth * scale);
  canvas.height = Math.round(canvas.clientHeight * scale);
  context.setTransform(scale, 0, 0, scale, 0, 0);
  redraw();
}

function redraw() {
  if (wanted) return;
  wanted = true;
  requestAnimationFrame(() => {
    wanted = false;
    paint();
  });
}

const toPage = (x, y) => {
  const [left, right, bottom, top] = picture.extent;
  return [((x - left) / (right - left)) * canvas.clientWidth, ((top - y) / (top - bottom)) * canvas.clientHeight];
};
const toMap = (x, y) => {
  const [left, right, bottom, top] = picture.extent;
  return [left + (x / canvas.clientWidth) * (right - left), top - (y / canvas.clientHeight) * (top - bottom)];
};

function paint() {
  const c = context;
  c.fillStyle = "#181818";
  c.fillRect(0, 0, canvas.clientWidth, canvas.clientHeight);
  if (!map || !picture) return;
  c.drawImage(picture.bitmap, 0, 0, canvas.clientWidth, canvas.clientHeight);
  if (marks) paintMarks(c, map.nodes.map((node, k) => (map.shown[k] && !gone(node) ? toPage(marks.places[2 * k], marks.places[2 * k + 1]) : null)), marks.context);
  const used = store.choices[store.phone]?.node;
  const pin = new Map(currentTake()?.pins ?? []).get(store.phone);
  for (const node of new Set([used, pin])) if (map.place.has(node)) curve(c, node, node === pin ? "#7fc4ff" : "#7bd88f", 2.5);
  if (chosen && map.place.has(chosen)) curve(c, chosen, "#ffffff", 2);
  if (drawing?.length) path(c, drawing.map(([x, y]) => toPage(x, y)), "#ffd166", 2.5);
}

const gone = (node) => store.project.removed.includes(node);

function pointsOf(node) {
  const k = map.place.get(node);
  return Array.from({ length: map.lengths[k] }, (_, i) => toPage(map.points[2 * (map.starts[k] + i)], map.points[2 * (map.starts[k] + i) + 1]));
}

function curve(c, node, colour, width) {
  path(c, pointsOf(node), colour, width);
}

function moved(event) {
  if (!map || !picture) return;
  if (drawing && pressed) {
    drawing.push(toMap(event.offsetX, event.offsetY));
    return redraw();
  }
  if (pressed && Math.hypot(event.offsetX - pressed.x, event.offsetY - pressed.y) > 5) drag = chosen;
  if (drag) {
    canvas.style.cursor = "grabbing";
    return;
  }
  wantedPick = toMap(event.offsetX, event.offsetY);
  pick();
}

export const picks = { asked: new Map(), took: [] }; // for the benchmark

/** The face at the pointer: the newest place alone is asked for. */
async function pick() {
  if (picking) return;
  picking = true;
  while (wantedPick) {
    const place = wantedPick;
    wantedPick = null;
    const answer = ask("pick", { phone: map.phone, map: map.map, place });
    picks.asked.set(lastNumber(), performance.now());
    try {
      const { node, inside } = await answer;
      note.textContent = `${node}${inside ? "" : " (the nearest: nothing was recorded there)"}${gone(node) ? ", removed" : ""}`;
      store.hovered = node;
    } catch (error) {
      say(error.message, true);
    }
  }
  picking = false;
}

function endPick() {
  wantedPick = null;
  store.hovered = null;
  if (store.picked) {
    store.picked = null;
    changed("motion");
  }
}

function heardFace(message) {
  if (message.picked !== undefined) {
    const began = picks.asked.get(message.picked);
    picks.asked.delete(message.picked);
    if (!picking && !store.hovered) return;
    store.picked = motionOf(message);
    requestAnimationFrame(() => picks.took.push(performance.now() - began));
    changed("motion");
  } else if (message.node !== undefined) playOnFace(motionOf(message));
}

/** Play a short motion on the face, slowed down to a third: a phone is over in a tenth of a second. */
function playOnFace(motion) {
  const began = performance.now();
  const tick = () => {
    const at = Math.floor(((performance.now() - began) / 3000) * motion.fps);
    if (at >= motion.count) {
      store.picked = null;
      return changed("motion");
    }
    store.picked = { ...motion, count: 1, rows: motion.rows.subarray(at * motion.columns, (at + 1) * motion.columns) };
    changed("motion");
    return requestAnimationFrame(tick);
  };
  tick();
}

function down(event) {
  if (!map || !picture || event.button !== 0) return;
  canvas.setPointerCapture(event.pointerId);
  canvas.focus();
  pressed = { x: event.offsetX, y: event.offsetY };
  if (drawing) drawing = [toMap(event.offsetX, event.offsetY)];
  else choose(nearest(event.offsetX, event.offsetY), false);
}

function up(event) {
  if (!pressed) return;
  pressed = null;
  canvas.style.cursor = "";
  if (drawing) return drawn();
  if (drag) {
    const phone = phoneUnder(event.clientX, event.clientY);
    drag = null;
    if (phone !== null && chosen) use(chosen, phone);
    return;
  }
  if (chosen) play(chosen);
}

function nearest(x, y) {
  let best = null;
  let least = 18;
  for (let k = 0; k < map.nodes.length; k++) {
    if (!map.shown[k]) continue;
    for (let i = map.starts[k]; i < map.starts[k] + map.lengths[k]; i++) {
      const [a, b] = toPage(map.points[2 * i], map.points[2 * i + 1]);
      const far = Math.hypot(a - x, b - y);
      if (far < least) [least, best] = [far, map.nodes[k]];
    }
  }
  return best;
}

export function choose(node, playIt = true) {
  chosen = node;
  tools();
  list();
  redraw();
  if (node && playIt) play(node);
}

let looked = null;

/** Show a node on the map of its phone, and play it. */
export function lookAt(phone, node) {
  phoneList.value = phone;
  looked = node;
  if (map?.phone === phone) return found();
  return load(false);
}

function found() {
  if (!looked || !map.place.has(looked)) return;
  choose(looked);
  looked = null;
}

const play = (node) => ask("play_node", { phone: map.phone, map: map.map, node }).catch((error) => say(error.message, true));

function use(node, phone = store.phone) {
  const label = currentTake()?.phones[phone]?.[0];
  if (label !== map.phone) say(`note: phone ${phone} is ${label}, and this is a node of ${map.phone}`);
  return changeTake("pin", { phone, node }, `${node} is used at phone ${phone}`);
}

async function toRecording(node) {
  try {
    const { utterance, start_s, end_s } = await ask("where", { node });
    await recording.open(utterance);
    recording.playFrom(Math.max(0, start_s - 0.15), end_s + 0.15);
  } catch (error) {
    say(error.message, true);
  }
}

function tools() {
  const bar = document.getElementById("map-tools");
  if (!map) return bar.replaceChildren();
  const button = (id, text, action, off = false) => make("button", { id, textContent: text, onclick: action, disabled: off });
  if (drawing) return refill(bar, ...drawTools(button));
  const parts = [];
  if (chosen) {
    parts.push(make("code", { textContent: chosen }), button("map-play", "Play", () => play(chosen)));
    if (store.model.pins) parts.push(button("map-use", `Use at phone ${store.phone}`, () => use(chosen)));
    parts.push(button("map-where", "Recording", () => toRecording(chosen)));
    if (store.model.edits) parts.push(gone(chosen) ? button("map-restore", "Restore", () => change("restore_node", { node: chosen })) : button("map-remove", "Remove", () => change("remove_node", { node: chosen }, `${chosen} is not used any more`)));
  }
  if (store.model.edits) parts.push(button("map-draw", "Draw a node", () => startDrawing()));
  return refill(bar, ...parts);
}

function startDrawing() {
  drawing = [];
  chosen = null;
  note.textContent = "Drag a path over the map, or press Enter to take the path of the node that is used.";
  tools();
  redraw();
}

function drawTools(button) {
  const [name, lasts, felt] = [`my ${map.phone}`, phoneLength().toFixed(2), currentTake()?.emotions[store.region]?.[0] ?? store.model.emotions[0]];
  const title = make("input", { id: "draw-title", ...draft(name), value: name, size: 8 });
  const length = make("input", { id: "draw-length", ...draft(lasts), type: "number", min: 0.02, max: 2, step: 0.01, value: lasts });
  const emotion = choice(store.model.emotions, felt, { id: "draw-emotion", ...draft(felt) });
  const facts = () => ({ title: title.value, emotion: emotion.value, duration_s: Number(length.value) });
  const none = drawing.length < 2;
  return [labelled("Name", title), labelled("length, s", length), labelled("felt", emotion),
    button("draw-see", "See it", () => drawn(facts()), none),
    button("draw-keep", "Keep it", () => keep(facts()), none),
    button("draw-used", "Path of the used node", () => usedPath()),
    button("draw-stop", "Stop drawing", () => { drawing = null; note.textContent = ""; tools(); redraw(); })];
}

const phoneLength = () => {
  const take = currentTake();
  return take ? Math.max(0.03, take.phones[store.phone][1] - startOf(take, store.phone)) : 0.1;
};

/** For the keyboard: begin with what the search chose. */
function usedPath() {
  const node = store.choices[store.phone]?.node;
  const k = map.place.get(map.place.has(node) ? node : map.nodes[0]);
  drawing = Array.from({ length: map.lengths[k] }, (_, i) => [map.points[2 * (map.starts[k] + i)], map.points[2 * (map.starts[k] + i) + 1]]);
  if (drawing.length < 2) drawing.push(drawing[0]);
  drawn();
}

async function drawn(facts = { duration_s: phoneLength() }) {
  tools();
  redraw();
  if (drawing.length < 2) return;
  try {
    const { outside, frames } = await ask("draw", { phone: map.phone, map: map.map, path: drawing, duration_s: facts.duration_s });
    note.textContent = `${frames} frames${outside ? `, ${outside} of them where nothing was recorded: the nearest were taken` : ""}`;
  } catch (error) {
    say(error.message, true);
  }
}

async function keep(facts) {
  try {
    await ask("draw", { phone: map.phone, map: map.map, path: drawing, ...facts, keep: true, base: store.project.revision, ...seen() });
    say(`${facts.title} is a node of this project`);
    drawing = null;
    note.textContent = "";
    tools();
    redraw();
  } catch (error) {
    say(error.message, true);
  }
}

const LISTED = 80;

/** The nodes in words, those that stood between the same phones first. */
function list() {
  const area = document.getElementById("map-nodes");
  if (!map) return area.replaceChildren();
  const order = map.nodes.map((_, k) => k).filter((k) => map.shown[k]);
  order.sort((a, b) => Number(marks?.context[b] ?? 0) - Number(marks?.context[a] ?? 0));
  const rows = order.slice(0, LISTED).map((k) => {
    const node = map.nodes[k];
    const words = `${map.emotions[k]}, ${map.contexts[k].join(" _ ")}${marks?.context[k] ? ", same neighbours" : ""}${gone(node) ? ", removed" : ""}`;
    return make("div", {}, make("button", { id: `node-${node}`, textContent: node, "aria-pressed": String(node === chosen), onclick: () => choose(node) }), ` ${words}`);
  });
  return refill(area, ...rows);
}

function key(event) {
  if (!map) return;
  const shown = map.nodes.filter((_, k) => map.shown[k]);
  const at = shown.indexOf(chosen);
  if (event.key === "ArrowRight" || event.key === "ArrowDown") choose(shown[(at + 1) % shown.length]);
  else if (event.key === "ArrowLeft" || event.key === "ArrowUp") choose(shown[(at - 1 + shown.length) % shown.length]);
  else if (event.key === "Enter" && drawing) usedPath();
  else if (event.key === "Enter" && chosen && store.model.pins) use(chosen);
  else if (event.key === "Delete" && chosen && store.model.edits) change("remove_node", { node: chosen });
  else if (event.key === "d" && store.model.edits) startDrawing();
  else return;
  event.preventDefault();
}

/** Where a node of the map lies on the page, px: for tests. */
export function placeOf(node, share = 0.5) {
  const places = pointsOf(node);
  const box = canvas.getBoundingClientRect();
  const [x, y] = places[Math.round(share * (places.length - 1))];
  return [box.left + x, box.top + y];
}
export const state = () => ({ map, marks, chosen, drawing });
