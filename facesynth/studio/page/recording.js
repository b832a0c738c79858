// The recorded utterance: its motion on the head, in step with the line where it is the line's own.

import { ask, on } from "/page/link.js";
import { store, watch, changed, currentLine, motionOf, rowAt, say } from "/page/store.js";
import * as sound from "/page/sound.js";
import { openFace } from "/page/face.js";

const list = document.getElementById("recording-utterance");
const note = document.getElementById("recording-note");
let face = null;
let asked = null;
let other = null; // the clock of a recording that plays by itself

export async function begin() {
  face = await openFace(document.getElementById("recording-canvas"), note);
  list.addEventListener("change", () => open(list.value));
  document.getElementById("recording-play").addEventListener("click", () => playFrom(0, Infinity));
  watch("corpus", listUtterances);
  watch("choice", () => {
    const own = currentLine()?.utterance;
    if (own) open(own);
    mark();
  });
  watch("recording time", pose);
  on("face", (message) => {
    if (message.utterance === undefined || message.utterance !== asked) return;
    store.recording = { ...motionOf(message), utterance: message.utterance };
    mark();
    if (face) note.textContent = "";
    changed("recording");
  });
}

function listUtterances() {
  const rows = store.corpus?.utterances.filter((row) => row.usable) ?? [];
  list.replaceChildren(new Option("choose…", ""), ...rows.map((row) => new Option(row.id, row.id)));
  list.value = store.recording?.utterance ?? "";
}

/** Show an utterance's recording. */
export async function open(utterance) {
  if (!utterance || utterance === asked) return;
  asked = utterance;
  store.recording = null;
  list.value = utterance;
  note.textContent = "…";
  await ask("recording", { utterance }).catch((error) => {
    note.textContent = error.message;
  });
}

/** Whether the recording is that of the line which is shown. */
function mark() {
  if (store.recording) store.recording.own = store.recording.utterance === currentLine()?.utterance;
}

/** Play a stretch of the recording with its own sound. */
export async function playFrom(start, stop) {
  if (!asked || !store.recording) return say("choose an utterance first", true);
  const end = Math.min(stop, store.recording.count / store.recording.fps);
  other = await sound.playOther(`/recorded/${encodeURIComponent(asked)}`, start, end);
  return tick();
}

function tick() {
  const now = other?.time() ?? null;
  if (now === null) {
    other = null;
    return pose();
  }
  face?.pose(rowAt(store.recording, now), store.recording.names);
  return requestAnimationFrame(tick);
}

export const follow = pose;

function pose() {
  if (other || !face || !store.recording) return;
  face.pose(rowAt(store.recording, store.recording.own ? sound.time() : 0), store.recording.names);
}
