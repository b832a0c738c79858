// An exported linear dynamical system from Node.js: node speak.mjs FOLDER speech.wav   (16 bits at the model's rate)
import { readFile } from "node:fs/promises";
import { webcrypto } from "node:crypto";
import * as ort from "onnxruntime-web";
import { openFolder, readWav, speak } from "../browser/model.js";

globalThis.crypto ??= webcrypto;
ort.env.wasm.numThreads = 1;

const [folder, sound] = process.argv.slice(2);
const model = await openFolder(async (name) => new Uint8Array(await readFile(`${folder}/${name}`)), ort);
const wav = await readFile(sound);
const audio = readWav(wav.buffer.slice(wav.byteOffset, wav.byteOffset + wav.length), model.manifest.sample_rate);
const { frames, count, channels } = await speak(model, audio, ort);
const { fps, layout } = model.manifest;
console.log(JSON.stringify({ fps, names: layout.names, count, channels, frames: Array.from(frames) }));
