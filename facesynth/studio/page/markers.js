// Markers: points of the skin where a performer would wear them. They move with the skin, and their paths are curves.

import { THREE } from "/three.js";

const RAISED_M = 0.0015; // above the skin, so that it does not hide them
const AXES = { across: 0, up: 1, forward: 2 };
export const LARGEST_MM = 20; // from the middle of a lane to its edge

/** Points of a surface that are nearest to places at rest: `places` [[name, x, y, z], …] in mm, as the head is made. */
export class Markers {
  constructor(surface, node, places) {
    this.surface = surface;
    this.names = places.map(([name]) => name);
    this.vertices = places.map(([, ...place]) => nearest(surface.rest, place));
    this.attribute = new THREE.BufferAttribute(new Float32Array(3 * places.length), 3).setUsage(THREE.DynamicDrawUsage);
    const geometry = new THREE.BufferGeometry().setAttribute("position", this.attribute);
    this.points = new THREE.Points(geometry, new THREE.PointsMaterial({ color: 0xffd166, size: 4, sizeAttenuation: false }));
    this.points.frustumCulled = false;
    this.points.visible = false;
    node.add(this.points);
  }

  show(on) {
    this.points.visible = on;
    this.follow();
  }

  /** Lay the points onto the skin as it is now. */
  follow() {
    if (!this.points.visible) return;
    const { position, normal } = this.surface;
    this.vertices.forEach((vertex, k) => {
      for (let axis = 0; axis < 3; axis++) {
        const raised = normal ? RAISED_M * normal.array[3 * vertex + axis] : 0;
        this.attribute.array[3 * k + axis] = position.array[3 * vertex + axis] + raised;
      }
    });
    this.attribute.needsUpdate = true;
  }

  /** Names of the curves of all markers. */
  get curves() {
    return this.names.flatMap((name) => Object.keys(AXES).map((axis) => `${name} ${axis}`));
  }

  /** How a curve is read from a motion: share of its lane's height for a row's weights, from the lower edge; null for none. */
  curve(title, names) {
    const [, name, axis] = /^(.+) (across|up|forward)$/.exec(title) ?? [];
    const k = this.names.indexOf(name);
    if (k < 0) return null;
    const slopes = this.surface.slopes(3 * this.vertices[k] + AXES[axis], names);
    return (rows, start) => {
      let moved = 0;
      for (let n = 0; n < slopes.length; n++) moved += slopes[n] * rows[start + n];
      return 0.5 + (500 * moved) / LARGEST_MM;
    };
  }
}

function nearest(rest, [x, y, z]) {
  let best = 0;
  let least = Infinity;
  for (let i = 0; i < rest.length; i += 3) {
    const far = Math.hypot(rest[i] - x / 1000, rest[i + 1] - y / 1000, rest[i + 2] - z / 1000);
    if (far < least) [least, best] = [far, i / 3];
  }
  return best;
}
