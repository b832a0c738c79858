// The map of a phone: its recorded frames as light, its nodes as curves with a direction.

import { ask, on, lastNumber } from "/page/link.js";
import { store, watch, changed, currentTake, startOf, motionOf, say } from "/page/store.js";
import * as sound from "/page/sound.js";
import { phoneUnder } from "/page/timeline.js";
import { path, bitmapOf, paintMarks } from "/page/map_paint.js";
import { shown, canvas, note, isRemoved, usedNode, toPage, toMap, pointsOf, nearest } from "/page/map_state.js";
import { choose, use, play, tools, list, key } from "/page/map_nodes.js";
import * as drawing from "/page/map_drawing.js";

const context = canvas.getContext("2d");
const phoneList = document.getElementById("map-phone");
const kindList = document.getElementById("map-kind");
const emotionList = document.getElementById("map-emotion");
const utteranceList = document.getElementById("map-utterance");
const lists = [phoneList, kindList, emotionList, utteranceList];
let drag = null;
let pressed = null;
let wantedPick = null;
let picking = false;
let wanted = false;
let asked = "";

export async function begin() {
  new ResizeObserver(() => load(true)).observe(canvas);
  for (const element of lists) element.addEventListener("change", () => load(true));
  watch("selection choice", follow);
  watch("choices", redraw);
  watch("project", () => load(false));
  watch("time", () => !sound.playing() && mark());
  watch("map", () => {
    tools();
    list();
    redraw();
  });
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
  for (const element of lists) element.disabled = !there;
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
  const facts = { phone: phoneList.value, map: kindList.value, emotion: emotionList.value, utterance: utteranceList.value, size: [canvas.clientWidth, Math.max(canvas.clientHeight, 16)] };
  const now = JSON.stringify([facts, store.project.removed, store.project.drawn]);
  if (now === asked && !again) return mark();
  if (now !== asked) ask("map", facts).then(mark).catch((error) => say(error.message, true));
  asked = now;
  fit();
  return undefined;
}

const mine = (message) => message.phone === phoneList.value && message.map === kindList.value;

function heardMap(message) {
  if (!mine(message)) return;
  if (shown.map?.phone !== message.phone || shown.map?.map !== message.map) shown.chosen = shown.drawing = null;
  if (shown.chosen && !message.nodes.includes(shown.chosen)) shown.chosen = null;
  const starts = [];
  message.lengths.reduce((sum, length) => (starts.push(sum), sum + length), 0);
  shown.map = { ...message, points: message.numbers, starts, place: new Map(message.nodes.map((node, k) => [node, k])) };
  shown.marks = null;
  listUtterances(message.nodes);
  tools();
  list();
  redraw();
  found();
}

/** Those that the map's nodes come from; the one that is chosen stays. */
function listUtterances(nodes) {
  const chosen = utteranceList.value;
  const names = [...new Set([...(chosen ? [chosen] : []), ...nodes.map((node) => node.slice(0, node.lastIndexOf(":")))])].sort();
  utteranceList.replaceChildren(new Option("all", ""), ...names.map((name) => new Option(name === "+" ? "drawn" : name, name)));
  utteranceList.value = chosen;
}

async function heardPicture(message) {
  if (!mine(message)) return;
  shown.picture = { bitmap: await bitmapOf(message), extent: message.extent };
  redraw();
}

/** Ask which nodes fit the phone under the playhead: at its time, between its neighbours. */
function mark() {
  const take = currentTake();
  const { map } = shown;
  if (!take || !map) return;
  const k = store.phone;
  const [label, end] = take.phones[k] ?? [];
  if (label !== map.phone) {
    shown.marks = null;
    list();
    return redraw();
  }
  const start = startOf(take, k);
  const progress = Math.min(Math.max((sound.time() - start) / (end - start), 0), 1);
  const facts = { phone: map.phone, map: map.map, progress, before: take.phones[k - 1]?.[0] ?? "pau", after: take.phones[k + 1]?.[0] ?? "pau" };
  ask("highlight", facts).catch((error) => say(error.message, true));
}

function heardMarks(message) {
  if (!mine(message) || !shown.map) return;
  shown.marks = { context: message.context, places: message.numbers };
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

function paint() {
  const c = context;
  const { map, picture, marks, chosen } = shown;
  c.fillStyle = "#181818";
  c.fillRect(0, 0, canvas.clientWidth, canvas.clientHeight);
  if (!map || !picture) return;
  c.drawImage(picture.bitmap, 0, 0, canvas.clientWidth, canvas.clientHeight);
  if (marks) paintMarks(c, map.nodes.map((node, k) => (map.shown[k] && !isRemoved(node) ? toPage(marks.places[2 * k], marks.places[2 * k + 1]) : null)), marks.context);
  const pin = new Map(currentTake()?.pins ?? []).get(store.phone);
  for (const node of new Set([usedNode(), pin])) if (map.place.has(node)) path(c, pointsOf(node), node === pin ? "#7fc4ff" : "#7bd88f", 2.5);
  if (chosen && map.place.has(chosen)) path(c, pointsOf(chosen), "#ffffff", 2);
  if (shown.drawing?.length) path(c, shown.drawing.map(([x, y]) => toPage(x, y)), "#ffd166", 2.5);
}

function moved(event) {
  if (!shown.map || !shown.picture) return;
  if (shown.drawing && pressed) {
    shown.drawing.push(toMap(event.offsetX, event.offsetY));
    return redraw();
  }
  if (pressed && Math.hypot(event.offsetX - pressed.x, event.offsetY - pressed.y) > 5) drag = shown.chosen;
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
    const answer = ask("pick", { phone: shown.map.phone, map: shown.map.map, place });
    picks.asked.set(lastNumber(), performance.now());
    try {
      const { node, inside } = await answer;
      note.textContent = `${node}${inside ? "" : " (the nearest: nothing was recorded there)"}${isRemoved(node) ? ", removed" : ""}`;
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
  if (!shown.map || !shown.picture || event.button !== 0) return;
  canvas.setPointerCapture(event.pointerId);
  canvas.focus();
  pressed = { x: event.offsetX, y: event.offsetY };
  if (shown.drawing) shown.drawing = [toMap(event.offsetX, event.offsetY)];
  else choose(nearest(event.offsetX, event.offsetY), false);
}

function up(event) {
  if (!pressed) return;
  pressed = null;
  canvas.style.cursor = "";
  if (shown.drawing) return drawing.see();
  if (drag) {
    const phone = phoneUnder(event.clientX, event.clientY);
    drag = null;
    if (phone !== null && shown.chosen) use(shown.chosen, phone);
    return;
  }
  if (shown.chosen) play(shown.chosen);
}

let looked = null;

/** Show a node on the map of its phone, and play it. */
export function lookAt(phone, node) {
  phoneList.value = phone;
  looked = node;
  if (shown.map?.phone === phone) return found();
  return load(false);
}

function found() {
  if (!looked || !shown.map.place.has(looked)) return;
  choose(looked);
  looked = null;
}

/** Where a node of the map lies on the page, px: for tests. */
export function placeOf(node, share = 0.5) {
  const places = pointsOf(node);
  const box = canvas.getBoundingClientRect();
  const [x, y] = places[Math.round(share * (places.length - 1))];
  return [box.left + x, box.top + y];
}
export const state = () => shown;
