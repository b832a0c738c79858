// The nodes of a map in words, what can be done with the one that is chosen, and the keys of the map.

import { ask } from "/page/link.js";
import { store, changed, currentTake, change, changeTake, say } from "/page/store.js";
import { make, refill } from "/page/dom.js";
import { shown, isRemoved } from "/page/map_state.js";
import * as drawing from "/page/map_drawing.js";
import * as recording from "/page/recording.js";

export function choose(node, playIt = true) {
  shown.chosen = node;
  changed("map");
  if (node && playIt) play(node);
}

export const play = (node) => ask("play_node", { phone: shown.map.phone, map: shown.map.map, node }).catch((error) => say(error.message, true));

/** Let the search use a node at a phone. */
export function use(node, phone = store.phone) {
  const label = currentTake()?.phones[phone]?.[0];
  const strange = label === shown.map.phone ? "" : `; note: phone ${phone} is ${label}, and this is a node of ${shown.map.phone}`;
  return changeTake("pin", { phone, node }, `${node} is used at phone ${phone}${strange}`);
}

const remove = (node) => change("remove_node", { node }, `${node} is not used any more`);

async function toRecording(node) {
  try {
    const { utterance, start_s, end_s } = await ask("where", { node });
    await recording.open(utterance);
    recording.playFrom(Math.max(0, start_s - 0.15), end_s + 0.15);
  } catch (error) {
    say(error.message, true);
  }
}

/** The buttons below the map. */
export function tools() {
  const bar = document.getElementById("map-tools");
  if (!shown.map) return bar.replaceChildren();
  const button = (id, text, action, off = false) => make("button", { id, textContent: text, onclick: action, disabled: off });
  if (shown.drawing) return refill(bar, ...drawing.fields(button));
  const draw = store.model.edits ? [button("map-draw", "Draw a node", drawing.start)] : [];
  return refill(bar, ...(shown.chosen ? ofChosen(shown.chosen, button) : []), ...draw);
}

function ofChosen(node, button) {
  const parts = [make("code", { textContent: node }), button("map-play", "Play", () => play(node))];
  if (store.model.pins) parts.push(button("map-use", `Use at phone ${store.phone}`, () => use(node)));
  parts.push(button("map-where", "Recording", () => toRecording(node)));
  if (!store.model.edits) return parts;
  return [...parts, isRemoved(node) ? button("map-restore", "Restore", () => change("restore_node", { node })) : button("map-remove", "Remove", () => remove(node))];
}

const LISTED = 80;

/** The nodes in words, those that stood between the same phones first. */
export function list() {
  const area = document.getElementById("map-nodes");
  const { map, marks, chosen } = shown;
  if (!map) return area.replaceChildren();
  const order = map.nodes.map((_, k) => k).filter((k) => map.shown[k]);
  order.sort((a, b) => Number(marks?.context[b] ?? 0) - Number(marks?.context[a] ?? 0));
  const rows = order.slice(0, LISTED).map((k) => {
    const node = map.nodes[k];
    const words = `${map.emotions[k]}, ${map.contexts[k].join(" _ ")}${marks?.context[k] ? ", same neighbours" : ""}${isRemoved(node) ? ", removed" : ""}`;
    return make("div", {}, make("button", { id: `node-${node}`, textContent: node, "aria-pressed": String(node === chosen), onclick: () => choose(node) }), ` ${words}`);
  });
  const rest = order.length > LISTED ? [make("div", { textContent: `and ${order.length - LISTED} more on the map` })] : [];
  return refill(area, ...rows, ...rest);
}

export function key(event) {
  const { map, chosen } = shown;
  if (!map) return;
  const nodes = map.nodes.filter((_, k) => map.shown[k]);
  const at = nodes.indexOf(chosen);
  if (event.key === "ArrowRight" || event.key === "ArrowDown") choose(nodes[(at + 1) % nodes.length]);
  else if (event.key === "ArrowLeft" || event.key === "ArrowUp") choose(nodes[(at - 1 + nodes.length) % nodes.length]);
  else if (event.key === "Enter" && shown.drawing) drawing.alongUsed();
  else if (event.key === "Enter" && chosen && store.model.pins) use(chosen);
  else if (event.key === "Delete" && chosen && store.model.edits) remove(chosen);
  else if (event.key === "d" && store.model.edits) drawing.start();
  else return;
  event.preventDefault();
}
