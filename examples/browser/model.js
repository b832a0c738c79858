// A folder that `facesynth export` wrote: verified, then run by onnxruntime-web. The same file serves the page and Node.

export async function openFolder(read, ort) {
  const manifest = JSON.parse(new TextDecoder().decode(await read("manifest.json")));
  if (manifest.written_by !== "facesynth" || manifest.format !== 2) throw new Error("manifest.json was not written by facesynth export");
  const graphs = {};
  for (const [name, entry] of Object.entries(manifest.graphs)) {
    const content = await read(entry.file);
    await checkHash(entry.file, content, manifest.files[entry.file].sha256);
    graphs[name] = { entry, session: await ort.InferenceSession.create(content) };
  }
  return { manifest, graphs };
}

async function checkHash(name, content, wanted) {
  const digest = new Uint8Array(await crypto.subtle.digest("SHA-256", content));
  const got = Array.from(digest, (byte) => byte.toString(16).padStart(2, "0")).join("");
  if (got !== wanted) throw new Error(`${name} does not have the hash that the manifest states`);
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

// 16-bit mono WAV to samples.
export function readWav(buffer, wantedRate) {
  const view = new DataView(buffer);
  const rate = view.getUint32(24, true);
  if (rate !== wantedRate) throw new Error(`the sound has ${rate} Hz; wanted ${wantedRate} Hz`);
  let at = 12;
  while (view.getUint32(at, false) !== 0x64617461) at += 8 + view.getUint32(at + 4, true);
  const samples = new Float32Array(view.getUint32(at + 4, true) / 2);
  for (let k = 0; k < samples.length; k++) samples[k] = view.getInt16(at + 8 + 2 * k, true) / 32768;
  return samples;
}
