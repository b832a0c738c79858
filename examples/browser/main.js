// Sound in, a talking head out, all in the page.
import * as ort from "./ort/ort.wasm.min.mjs";
import { Head } from "./head.js";
import { openFolder, openSystem, readWav, run, speak } from "./model.js";

ort.env.wasm.wasmPaths = new URL("./ort/", import.meta.url).href;
// Threads share memory, which a page may do only where its server isolates it from others (COOP and COEP headers).
const threads = globalThis.crossOriginIsolated ? Math.min(4, navigator.hardwareConcurrency || 1) : 1;
ort.env.wasm.numThreads = threads;

const said = document.getElementById("said");
const read = (folder) => async (name) => {
  const answer = await fetch(`${folder}/${name}`);
  if (!answer.ok) throw new Error(`${folder}/${name}: ${answer.status}`);
  return new Uint8Array(await answer.arrayBuffer());
};

async function main() {
  const began = performance.now();
  const [lds, face] = await Promise.all([openSystem(read("model"), ort), openFolder(read("face"), ort)]);
  const wav = await read(".")("speech.wav");
  const audio = readWav(wav.buffer, lds.manifest.sample_rate);
  const ready = performance.now();
  const { frames, count, channels } = await speak(lds, audio, ort);
  const spoken = performance.now();

  const parts = JSON.parse(new TextDecoder().decode(await read(".")("head.json")));
  const arrays = { rest: Float32Array.from(parts.rest), triangles: Uint16Array.from(parts.triangles), tints: Float32Array.from(parts.tints) };
  const head = new Head(document.getElementById("face"), arrays);
  const show = async (t) => {
    const one = frames.slice(t * channels, (t + 1) * channels);
    head.draw((await run(face.graphs.deform_mesh, { frames: [one, [1, 1, channels]] }, ort)).displacements.data);
  };
  await show(widest(frames, count, channels, lds.manifest.layout.lip_pairs));
  const seconds = audio.length / lds.manifest.sample_rate;
  said.textContent = `${count} frames for ${seconds.toFixed(2)} s of speech in ${(spoken - ready).toFixed(0)} ms`
    + ` on ${threads} thread${threads === 1 ? "" : "s"}${globalThis.crossOriginIsolated ? "" : " (the page is not cross-origin isolated)"}`;
  report({ count, channels, frames: Array.from(frames), start_ms: ready - began, speak_ms: spoken - ready, seconds, said: said.textContent });
  playable(lds, show, count);
}

function widest(frames, count, channels, pairs) {
  const gap = (t) => pairs.reduce((sum, [upper, lower]) => sum + frames[t * channels + 3 * upper + 1] - frames[t * channels + 3 * lower + 1], 0);
  let best = 0;
  for (let t = 1; t < count; t++) if (gap(t) > gap(best)) best = t;
  return best;
}

function playable(lds, show, count) {
  const button = document.getElementById("play");
  button.disabled = false;
  button.onclick = () => {
    const sound = new Audio("speech.wav");
    const step = async () => {
      await show(Math.min(count - 1, Math.floor(sound.currentTime * lds.manifest.fps)));
      if (!sound.ended) requestAnimationFrame(step);
    };
    sound.play().then(step);
  };
}

// Whoever serves the page may want to know how it went (the test does).
function report(result) {
  const picture = document.getElementById("face").toDataURL("image/png");
  fetch("report", { method: "POST", body: JSON.stringify({ ...result, picture }) }).catch(() => {});
}

main().catch((error) => {
  said.textContent = error.message;
  fetch("report", { method: "POST", body: JSON.stringify({ error: error.message }) }).catch(() => {});
});
