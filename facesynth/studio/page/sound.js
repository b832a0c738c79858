// The sound of a line. Its clock is the playhead: the picture follows what is heard.

import { store, changed, duration, say } from "/page/store.js";

let context = null;
let buffer = null;
let source = null;
let began = 0; // the context's time at which the line's time 0 would have been
let rest = 0; // the playhead while nothing plays, seconds
let loaded = null;
export const loop = { on: false, start: 0, end: 0 };
export const peaks = { of: null, step: 256, low: new Float32Array(0), high: new Float32Array(0), rate: 1 };

const latency = () => context.outputLatency || context.baseLatency || 0;

/** The playhead, seconds. */
export function time() {
  if (!source) return rest;
  let at = context.currentTime - latency() - began;
  if (loop.on && at > loop.end) at = loop.start + ((at - loop.start) % Math.max(0.02, loop.end - loop.start));
  return Math.max(0, Math.min(at, duration()));
}

export const apart = []; // seconds between what is shown and what is heard, picture by picture: for the benchmark

/** Compare the playhead with what the sound card says that it plays. */
export function compare() {
  const { contextTime, performanceTime } = context.getOutputTimestamp();
  if (!source || loop.on || !contextTime) return;
  const heard = contextTime + (performance.now() - performanceTime) / 1000 - began;
  apart.push(time() - heard);
  if (apart.length > 100000) apart.length = 0;
}

export const playing = () => source !== null;

/** Load the sound at an address, once. */
export async function load(address) {
  if (loaded === address) return;
  stop();
  loaded = address;
  rest = 0;
  Object.assign(loop, { on: false, start: 0, end: 0 });
  context ??= new AudioContext();
  const answer = await fetch(address);
  if (!answer.ok) return say(await answer.text(), true);
  const decoded = await context.decodeAudioData(await answer.arrayBuffer());
  if (loaded !== address) return;
  buffer = decoded;
  measure(address);
  changed("time");
}

/** Lowest and highest sample of each 256, for the waveform. */
function measure(address) {
  const samples = buffer.getChannelData(0);
  const count = Math.ceil(samples.length / peaks.step);
  peaks.low = new Float32Array(count);
  peaks.high = new Float32Array(count);
  for (let k = 0; k < count; k++) {
    let low = 0;
    let high = 0;
    const stop = Math.min(samples.length, (k + 1) * peaks.step);
    for (let i = k * peaks.step; i < stop; i++) {
      if (samples[i] < low) low = samples[i];
      else if (samples[i] > high) high = samples[i];
    }
    peaks.low[k] = low;
    peaks.high[k] = high;
  }
  peaks.rate = buffer.sampleRate;
  peaks.of = address;
}

export async function play() {
  if (!buffer || source) return;
  await context.resume();
  const from = loop.on ? loop.start : rest >= duration() - 0.02 ? 0 : rest;
  source = context.createBufferSource();
  source.buffer = buffer;
  source.loop = loop.on;
  source.loopStart = loop.start;
  source.loopEnd = loop.end;
  source.connect(context.destination);
  const mine = source;
  source.onended = () => {
    if (source === mine) stop();
  };
  began = context.currentTime - from;
  source.start(0, from);
  changed("time");
}

export function stop() {
  if (!source) return;
  rest = time();
  const old = source;
  source = null;
  old.onended = null;
  old.stop();
  changed("time");
}

/** Put the playhead somewhere; a sound that plays goes on from there. */
export function seek(at) {
  const goOn = playing();
  if (goOn) stop();
  rest = Math.max(0, Math.min(at, duration()));
  if (goOn) play();
  changed("time");
}

/** Play a stretch of another sound, once; gives its clock, in seconds since its start, or null when it is over. */
export async function playOther(address, start, stopAt) {
  context ??= new AudioContext();
  await context.resume();
  stop();
  const decoded = await context.decodeAudioData(await (await fetch(address)).arrayBuffer());
  const other = context.createBufferSource();
  other.buffer = decoded;
  other.connect(context.destination);
  let over = false;
  other.onended = () => (over = true);
  const zero = context.currentTime - start;
  other.start(0, start, Math.max(0.02, stopAt - start));
  return { time: () => (over ? null : context.currentTime - latency() - zero), stop: () => other.stop() };
}

export const loadLine = () => (store.line ? load(`/sound/${encodeURIComponent(store.line)}`) : undefined);
