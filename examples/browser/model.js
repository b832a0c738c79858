// A folder that `facesynth export` wrote: verified, then run by onnxruntime-web. The same file serves the page and Node.

export async function openFolder(read, ort) {
  const text = new TextDecoder().decode(await read("manifest.json"));
  const manifest = JSON.parse(text);
  if (manifest?.written_by !== "facesynth" || manifest.format !== 3) throw new Error("manifest.json was not written by facesynth export");
  await checkManifest(text, manifest);
  const graphs = {};
  for (const [name, entry] of Object.entries(manifest.graphs)) {
    const wanted = manifest.files[entry.file];
    if (!wanted) throw new Error(`${entry.file} is not listed in the manifest`);
    const content = await read(entry.file);
    if ((await sha256(content)) !== wanted.sha256) throw new Error(`${entry.file} does not have the hash that the manifest states`);
    try {
      graphs[name] = { entry, session: await ort.InferenceSession.create(content) };
    } catch (error) {
      throw new Error(`${entry.file} is no graph that onnxruntime runs (${error.message ?? error}); export the model again`);
    }
  }
  return { manifest, graphs };
}

// The same of a linear dynamical system whose input is a graph of its own; other models of facesynth need more than this file does.
export async function openSystem(read, ort) {
  const system = await openFolder(read, ort), { method } = system.manifest;
  if (method !== "lds") throw new Error(`the folder holds a model of method ${method}; wanted lds, trained with hears=periodogram`);
  if (!system.graphs.features) throw new Error("this system hears with the phone network; wanted one that was trained with hears=periodogram");
  return system;
}

// The manifest's own hash is that of its JSON without the hash, keys sorted, no spaces. JSON.parse would forget that 60.0
// is not written 60, so the text itself is put in that order.
async function checkManifest(text, { sha256: wanted }) {
  const plain = compact(text, { at: 0 }, "sha256");
  if ((await sha256(new TextEncoder().encode(plain))) !== wanted) throw new Error("manifest.json was changed after it was written");
}

const STRING = /"(?:[^"\\]|\\.)*"/y;
const SCALAR = /[^\s,\]}]+/y;

// The value of JSON text (known to be valid) at place.at, with keys sorted and no spaces; `without` is a key to leave out.
function compact(text, place, without) {
  const word = (pattern) => {
    pattern.lastIndex = place.at;
    const [found] = pattern.exec(text);
    place.at += found.length;
    return found;
  };
  const space = () => word(/\s*/y);
  const items = (close, item) => {
    place.at++;
    for (space(); text[place.at] !== close; space()) {
      if (text[place.at] === ",") place.at++;
      space();
      item();
    }
    place.at++;
  };
  space();
  if (text[place.at] === "{") {
    const pairs = new Map();
    items("}", () => {
      const key = word(STRING);
      space();
      place.at++;
      pairs.set(key, compact(text, place));
    });
    if (without) pairs.delete(JSON.stringify(without));
    const order = [...pairs].sort(([a], [b]) => (JSON.parse(a) < JSON.parse(b) ? -1 : 1));
    return `{${order.map(([key, value]) => `${key}:${value}`).join(",")}}`;
  }
  if (text[place.at] === "[") {
    const values = [];
    items("]", () => values.push(compact(text, place)));
    return `[${values.join(",")}]`;
  }
  return word(text[place.at] === '"' ? STRING : SCALAR);
}

async function sha256(content) {
  const digest = new Uint8Array(await crypto.subtle.digest("SHA-256", content));
  return Array.from(digest, (byte) => byte.toString(16).padStart(2, "0")).join("");
}

// Inputs are { name: [data, dims] }; what does not fit the manifest is named.
export async function run(graph, inputs, ort) {
  const feeds = {};
  for (const port of graph.entry.inputs) {
    const [data, dims] = inputs[port.name] ?? [];
    const fits = dims?.length === port.shape.length && port.shape.every((n, k) => typeof n === "string" || n === dims[k]);
    if (!fits) throw new Error(`${graph.entry.file}: ${port.name} is [${dims}]; wanted ${port.dtype} [${port.shape}]`);
    feeds[port.name] = new ort.Tensor(port.dtype, data, dims);
  }
  return graph.session.run(feeds);
}

// Sound at the model's rate to frames [T * C], by the deterministic part of the system.
export async function speak(lds, audio, ort) {
  const { manifest, graphs } = lds;
  const { window_samples: length, lead_ms, states, components } = manifest.settings;
  const count = Math.round((audio.length / manifest.sample_rate) * manifest.fps);
  const windows = new Float32Array(count * length);
  for (let t = 0; t < count; t++) {
    const start = Math.round(((t + 0.5) / manifest.fps + lead_ms / 1000) * manifest.sample_rate) - Math.floor(length / 2);
    for (let k = Math.max(0, -start); k < length && start + k < audio.length; k++) windows[t * length + k] = audio[start + k];
  }
  const heard = await run(graphs.features, { windows: [windows, [1, count, length]] }, ort);
  const quiet = new Float32Array(count * components);
  const moved = await run(
    graphs.rollout,
    {
      features: [heard.features.data, heard.features.dims],
      innovations: [quiet, [1, count, components]],
      state: [new Float32Array(states), [1, states]],
    },
    ort,
  );
  return { frames: moved.frames.data, count, channels: moved.frames.dims[2] };
}

// WAV of 16 bits a sample, plain or with the extended header, to mono samples (the mean of the channels).
export function readWav(buffer, wantedRate) {
  const view = new DataView(buffer);
  if (buffer.byteLength < 12 || tag(view, 0) !== "RIFF" || tag(view, 8) !== "WAVE") throw new Error("the sound is no WAV file");
  const [header, size] = part(view, "fmt ");
  if (size < 16) throw new Error("the sound has a damaged header");
  const [coding, channels, bits] = [0, 2, 14].map((offset) => view.getUint16(header + offset, true));
  const rate = view.getUint32(header + 4, true);
  const kind = coding === 0xfffe && size >= 26 ? view.getUint16(header + 24, true) : coding;
  if (kind !== 1 || bits !== 16) throw new Error(`the sound has ${bits} bits a sample in coding ${kind}; wanted whole numbers of 16 bits`);
  if (channels < 1) throw new Error("the sound has no channels");
  if (rate !== wantedRate) throw new Error(`the sound has ${rate} Hz; wanted ${wantedRate} Hz`);
  const [at, bytes] = part(view, "data");
  const samples = new Float32Array(Math.floor(bytes / (2 * channels)));
  if (!samples.length) throw new Error("the sound holds no samples");
  for (let k = 0; k < samples.length; k++) {
    let sum = 0;
    for (let c = 0; c < channels; c++) sum += view.getInt16(at + 2 * (k * channels + c), true);
    samples[k] = sum / channels / 32768;
  }
  return samples;
}

function tag(view, at) {
  return String.fromCharCode(...[0, 1, 2, 3].map((k) => view.getUint8(at + k)));
}

// Where a part of the file begins, and its bytes.
function part(view, name) {
  for (let at = 12; at + 8 <= view.byteLength; ) {
    const size = view.getUint32(at + 4, true);
    if (tag(view, at) === name) {
      if (at + 8 + size > view.byteLength) throw new Error(`the sound is truncated: its part ${name} is cut`);
      return [at + 8, size];
    }
    at += 8 + size + (size % 2);
  }
  throw new Error(`the sound has no part ${name}: it is truncated or no WAV file`);
}
