// Phones of a sound by an exported phone network, in pieces: node hear.mjs FOLDER speech.wav [samples]   (16 bits at 16 kHz)
import { openFolder, readWav } from "../browser/model.js";
import { PhoneStream, RATE } from "../browser/phones.js";
import { bytes, ort, told } from "./start.mjs";

await told(async ([folder, sound, piece = "1600"]) => {
  const hearing = await openFolder((name) => bytes(`${folder}/${name}`), ort);
  if (!hearing.graphs.phones) throw new Error(`the folder holds a model of method ${hearing.manifest.method}; wanted what \`facesynth export phones\` writes`);
  const audio = readWav((await bytes(sound)).buffer, RATE);
  const stream = new PhoneStream(hearing, ort), phones = [];
  for (let at = 0; at < audio.length; at += Number(piece)) phones.push(...(await stream.push(audio.slice(at, at + Number(piece)))));
  return [...phones, ...(await stream.finish())];
});
