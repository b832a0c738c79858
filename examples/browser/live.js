// Microphone to phones to face, all in the page: sound leaves it to nowhere.
import * as ort from "./ort/ort.wasm.min.mjs";
import { Head } from "./head.js";
import { openFolder } from "./model.js";
import { Mouth } from "./mouth.js";
import { PhoneStream, RATE } from "./phones.js";

ort.env.wasm.wasmPaths = new URL("./ort/", import.meta.url).href;
const threads = globalThis.crossOriginIsolated ? Math.min(4, navigator.hardwareConcurrency || 1) : 1;
ort.env.wasm.numThreads = threads;

const MARGIN_S = 0.15; // for the network's own time and for phones that wait for the next one
const SHOWN = 24;
const said = document.getElementById("said"), line = document.getElementById("phones"), button = document.getElementById("listen");
const asked = new URLSearchParams(location.search);
const read = (folder) => async (name) => {
  const answer = await fetch(`${folder}/${name}`);
  if (!answer.ok) throw new Error(`${folder}/${name}: ${answer.status}`);
  return new Uint8Array(await answer.arrayBuffer());
};

async function main() {
  const hearing = await openFolder(read("hearing"), ort);
  const parts = JSON.parse(new TextDecoder().decode(await read(".")("head.json")));
  const shapes = new Float32Array((await read(".")("shapes.bin")).buffer);
  const arrays = { rest: Float32Array.from(parts.rest), triangles: Uint16Array.from(parts.triangles), tints: Float32Array.from(parts.tints) };
  const head = new Head(document.getElementById("face"), arrays);
  const mouth = new Mouth(parts, shapes, parts.rest.length);
  head.draw(mouth.displacements(0));
  button.disabled = false;
  said.textContent = "nothing that is said leaves this page";
  button.onclick = () => listen(hearing, head, mouth, parts).catch(failed);
  if (asked.has("report_s")) button.click(); // whoever tests the page gives the microphone's sound himself
}

async function listen(hearing, head, mouth, { lips }) {
  button.disabled = true;
  const wanted = { channelCount: 1, echoCancellation: false, noiseSuppression: false, autoGainControl: false };
  const microphone = await navigator.mediaDevices.getUserMedia({ audio: wanted });
  const context = new AudioContext({ sampleRate: RATE });
  await context.audioWorklet.addModule("microphone.js");
  const node = new AudioWorkletNode(context, "microphone");
  context.createMediaStreamSource(microphone).connect(node);
  const stream = new PhoneStream(hearing, ort), waiting = [], phones = [];
  let samples = 0, frames = 0, busy = false, busy_ms = 0;

  const hear = async () => {
    busy = true;
    while (waiting.length) {
      const began = performance.now();
      for (const phone of await stream.push(together(waiting.splice(0)))) {
        mouth.add(phone);
        phones.push({ ...phone, known_s: samples / RATE });
      }
      busy_ms += performance.now() - began;
    }
    line.textContent = phones.slice(-SHOWN).map(({ label }) => (label === "pau" ? "·" : label)).join(" ");
    const share = busy_ms / 10 / Math.max(samples / RATE, 0.1);
    said.textContent = `listening; the face is ${delay_s().toFixed(2)} s behind, ${share.toFixed(0)} % of the time is spent on ${threads} thread${threads === 1 ? "" : "s"}`;
    busy = false;
  };
  const delay_s = () => stream.look_ahead_s + MARGIN_S;
  node.port.onmessage = ({ data }) => {
    waiting.push(data);
    samples += data.length;
    if (!busy) hear().catch(failed);
  };
  const show = () => {
    const time_s = Math.max(0, samples / RATE - delay_s()), moved = mouth.displacements(time_s);
    head.draw(moved);
    frames += 1;
    const done_s = Number(asked.get("report_s") ?? Infinity);
    if (time_s > done_s && !busy && !waiting.length) report({ phones, openings: openings(mouth, lips, done_s), frames, busy_s: busy_ms / 1000, seconds: samples / RATE });
    else requestAnimationFrame(show);
  };
  show();
}

function together(pieces) {
  const whole = new Float32Array(pieces.reduce((sum, piece) => sum + piece.length, 0));
  let at = 0;
  for (const piece of pieces) {
    whole.set(piece, at);
    at += piece.length;
  }
  return whole;
}

// [time in s, gap of the lips in mm], a hundred a second: a slow machine draws fewer.
function openings(mouth, lips, stop_s) {
  return Array.from({ length: Math.floor(100 * stop_s) }, (_, k) => {
    const moved = mouth.displacements(k / 100);
    return [k / 100, lips.reduce((sum, [upper, lower]) => sum + moved[3 * upper + 1] - moved[3 * lower + 1], 0) / lips.length];
  });
}

function report(result) {
  const picture = document.getElementById("face").toDataURL("image/png");
  fetch("report", { method: "POST", body: JSON.stringify({ ...result, picture }) }).catch(() => {});
}

function failed(error) {
  said.textContent = String(error);
  if (asked.has("report_s")) fetch("report", { method: "POST", body: JSON.stringify({ error: String(error) }) }).catch(() => {});
}

main().catch(failed);
