// A head in three dimensions. Its shapes are sparse: adding those that are active up here costs less than handing the graphics
// card 52 of them for every vertex, and does not depend on what that card is.

import { THREE, OrbitControls, GLTFLoader } from "/three.js";
import { Markers } from "/page/markers.js";

/** Without a graphics card every pixel costs: fewer are drawn, with simpler light. */
const [CAN_DRAW, DRAWN_BY_PROCESSOR] = (() => {
  const context = document.createElement("canvas").getContext("webgl2");
  const facts = context?.getExtension("WEBGL_debug_renderer_info");
  const name = facts ? context.getParameter(facts.UNMASKED_RENDERER_WEBGL) : "";
  context?.getExtension("WEBGL_lose_context")?.loseContext();
  return [Boolean(context), /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name)];
})();

/** Pixels drawn for each of the page's, across: while the face moves, and when it has been still for MOVES_MS. */
const RATIO = DRAWN_BY_PROCESSOR ? { moving: 0.5, still: 1 } : { moving: Math.min(devicePixelRatio, 2), still: Math.min(devicePixelRatio, 2) };
const MOVES_MS = 250;

let file = null; // the head is fetched once and read once for each window

/** A loaded head on a canvas; null, and why in `note`, where this browser cannot draw it. */
export async function openFace(canvas, note) {
  if (CAN_DRAW) return new Face(canvas).load();
  note.textContent = "This browser cannot draw the face: it has no WebGL 2. Without a graphics card, start Chromium or Chrome with --enable-unsafe-swiftshader, or take Firefox. All else works.";
  return null;
}

/** A head on a canvas; `pose(row, names)` moves it, `ghost(row)` a pale one over it. */
class Face {
  constructor(canvas) {
    this.canvas = canvas;
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: !DRAWN_BY_PROCESSOR });
    this.renderer.setPixelRatio(RATIO.still);
    this.scene = new THREE.Scene();
    this.scene.background = new THREE.Color(0x20262e);
    this.camera = new THREE.PerspectiveCamera(28, 1, 0.01, 20);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enableDamping = false;
    this.controls.addEventListener("change", () => this.ask());
    const key = new THREE.DirectionalLight(0xffffff, 2.2);
    key.position.set(0.5, 0.7, 1);
    this.scene.add(key, new THREE.HemisphereLight(0xdfe9ff, 0x5a4a40, 1.5));
    this.wanted = false;
    this.drawn = 0; // pictures drawn so far, for the benchmark
    this.before = -Infinity; // when the last one was drawn, ms
    new ResizeObserver(() => this.fit()).observe(canvas);
    canvas.addEventListener("keydown", (event) => this.key(event));
  }

  /** Fetch the head; gives this. */
  async load() {
    file ??= fetch("/head.glb").then((answer) => answer.arrayBuffer());
    this.body = await readHead(await file);
    this.scene.add(this.body.root);
    this.reset();
    return this;
  }

  /** Markers at places [[name, x, y, z], …] of the head at rest, mm; gives them, or null where there are none. */
  mark(places) {
    const [first] = this.body.meshes;
    this.body.markers = first && places.length ? new Markers(first.surface, first.node, places) : null;
    return this.body.markers;
  }

  reset() {
    const box = new THREE.Box3().setFromObject(this.body.root);
    const middle = box.getCenter(new THREE.Vector3());
    const height = box.max.y - box.min.y;
    const bust = box.max.x - box.min.x > 0.85 * height; // with shoulders; a head alone is shown whole
    const [up, far] = bust ? [0.64, 1.75] : [0.5, 2.6];
    this.controls.target.set(middle.x, box.min.y + up * height, middle.z);
    this.camera.position.set(middle.x, box.min.y + (up + 0.02) * height, middle.z + far * height);
    this.controls.update();
    this.ask();
  }

  /** Show a row of a motion. */
  pose(row, names) {
    this.body.pose(row, names);
    this.ask();
  }

  /** Show a pale second head, or none. */
  async ghost(row, names) {
    if (row && !this.pale) {
      this.pale = readHead(await file);
      const pale = await this.pale;
      pale.paint(new THREE.MeshBasicMaterial({ color: 0xd7a6ff, transparent: true, opacity: 0.35, depthWrite: false }));
      this.scene.add(pale.root);
    }
    if (!this.pale) return;
    const pale = await this.pale;
    pale.root.visible = Boolean(row);
    if (row) pale.pose(row, names);
    this.ask();
  }

  /** Colour the skin by the distance (mm) between two rows of weights; null: as it is. */
  heat(row, other) {
    this.body.heat(row, other);
    this.ask();
  }

  /** Draw before the screen shows its next picture; with fewer pixels where one picture soon follows another. */
  ask() {
    if (this.wanted || !this.body) return;
    this.wanted = true;
    requestAnimationFrame((now) => {
      this.wanted = false;
      const moves = now - this.before < MOVES_MS;
      this.before = now;
      this.draw(moves ? RATIO.moving : RATIO.still);
      clearTimeout(this.resting);
      if (RATIO.moving !== RATIO.still && moves) this.resting = setTimeout(() => this.draw(RATIO.still), MOVES_MS);
    });
  }

  draw(ratio) {
    if (this.renderer.getPixelRatio() !== ratio) this.renderer.setPixelRatio(ratio);
    this.renderer.render(this.scene, this.camera);
    this.drawn += 1;
  }

  fit() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (!width || !height) return;
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.ask();
  }

  key(event) {
    const turn = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1] }[event.key];
    const nearer = { "+": 0.9, "=": 0.9, "-": 1.1 }[event.key];
    if (!turn && !nearer) return;
    event.preventDefault();
    const seen = this.camera.position.clone().sub(this.controls.target);
    const place = new THREE.Spherical().setFromVector3(seen);
    if (turn) {
      place.theta += turn[0];
      place.phi = Math.min(Math.max(place.phi + turn[1], 0.2), 2.9);
    } else place.radius *= nearer;
    this.camera.position.copy(this.controls.target).add(seen.setFromSpherical(place));
    this.controls.update();
    this.ask();
  }
}

async function readHead(buffer) {
  const read = await new GLTFLoader().parseAsync(buffer.slice(0), "");
  return new Body(read.scene, read.animations[0]);
}

/** The meshes and nodes of a head that a row of a motion moves. */
class Body {
  constructor(root, animation) {
    this.root = root;
    this.meshes = [];
    const surfaces = new Map(); // what several meshes share is moved once
    root.traverse((node) => {
      if (node.isMesh) node.frustumCulled = false;
      if (!node.isMesh || !node.morphTargetDictionary) return;
      const { position } = node.geometry.attributes;
      if (!surfaces.has(position)) surfaces.set(position, new Surface(node));
      this.meshes.push({ node, surface: surfaces.get(position) });
    });
    for (const { node, surface } of this.meshes) surface.take(node);
    this.surfaces = [...surfaces.values()];
    if (DRAWN_BY_PROCESSOR) root.traverse((node) => node.isMesh && (node.material = simpler(node.material)));
    root.updateMatrixWorld(true);
    const moved = (path) => (animation?.tracks ?? []).filter((t) => t.name.endsWith(path)).map((t) => t.name.slice(0, -path.length));
    const shifted = new Set(moved(".position"));
    const turned = moved(".quaternion");
    this.heads = turned.filter((name) => shifted.has(name)).map((name) => joint(root, name));
    this.eyes = turned.filter((name) => !shifted.has(name)).map((name) => joint(root, name));
  }

  /** Row: weights in the order of `names`, head (3 rad, 3 mm), gaze (2 rad), lift of the tongue. */
  pose(row, names) {
    for (const surface of this.surfaces) surface.move(row, names);
    this.markers?.follow();
    const at = names.length;
    const angle = Math.hypot(row[at], row[at + 1], row[at + 2]);
    const axis = new THREE.Vector3(row[at], row[at + 1], row[at + 2]).divideScalar(angle || 1);
    const turn = new THREE.Quaternion().setFromAxisAngle(axis, angle);
    const shift = new THREE.Vector3(row[at + 3], row[at + 4], row[at + 5]).multiplyScalar(1e-3);
    for (const head of this.heads) place(head, turn, shift);
    const look = new THREE.Quaternion().setFromEuler(new THREE.Euler(-row[at + 7], row[at + 6], 0, "YXZ"));
    for (const eye of this.eyes) place(eye, look, null);
  }

  paint(material) {
    this.root.traverse((node) => {
      if (node.isMesh) node.material = material;
    });
  }

  /** Blue where both are the same, red where the skin is 4 mm apart. */
  heat(row, other) {
    for (const { node, surface } of this.meshes) {
      node.userData.plain ??= node.material;
      node.userData.heat ??= row && other ? heatMaterial(node.geometry, surface) : null;
      node.material = row && other ? node.userData.heat : node.userData.plain;
    }
    if (row && other) for (const surface of this.surfaces) surface.colour(row, other);
  }
}

/** Vertices that shapes move: where they rest, and for each shape which of them it moves, and how far. */
class Surface {
  constructor(mesh) {
    const { position, normal } = mesh.geometry.attributes;
    this.position = plain(position);
    this.normal = normal ? plain(normal) : null;
    this.rest = this.position.array.slice();
    this.upright = this.normal?.array.slice();
    this.index = new Map(Object.entries(mesh.morphTargetDictionary));
    const { position: places, normal: turns } = mesh.geometry.morphAttributes;
    this.shapes = places.map(sparse);
    this.turns = this.normal && turns ? turns.map(sparse) : [];
  }

  /** Let a mesh be drawn from here. */
  take(mesh) {
    mesh.geometry.setAttribute("position", this.position);
    if (this.normal) mesh.geometry.setAttribute("normal", this.normal);
    mesh.geometry.morphAttributes = {};
    mesh.morphTargetInfluences = mesh.morphTargetDictionary = undefined;
  }

  order(names) {
    if (this.names !== names.join()) {
      this.names = names.join();
      this.places = names.map((name) => this.index.get(name) ?? -1);
    }
    return this.places;
  }

  /** [names] how far one number of `position` moves for a weight of 1 of each shape. */
  slopes(number, names) {
    return this.order(names).map((place) => {
      const found = place < 0 ? -1 : this.shapes[place].which.indexOf(number);
      return found < 0 ? 0 : this.shapes[place].values[found];
    });
  }

  move(row, names) {
    this.position.array.set(this.rest);
    if (this.normal) this.normal.array.set(this.upright);
    this.order(names).forEach((place, k) => {
      if (place < 0 || Math.abs(row[k]) < 1e-4) return;
      add(this.position.array, this.shapes[place], row[k]);
      if (this.turns.length) add(this.normal.array, this.turns[place], row[k]);
    });
    this.position.needsUpdate = true;
    if (this.normal) this.normal.needsUpdate = true;
  }

  colour(row, other) {
    const apart = new Float32Array(this.rest.length);
    (this.places ?? []).forEach((place, k) => place >= 0 && row[k] !== other[k] && add(apart, this.shapes[place], row[k] - other[k]));
    this.colours ??= new THREE.BufferAttribute(new Float32Array(this.rest.length), 3);
    const { array } = this.colours;
    for (let i = 0; i < apart.length; i += 3) {
      const share = Math.min((1000 * Math.hypot(apart[i], apart[i + 1], apart[i + 2])) / FAR_MM, 1);
      array[i] = 0.2 + 0.8 * share;
      array[i + 1] = 0.35 + 0.3 * (1 - Math.abs(2 * share - 1));
      array[i + 2] = 0.85 * (1 - share) + 0.05;
    }
    this.colours.needsUpdate = true;
  }
}

function simpler({ map, color, transparent, opacity, side }) {
  return new THREE.MeshLambertMaterial({ map, color, transparent, opacity, side });
}

/** An attribute of its own, [V, 3] in a plain array. */
function plain(attribute) {
  const array = new Float32Array(3 * attribute.count);
  for (let i = 0; i < attribute.count; i++) array.set([attribute.getX(i), attribute.getY(i), attribute.getZ(i)], 3 * i);
  return new THREE.BufferAttribute(array, 3).setUsage(THREE.DynamicDrawUsage);
}

/** Which numbers of a shape are not 0, and they. */
function sparse(attribute) {
  const { array } = plain(attribute);
  const which = [];
  for (let i = 0; i < array.length; i++) if (Math.abs(array[i]) > 1e-7) which.push(i);
  return { which: Uint32Array.from(which), values: Float32Array.from(which, (i) => array[i]) };
}

function add(array, { which, values }, weight) {
  for (let n = 0; n < which.length; n++) array[which[n]] += weight * values[n];
}

const FAR_MM = 4;

function heatMaterial(geometry, surface) {
  surface.colours ??= new THREE.BufferAttribute(new Float32Array(surface.rest.length), 3);
  geometry.setAttribute("color", surface.colours);
  return new THREE.MeshStandardMaterial({ vertexColors: true, roughness: 0.7 });
}

/** A node with its pose at rest, and how the axes of the world lie in its parent. */
function joint(root, name) {
  const node = root.getObjectByName(name);
  const parent = node.parent.getWorldQuaternion(new THREE.Quaternion());
  const scale = node.parent.getWorldScale(new THREE.Vector3()).x;
  return { node, parent, scale, turn: node.quaternion.clone(), place: node.position.clone() };
}

/** Turn and shift a joint by what is given in the world's axes. */
function place({ node, parent, scale, turn, place: rest }, rotation, shift) {
  const inverse = parent.clone().invert();
  node.quaternion.copy(inverse.clone().multiply(rotation).multiply(parent).multiply(turn));
  if (shift) node.position.copy(rest).add(shift.clone().applyQuaternion(inverse).divideScalar(scale));
}
