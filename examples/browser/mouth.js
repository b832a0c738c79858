// A face from phones as they become known: each phone's shape is reached in its middle, shapes fade evenly into each other, and
// where nobody speaks the face settles. The shapes are those of the model arkit-shapes, made by hand for fifteen kinds of phones.

const SETTLE_S = 0.25, WAKE_S = 0.2, KEPT_S = 5;

export class Mouth {
  // kinds: which shape each phone has; shapes: displacements of all vertices, one shape after the other, mm.
  constructor({ kinds, silence }, shapes, size) {
    Object.assign(this, { kinds, silence, shapes, size });
    this.anchors = [{ time_s: 0, kind: kinds[silence] }];
    this.end_s = 0;
  }

  // A phone { label, end_s } that follows those before it.
  add({ label, end_s }) {
    const kind = this.kinds[label], long = label === this.silence && end_s - this.end_s > SETTLE_S + WAKE_S;
    const times_s = long ? [this.end_s + SETTLE_S, end_s - WAKE_S] : [(this.end_s + end_s) / 2];
    this.anchors.push(...times_s.map((time_s) => ({ time_s, kind })));
    this.end_s = end_s;
    while (this.anchors.length > 2 && this.anchors[1].time_s < end_s - KEPT_S) this.anchors.shift();
  }

  // Two shapes and how much the second counts, at a time; after the last phone that is known the face settles.
  at(time_s) {
    const next = this.anchors.findIndex((anchor) => anchor.time_s > time_s);
    const before = this.anchors.at(next < 0 ? -1 : Math.max(0, next - 1));
    const after = next < 0 ? { time_s: before.time_s + SETTLE_S, kind: this.kinds[this.silence] } : this.anchors[next];
    const share = Math.min(1, Math.max(0, (time_s - before.time_s) / Math.max(after.time_s - before.time_s, 1e-6)));
    return [before.kind, after.kind, share];
  }

  // Displacements [V * 3] at a time.
  displacements(time_s) {
    const [before, after, share] = this.at(time_s), out = new Float32Array(this.size);
    for (let k = 0; k < this.size; k++) out[k] = (1 - share) * this.shapes[before * this.size + k] + share * this.shapes[after * this.size + k];
    return out;
  }
}
