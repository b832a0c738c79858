// Which stretch of time the timeline shows, and what a pointer snaps to.

import { store, currentTake, duration } from "/page/store.js";

export const view = { start: 0, end: 1, width: 1, snap: "0" };
const SHORTEST_S = 0.15;

export const x = (time) => ((time - view.start) / (view.end - view.start)) * view.width;
export const at = (place) => view.start + (place / view.width) * (view.end - view.start);

export function all() {
  view.start = 0;
  view.end = Math.max(duration(), SHORTEST_S);
}

const FIRST_S = 4.5; // of a long line so much is shown at first: its phones can be read and clicked

export function beginning() {
  all();
  view.end = Math.min(view.end, FIRST_S);
}

/** Come nearer (factor below 1) or go further, about a time. */
export function zoom(factor, about) {
  const length = Math.min(Math.max((view.end - view.start) * factor, SHORTEST_S), Math.max(duration(), SHORTEST_S));
  const share = (about - view.start) / (view.end - view.start);
  scrollTo(about - share * length, length);
}

export function scroll(seconds) {
  scrollTo(view.start + seconds, view.end - view.start);
}

/** Keep a time in sight. */
export function follow(time) {
  const length = view.end - view.start;
  if (time < view.start || time > view.end) scrollTo(time - 0.1 * length, length);
}

function scrollTo(start, length) {
  view.start = Math.max(0, Math.min(start, duration() - length));
  view.end = view.start + length;
}

/** The nearest moment of what is snapped to, if one is near; the time itself else. */
export function snapped(time) {
  const near = at(8) - at(0);
  if (view.snap === "frame") {
    const fps = store.motion?.fps ?? 30;
    return Math.round(time * fps) / fps;
  }
  if (view.snap === "word") {
    const words = currentTake()?.words ?? [];
    const ends = words.flatMap(([, start, end]) => [start, end]);
    const best = ends.reduce((a, b) => (Math.abs(b - time) < Math.abs(a - time) ? b : a), Infinity);
    return Math.abs(best - time) < near ? best : time;
  }
  return time;
}
