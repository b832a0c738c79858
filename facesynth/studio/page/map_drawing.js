// Drawing a new node: a path over the map becomes a motion, which is seen on the face, named and kept.

import { ask } from "/page/link.js";
import { store, changed, currentTake, seen, say } from "/page/store.js";
import { make, labelled, choice, draft } from "/page/dom.js";
import { shown, note, phoneLength, placesOf, usedNode } from "/page/map_state.js";

export function start() {
  shown.drawing = [];
  shown.chosen = null;
  note.textContent = "Drag a path over the map, or press Enter to take the path of the node that is used.";
  changed("map");
}

function stop() {
  shown.drawing = null;
  note.textContent = "";
  changed("map");
}

/** What stands below the map while a path is drawn. */
export function fields(button) {
  const [name, lasts, felt] = [`my ${shown.map.phone}`, phoneLength().toFixed(2), currentTake()?.emotions[store.region]?.[0] ?? store.model.emotions[0]];
  const title = make("input", { id: "draw-title", ...draft(name), value: name, size: 8 });
  const length = make("input", { id: "draw-length", ...draft(lasts), type: "number", min: 0.02, max: 2, step: 0.01, value: lasts });
  const emotion = choice(store.model.emotions, felt, { id: "draw-emotion", ...draft(felt) });
  const facts = () => ({ title: title.value, emotion: emotion.value, duration_s: Number(length.value) });
  const none = shown.drawing.length < 2;
  return [labelled("Name", title), labelled("length, s", length), labelled("felt", emotion),
    button("draw-see", "See it", () => see(facts()), none),
    button("draw-keep", "Keep it", () => keep(facts()), none),
    button("draw-used", "Path of the used node", alongUsed),
    button("draw-stop", "Stop drawing", stop)];
}

/** For the keyboard: begin with what the search chose. */
export function alongUsed() {
  const node = usedNode();
  shown.drawing = placesOf(shown.map.place.has(node) ? node : shown.map.nodes[0]);
  if (shown.drawing.length < 2) shown.drawing.push(shown.drawing[0]);
  see();
}

/** Show the motion of the path on the face. */
export async function see(facts = { duration_s: phoneLength() }) {
  changed("map");
  if (shown.drawing.length < 2) return;
  try {
    const { outside, frames } = await ask("draw", { ...asked(), duration_s: facts.duration_s });
    note.textContent = `${frames} frames${outside ? `, ${outside} of them where nothing was recorded: the nearest were taken` : ""}`;
  } catch (error) {
    say(error.message, true);
  }
}

async function keep(facts) {
  try {
    await ask("draw", { ...asked(), ...facts, keep: true, base: store.project.revision, ...seen() });
    say(`${facts.title} is a node of this project`);
    stop();
  } catch (error) {
    say(error.message, true);
  }
}

const asked = () => ({ phone: shown.map.phone, map: shown.map.map, path: shown.drawing });
