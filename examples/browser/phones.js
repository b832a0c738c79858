// Phones heard in sound that comes in pieces, by the network that `facesynth export phones` wrote: the windows, spikes and stretches
// of facesynth.inference.ear and .spikes, so that the page hears what the runtime's stream hears. How the sound is cut changes nothing.
import { run } from "./model.js";

export const RATE = 16000;
const STEP = 320, SHORTEST = 800;
export const FRAMES_PER_S = RATE / STEP;
const PEAK = 0.5, SMALLEST_PEAK = 1e-3;
const BLANK_BIAS = -0.1, LAG_S = 0.02, REACH_S = 0.06, INSIDE_S = 0.02, SHORTEST_S = 0.005, TOUCHING_S = 1e-6;
const SILENCE = "pau";

export class PhoneStream {
  // Windows in seconds: what comes out at once, what is looked back at, and how much later sound a phone waits for.
  constructor(folder, ort, { block_s = 0.2, before_s = 4, ahead_s = 0.4 } = {}) {
    const frames = (seconds) => Math.round(seconds * FRAMES_PER_S);
    Object.assign(this, { ort, graph: folder.graphs.phones, block: frames(block_s), before: frames(before_s), ahead: frames(ahead_s) });
    this.heard = new Float32Array(0);
    this.first = this.frames = 0;
    this.peak = 0;
    this.reader = new SpikeReader(folder.manifest.settings);
    this.placer = new Placer();
  }

  get look_ahead_s() {
    return (this.block + this.ahead) / FRAMES_PER_S;
  }

  // More sound; the phones { label, end_s, confidence } that became final, silence among them.
  async push(audio) {
    const placed = [];
    for (const rows of await this.advance(audio, false)) placed.push(...this.placer.place(this.reader.read(rows, false), this.reader.read_s));
    return placed;
  }

  async finish() {
    const duration_s = (this.first * STEP + this.heard.length) / RATE;
    const spikes = [];
    for (const rows of await this.advance(new Float32Array(0), true)) spikes.push(...this.reader.read(rows, false));
    return this.placer.end([...spikes, ...this.reader.read([], true)], duration_s);
  }

  // Log-probabilities, a row for each frame, of all blocks whose windows lie within the sound that is known.
  async advance(audio, ended) {
    this.heard = joined(this.heard, audio, ended && !this.first ? SHORTEST : 0);
    const total = this.first * STEP + this.heard.length, count = Math.floor(total / STEP) + 1, blocks = [];
    for (;;) {
      const end = (this.frames + this.block + this.ahead) * STEP;
      if (this.frames >= count || (end > total && !ended)) return blocks;
      blocks.push(await this.hear(Math.min(end, total), Math.min(this.frames + this.block, count)));
    }
  }

  async hear(end, stop) {
    const begin = Math.max(0, this.frames - this.before);
    const window = this.heard.slice((begin - this.first) * STEP, end - this.first * STEP);
    this.peak = window.reduce((most, value) => Math.max(most, Math.abs(value)), this.peak);
    const gain = PEAK / Math.max(this.peak, SMALLEST_PEAK);
    const { log_probabilities: found } = await run(this.graph, { audio: [window.map((v) => v * gain), [1, window.length]] }, this.ort);
    const width = found.dims[2], rows = [];
    for (let t = this.frames - begin; t < stop - begin; t++) rows.push(found.data.slice(t * width, (t + 1) * width));
    const kept = Math.max(this.first, stop - this.before);
    this.heard = this.heard.slice((kept - this.first) * STEP);
    this.first = kept;
    this.frames = stop;
    return rows;
  }
}

function joined(a, b, least) {
  const both = new Float32Array(Math.max(a.length + b.length, least));
  both.set(a);
  both.set(b, a.length);
  return both;
}

// From rows of log-probabilities to the frames that tell a phone: a run of frames with one token most probable.
class SpikeReader {
  constructor({ tokens, phones_of_tokens: phones }) {
    this.phones = phones;
    this.blank = tokens.indexOf("<blank>");
    this.kinds = phones.map((those) => those.join(" "));
    this.open = [];
    this.done = 0;
  }

  get read_s() {
    return this.done / FRAMES_PER_S - LAG_S;
  }

  read(more, ended) {
    const rows = [...this.open, ...more], best = rows.map((row) => this.best(row)), spikes = [];
    let start = 0;
    for (let t = 1; t <= rows.length; t++) {
      if (t < rows.length && best[t] === best[start]) continue;
      if (t === rows.length && !ended && best[start] !== this.blank) break; // it may go on
      spikes.push(...this.spikes(rows.slice(start, t), best[start], start));
      start = t;
    }
    this.open = rows.slice(start);
    this.done += start;
    return spikes;
  }

  best(row) {
    let best = 0;
    const worth = (k) => row[k] + (k === this.blank ? BLANK_BIAS : 0);
    for (let k = 1; k < row.length; k++) if (worth(k) > worth(best)) best = k;
    return best;
  }

  spikes(rows, token, start) {
    const first_s = (this.done + start) / FRAMES_PER_S - LAG_S, last_s = first_s + (rows.length - 1) / FRAMES_PER_S;
    const confidence = this.phones[token].length ? Math.max(...rows.map((row) => this.share(row, this.kinds[token]))) : 0;
    return this.phones[token].map((label, k) => ({ label, first_s: first_s + k * INSIDE_S, last_s: last_s + k * INSIDE_S, confidence }));
  }

  // Probability of the tokens that mean the same among all that mean a phone.
  share(row, kind) {
    let same = 0, all = 0;
    for (let k = 0; k < row.length; k++) {
      const probability = this.kinds[k] ? Math.exp(row[k]) : 0;
      all += probability;
      if (this.kinds[k] === kind) same += probability;
    }
    return same / Math.max(all, 1e-12);
  }
}

// Gives each phone its stretch: half way to its neighbours, at most REACH_S beyond its spike; between them is silence.
class Placer {
  constructor() {
    this.waiting = null;
    this.before_s = -Infinity;
    this.now_s = 0;
  }

  place(spikes, heard_s) {
    const done = [];
    for (const spike of spikes) {
      done.push(...this.settle(spike.first_s));
      this.waiting = spike;
    }
    if (this.waiting && heard_s > this.waiting.last_s + 2 * REACH_S) done.push(...this.settle(Infinity));
    return done;
  }

  end(spikes, duration_s) {
    let before_s = this.now_s;
    const kept = [];
    for (const one of [...this.place(spikes, Infinity), { label: SILENCE, end_s: Infinity, confidence: 1 }]) {
      const end_s = Math.min(one.end_s, duration_s);
      if (end_s > before_s + TOUCHING_S) kept.push({ ...one, end_s });
      before_s = Math.max(before_s, end_s);
    }
    return kept;
  }

  settle(next_s) {
    const spike = this.waiting;
    if (!spike) return [];
    const start_s = Math.max(spike.first_s - REACH_S, (this.before_s + spike.first_s) / 2, this.now_s);
    const end_s = Math.max(Math.min(spike.last_s + REACH_S, (spike.last_s + next_s) / 2), start_s + SHORTEST_S);
    const silence = start_s > this.now_s + TOUCHING_S ? [{ label: SILENCE, end_s: start_s, confidence: 1 }] : [];
    this.waiting = null;
    this.before_s = spike.last_s;
    this.now_s = end_s;
    return [...silence, { label: spike.label, end_s, confidence: spike.confidence }];
  }
}
