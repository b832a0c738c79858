// What the windows know together: the project, what is chosen, and the motions that are shown.

import { ask } from "/page/link.js";

export const store = {
  project: { revision: 0, order: [], removed: [], drawn: [], can_undo: false, can_redo: false },
  lines: new Map(),
  corpus: null,
  model: null,
  outputs: [],
  reports: [],
  jobs: new Map(),
  line: null,
  take: null,
  phone: 0,
  region: 0,
  choices: [],
  motion: null, // what the model makes of the take now
  before: null, // what it made before the last change
  compared: null, // another take
  recording: null, // the motion recorded with an utterance
  markers: null, // of the head's skin
};

const listeners = new Map();

/** Call `listener` when one of these changes: project, choice (line or take), selection, motion, choices, recording, jobs, corpus, time, map (what is chosen or drawn on it). */
export function watch(kinds, listener) {
  for (const kind of kinds.split(" ")) listeners.set(kind, [...(listeners.get(kind) ?? []), listener]);
}

export function changed(kind) {
  for (const listener of listeners.get(kind) ?? []) listener();
}

export const currentLine = () => store.lines.get(store.line) ?? null;
export const currentTake = () => currentLine()?.takes.find((take) => take.name === store.take) ?? null;
export const startOf = (take, phone) => (phone > 0 ? take.phones[phone - 1][1] : 0);
/** A phone that was heard with less confidence should be listened to: that marks half of the wrong ones and a fifth of the right ones. */
const DOUBTED = 0.9;
export const isDoubted = ([, , confidence = 1]) => confidence < DOUBTED;
export const regionStart = (take, region) => (region > 0 ? take.emotions[region - 1][1] : 0);
export const duration = () => currentTake()?.duration_s ?? 0;

/** Number of the interval of [label, end, …] rows that a time lies in. */
export function indexAt(rows, time) {
  let low = 0;
  let high = rows.length - 1;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (rows[middle][1] > time) high = middle;
    else low = middle + 1;
  }
  return Math.max(0, low);
}

let report = () => {};
export function reportTo(target) {
  report = target;
}

/** Say something to the person; an error stays until the next one. */
export const say = (text, bad = false) => report(text, bad);

/** Make a change of the project; what is wrong with it is said, and null given. */
export async function change(name, facts, said = "") {
  try {
    const answer = await ask("change", { do: name, with: facts, base: store.project.revision, ...seen() });
    if (said) say(said);
    return answer;
  } catch (error) {
    say(error.message, true);
    return null;
  }
}

/** The same of the take that is shown. */
export const changeTake = (name, facts, said = "") => change(name, { line: store.line, take: store.take, ...facts }, said);

/** Take in the state of the project: all of it, or the lines that changed. */
export function takeIn(project) {
  const { lines, ...rest } = project;
  store.project = rest;
  for (const line of lines) store.lines.set(line.name, line);
  for (const name of [...store.lines.keys()]) if (!rest.order.includes(name)) store.lines.delete(name);
  choose(store.line, store.take);
  changed("project");
}

/** Show a line and a take; where they are gone, the first there is. */
export function choose(line, take) {
  const before = [store.line, store.take].join("\n");
  store.line = store.lines.has(line) ? line : (store.project.order[0] ?? null);
  const takes = currentLine()?.takes ?? [];
  store.take = takes.some((other) => other.name === take) ? take : (takes.at(-1)?.name ?? null);
  const shown = currentTake();
  store.phone = shown ? Math.min(store.phone, shown.phones.length - 1) : 0;
  store.region = shown ? Math.min(store.region, shown.emotions.length - 1) : 0;
  if ([store.line, store.take].join("\n") === before) return;
  store.motion = store.before = store.compared = null;
  store.choices = [];
  store.phone = store.region = 0;
  changed("choice");
  show();
}

/** Ask for the face of what is chosen. */
export function show() {
  if (store.line && store.model) ask("show", { line: store.line, take: store.take, ...sight() }).catch((error) => say(error.message, true));
}

let sight = () => ({});
/** Who says which stretch is looked at: { at, from, to } in seconds. */
export function sightFrom(teller) {
  sight = teller;
}
export const seen = () => sight();

/** A motion from a message; a stretch of one is laid into what is known of it. */
export function motionOf(message, known) {
  const { names, columns, count, fps, start, numbers } = message;
  if (start === 0 && numbers.length === count * columns) return { names, columns, count, fps, rows: numbers };
  const fits = known && known.columns === columns && known.count === count;
  const rows = fits ? known.rows : new Float32Array(count * columns);
  rows.set(numbers, start * columns);
  return { names, columns, count, fps, rows };
}

/** What `read(rows, start)` makes of the row that begins at `start`, at a time between a motion's frames. */
export function valueAt({ rows, columns, count, fps }, time, read) {
  const place = Math.min(Math.max(time * fps, 0), count - 1);
  const first = Math.floor(place);
  const value = read(rows, first * columns);
  return value + (place - first) * (read(rows, Math.min(first + 1, count - 1) * columns) - value);
}

/** The row of a motion at a time, between its frames. */
export function rowAt(motion, time) {
  const place = Math.min(Math.max(time * motion.fps, 0), motion.count - 1);
  const first = Math.floor(place);
  const share = place - first;
  const a = motion.rows.subarray(first * motion.columns, (first + 1) * motion.columns);
  if (share < 1e-6 || first + 1 >= motion.count) return a;
  const b = motion.rows.subarray((first + 1) * motion.columns, (first + 2) * motion.columns);
  return a.map((value, k) => value + share * (b[k] - value));
}
