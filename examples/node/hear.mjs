// Phones of a sound by an exported phone network, in pieces: node hear.mjs FOLDER speech.wav [samples]   (16 bits at 16 kHz)
import { readFile } from "node:fs/promises";
import { webcrypto } from "node:crypto";
import * as ort from "onnxruntime-web";
import { openFolder, readWav } from "../browser/model.js";
import { PhoneStream, RATE } from "../browser/phones.js";

globalThis.crypto ??= webcrypto;
ort.env.wasm.numThreads = 1;

const [folder, sound, piece = "1600"] = process.argv.slice(2);
const hearing = await openFolder(async (name) => new Uint8Array(await readFile(`${folder}/${name}`)), ort);
const wav = await readFile(sound);
const audio = readWav(wav.buffer.slice(wav.byteOffset, wav.byteOffset + wav.length), RATE);
const stream = new PhoneStream(hearing, ort), phones = [];
for (let at = 0; at < audio.length; at += Number(piece)) phones.push(...(await stream.push(audio.slice(at, at + Number(piece)))));
phones.push(...(await stream.finish()));
console.log(JSON.stringify(phones));
