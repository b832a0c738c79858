// An exported linear dynamical system from Node.js: node speak.mjs FOLDER speech.wav   (16 bits at the model's rate)
import { openSystem, readWav, speak } from "../browser/model.js";
import { bytes, ort, told } from "./start.mjs";

await told(async ([folder, sound]) => {
  const model = await openSystem((name) => bytes(`${folder}/${name}`), ort);
  const audio = readWav((await bytes(sound)).buffer, model.manifest.sample_rate);
  const { frames, count, channels } = await speak(model, audio, ort);
  const { fps, layout } = model.manifest;
  return { fps, names: layout.names, count, channels, frames: Array.from(frames) };
});
