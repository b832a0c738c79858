// Drawing the lanes of the timeline: only what is in sight.

import { store, indexAt, isDoubted, startOf, valueAt } from "/page/store.js";
import { peaks, loop } from "/page/sound.js";
import { view, x, at } from "/page/view.js";

export const COLOURS = { text: "#eef1f5", soft: "#b9c3d0", edge: "#4a5566", accent: "#7fc4ff", ghost: "#d7a6ff", good: "#7bd88f", fair: "#ffd166", poor: "#ff9d8a" };
const EMOTIONS = ["#8fa3bd", "#e8b64c", "#e0705c", "#6c9be8", "#9bd17a", "#c48be0", "#5cc4c0", "#d98fb0"];

/** Top and height of each lane for a canvas of this height. */
export function lanesOf(height) {
  const fixed = { ruler: 18, words: 20, phones: 26, nodes: 24 };
  const left = Math.max(height - 88, 90);
  const order = [["ruler", 18], ["wave", 0.34 * left], ["words", 20], ["phones", 26], ["nodes", 24], ["emotions", 0.3 * left], ["curve", 0.36 * left]];
  const lanes = {};
  let top = 0;
  for (const [name, size] of order) {
    lanes[name] = { top, height: fixed[name] ?? size };
    top += lanes[name].height;
  }
  return lanes;
}

/** As on the maps; where there are none, by the order of the emotions. */
export function colourOf(emotion) {
  const known = store.model?.colours[emotion];
  if (known) return `rgb(${known.map((part) => Math.round(255 * part)).join(" ")})`;
  return EMOTIONS[Math.max(0, (store.corpus?.emotions ?? []).indexOf(emotion)) % EMOTIONS.length];
}

/** How good a chosen node is: right, viseme or other; none for silence. */
export function qualityOf(row) {
  if (!row || row.node === null || row.node === undefined || row.right_phone === undefined) return null;
  return row.right_phone ? "right" : row.right_viseme ? "viseme" : "other";
}

export function drawRuler(c, lane) {
  const length = view.end - view.start;
  const step = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 30, 60].find((s) => (s / length) * view.width > 62) ?? 120;
  c.fillStyle = COLOURS.soft;
  c.strokeStyle = COLOURS.edge;
  for (let t = Math.ceil(view.start / step) * step; t <= view.end; t += step) {
    c.fillText(step < 1 ? t.toFixed(2) : `${t.toFixed(0)} s`, x(t) + 3, lane.top + 12);
    line(c, x(t), lane.top, x(t), lane.top + lane.height);
  }
  if (loop.on) {
    c.fillStyle = "rgb(127 196 255 / 35%)";
    c.fillRect(x(loop.start), lane.top, x(loop.end) - x(loop.start), lane.height);
  }
}

export function drawWave(c, lane) {
  const middle = lane.top + lane.height / 2;
  const scale = lane.height / 2.1;
  const each = peaks.step / peaks.rate;
  c.fillStyle = "#6fa8d6";
  for (let pixel = 0; pixel < view.width; pixel++) {
    const first = Math.floor(at(pixel) / each);
    const last = Math.max(first + 1, Math.floor(at(pixel + 1) / each));
    if (first >= peaks.low.length) break;
    let low = 0;
    let high = 0;
    for (let k = first; k < Math.min(last, peaks.low.length); k++) {
      low = Math.min(low, peaks.low[k]);
      high = Math.max(high, peaks.high[k]);
    }
    c.fillRect(pixel, middle - high * scale, 1, Math.max(1, (high - low) * scale));
  }
}

export function drawWords(c, lane, take) {
  c.fillStyle = COLOURS.text;
  for (const [label, start, end] of take.words) {
    if (end < view.start || start > view.end) continue;
    clipped(c, label, x(start), x(end), lane);
    c.strokeStyle = COLOURS.edge;
    line(c, x(start), lane.top, x(start), lane.top + lane.height);
  }
}

/** A phone that is doubted has a question mark, its colour and a dashed line beneath. */
export function drawPhones(c, lane, take) {
  each(take.phones, (k, label, start, end) => {
    if (k === store.phone) {
      c.fillStyle = "#2f5f8a";
      c.fillRect(x(start), lane.top, x(end) - x(start), lane.height);
    }
    const doubted = isDoubted(take.phones[k]);
    c.fillStyle = doubted ? COLOURS.fair : label === "pau" ? COLOURS.soft : COLOURS.text;
    clipped(c, doubted ? `${label}?` : label, x(start), x(end), lane);
    if (doubted) for (let left = x(start) + 2; left < x(end) - 2; left += 6) c.fillRect(left, lane.top + lane.height - 3, Math.min(3, x(end) - 2 - left), 2);
    c.strokeStyle = "#8493a6";
    line(c, x(end), lane.top, x(end), lane.top + lane.height);
  });
}

/** Shape and word say what colour says too: ● right phone, ◐ right viseme, ○ other; a bar joins nodes recorded in a row. */
export function drawNodes(c, lane, take) {
  const pins = new Map(take.pins);
  const y = lane.top + lane.height / 2;
  each(take.phones, (k, _label, start, end) => {
    const row = store.choices[k];
    const quality = qualityOf(row);
    if (quality) {
      const middle = x((start + end) / 2);
      if (row.captured) {
        c.fillStyle = "#6d7c8f";
        const before = x((startOf(take, k - 1) + start) / 2);
        c.fillRect(before, y - 1, middle - before, 2);
      }
      mark(c, middle, y, Math.min(5, Math.max(2, (x(end) - x(start)) / 3)), quality);
    }
    if (pins.has(k)) {
      c.strokeStyle = COLOURS.accent;
      c.lineWidth = 2;
      c.strokeRect(x(start) + 2, lane.top + 2, Math.max(2, x(end) - x(start) - 4), lane.height - 4);
      c.lineWidth = 1;
    }
  });
}

function mark(c, place, y, size, quality) {
  c.fillStyle = c.strokeStyle = { right: COLOURS.good, viseme: COLOURS.fair, other: COLOURS.poor }[quality];
  c.lineWidth = 1.5;
  c.beginPath();
  c.arc(place, y, size, 0, 2 * Math.PI);
  if (quality === "right") c.fill();
  else c.stroke();
  if (quality === "viseme") {
    c.beginPath();
    c.arc(place, y, size, Math.PI / 2, 1.5 * Math.PI);
    c.fill();
  }
  c.lineWidth = 1;
}

export function drawEmotions(c, lane, take) {
  each(take.emotions, (k, label, start, end) => {
    const intensity = take.emotions[k][2];
    c.fillStyle = colourOf(label);
    const height = (lane.height - 4) * intensity;
    c.globalAlpha = 0.5;
    c.fillRect(x(start), lane.top + lane.height - height, x(end) - x(start) - 1, height);
    c.globalAlpha = 1;
    c.strokeStyle = k === store.region ? COLOURS.accent : COLOURS.edge;
    c.strokeRect(x(start) + 0.5, lane.top + 1, x(end) - x(start) - 1, lane.height - 2);
    c.fillStyle = COLOURS.text;
    clipped(c, `${label} ${Math.round(100 * intensity)} %`, Math.max(x(start), 0), x(end), { top: lane.top, height: 18 });
  });
  if (!take.curve.length) return;
  c.strokeStyle = COLOURS.text;
  c.beginPath();
  const y = (value) => lane.top + lane.height - 2 - (lane.height - 4) * value;
  c.moveTo(0, y(take.curve[0][1]));
  for (const [time, value] of take.curve) c.lineTo(x(time), y(value));
  c.lineTo(view.width, y(take.curve.at(-1)[1]));
  c.stroke();
}

/** How the share of a lane's height is read from a row: of a weight, or of a marker's place. */
function readerOf(name, names) {
  const column = names.indexOf(name);
  return column < 0 ? (store.markers?.curve(name, names) ?? null) : (rows, start) => rows[start + column];
}

export function drawCurve(c, lane, name) {
  const drawn = [[store.recording?.utterance && store.recording.own ? store.recording : null, COLOURS.good, [2, 3]], [store.compared ?? store.before, COLOURS.ghost, [7, 3]], [store.motion, COLOURS.text, []]];
  c.strokeStyle = COLOURS.edge;
  line(c, 0, lane.top, view.width, lane.top);
  for (const [motion, colour, dashes] of drawn) {
    const read = motion && readerOf(name, motion.names);
    if (!read) continue;
    c.strokeStyle = colour;
    c.setLineDash(dashes);
    c.beginPath();
    for (let pixel = 0; pixel <= view.width; pixel += 2) {
      const value = Math.min(Math.max(valueAt(motion, at(pixel), read), 0), 1);
      c.lineTo(pixel, lane.top + lane.height - 3 - (lane.height - 8) * value);
    }
    c.stroke();
  }
  c.setLineDash([]);
}

/** The intervals of [label, end, …] rows that are in sight: number, label, start, end. */
function each(rows, draw) {
  const first = indexAt(rows, view.start);
  for (let k = first; k < rows.length; k++) {
    const start = k > 0 ? rows[k - 1][1] : 0;
    if (start > view.end) break;
    draw(k, rows[k][0], start, rows[k][1]);
  }
}

function clipped(c, text, left, right, lane) {
  const width = right - left - 4;
  if (width < 4) return;
  const needed = c.measureText(text).width;
  if (needed > width && width < 9) return;
  c.save();
  c.beginPath();
  c.rect(left + 1, lane.top, right - left - 2, lane.height);
  c.clip();
  c.fillText(text, left + Math.max(3, (right - left - needed) / 2), lane.top + lane.height / 2 + 4);
  c.restore();
}

function line(c, x1, y1, x2, y2) {
  c.beginPath();
  c.moveTo(Math.round(x1) + 0.5, y1);
  c.lineTo(Math.round(x2) + 0.5, y2);
  c.stroke();
}

