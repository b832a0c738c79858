// How long things take, for `benchmarks/studio.py`; it does nothing by itself.

import { ask } from "/page/link.js";
import { changeTake } from "/page/store.js";

export const measured = { ready: false, trials: [], timed: null };
const trials = new Map();
let awaited = null;

/** A change that is being dragged was asked for. */
export const trialAsked = (number) => trials.set(number, performance.now());

/** A stretch of a face came: the next picture shows it. */
export function faceCame(message) {
  const asked = trials.get(message.number);
  if (message.trial && asked) {
    trials.delete(message.number);
    requestAnimationFrame(() => measured.trials.push(performance.now() - asked));
  }
  if (!awaited || message.trial || message.revision < awaited.revision) return;
  const { begun } = awaited;
  if (message.last) awaited = null;
  requestAnimationFrame(() => {
    const took = performance.now() - begun;
    measured.timed ??= { first: took };
    if (message.last) measured.timed.whole = took;
  });
}

/** Make a change of the take, and measure until the face near the playhead, and the whole of it, are shown. */
export function timed(revision, name, facts) {
  measured.timed = null;
  awaited = { begun: performance.now(), revision: revision + 1 };
  changeTake(name, facts);
}

/** What could stand at a phone. */
export const next = async (line, take, phone) => (await ask("next_best", { line, take, phone })).rows;
