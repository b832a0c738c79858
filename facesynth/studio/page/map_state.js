// What the map shows, for all that draws it, lists it and changes it. Who changes something tells so by changed("map").

import { store, currentTake, startOf } from "/page/store.js";

export const canvas = document.getElementById("map-canvas");
export const note = document.getElementById("map-note");
export const shown = {
  map: null, // nodes, points, starts
  picture: null, // a bitmap and the extent that it shows
  marks: null, // where nodes are at the playhead's relative time, and which stood between the same phones
  chosen: null, // a node
  drawing: null, // the path that is being drawn: null, or places
};

export const isRemoved = (node) => store.project.removed.includes(node);

/** The node that the search uses at the phone that is chosen. */
export const usedNode = () => store.choices[store.phone]?.node;

export const phoneLength = () => {
  const take = currentTake();
  return take ? Math.max(0.03, take.phones[store.phone][1] - startOf(take, store.phone)) : 0.1;
};

export function toPage(x, y) {
  const [left, right, bottom, top] = shown.picture.extent;
  return [((x - left) / (right - left)) * canvas.clientWidth, ((top - y) / (top - bottom)) * canvas.clientHeight];
}

export function toMap(x, y) {
  const [left, right, bottom, top] = shown.picture.extent;
  return [left + (x / canvas.clientWidth) * (right - left), top - (y / canvas.clientHeight) * (top - bottom)];
}

/** The places of a node's frames on the map. */
export function placesOf(node) {
  const { map } = shown;
  const k = map.place.get(node);
  return Array.from({ length: map.lengths[k] }, (_, i) => [map.points[2 * (map.starts[k] + i)], map.points[2 * (map.starts[k] + i) + 1]]);
}

/** The same in pixels of the canvas. */
export const pointsOf = (node) => placesOf(node).map(([x, y]) => toPage(x, y));

/** The node within reach of a place of the canvas, or null. */
export function nearest(x, y) {
  const { map } = shown;
  let best = null;
  let least = 18;
  for (let k = 0; k < map.nodes.length; k++) {
    if (!map.shown[k]) continue;
    for (const [a, b] of pointsOf(map.nodes[k])) {
      const far = Math.hypot(a - x, b - y);
      if (far < least) [least, best] = [far, map.nodes[k]];
    }
  }
  return best;
}
