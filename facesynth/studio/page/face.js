// A head in three dimensions, moved by weights on the graphics card.

import { THREE, OrbitControls, GLTFLoader } from "/three.js";

let file = null; // the head is fetched once and read once for each window

/** A head on a canvas; `pose(row, names)` moves it, `ghost(row)` a pale one over it. */
export class Face {
  constructor(canvas) {
    this.canvas = canvas;
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true });
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
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

  /** Draw before the screen shows its next picture. */
  ask() {
    if (this.wanted || !this.body) return;
    this.wanted = true;
    requestAnimationFrame(() => {
      this.wanted = false;
      this.renderer.render(this.scene, this.camera);
      this.drawn += 1;
    });
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
    root.traverse((node) => {
      if (node.isMesh) node.frustumCulled = false;
      if (node.isMesh && node.morphTargetDictionary) this.meshes.push(node);
    });
    root.updateMatrixWorld(true);
    const moved = (path) => (animation?.tracks ?? []).filter((t) => t.name.endsWith(path)).map((t) => t.name.slice(0, -path.length));
    const shifted = new Set(moved(".position"));
    const turned = moved(".quaternion");
    this.heads = turned.filter((name) => shifted.has(name)).map((name) => joint(root, name));
    this.eyes = turned.filter((name) => !shifted.has(name)).map((name) => joint(root, name));
    this.order = new Map();
  }

  /** Row: weights in the order of `names`, head (3 rad, 3 mm), gaze (2 rad), lift of the tongue. */
  pose(row, names) {
    for (const mesh of this.meshes) {
      const places = this.placesOf(mesh, names);
      for (let k = 0; k < places.length; k++) if (places[k] >= 0) mesh.morphTargetInfluences[places[k]] = row[k];
    }
    const at = names.length;
    const angle = Math.hypot(row[at], row[at + 1], row[at + 2]);
    const axis = new THREE.Vector3(row[at], row[at + 1], row[at + 2]).divideScalar(angle || 1);
    const turn = new THREE.Quaternion().setFromAxisAngle(axis, angle);
    const shift = new THREE.Vector3(row[at + 3], row[at + 4], row[at + 5]).multiplyScalar(1e-3);
    for (const head of this.heads) place(head, turn, shift);
    const look = new THREE.Quaternion().setFromEuler(new THREE.Euler(-row[at + 7], row[at + 6], 0, "YXZ"));
    for (const eye of this.eyes) place(eye, look, null);
  }

  placesOf(mesh, names) {
    let places = this.order.get(mesh);
    if (!places) {
      places = names.map((name) => mesh.morphTargetDictionary[name] ?? -1);
      this.order.set(mesh, places);
    }
    return places;
  }

  paint(material) {
    this.root.traverse((node) => {
      if (node.isMesh) node.material = material;
    });
  }

  /** Blue where both are the same, red where the skin is 4 mm apart. */
  heat(row, other) {
    for (const mesh of this.meshes) {
      const { geometry } = mesh;
      mesh.userData.plain ??= mesh.material;
      if (!row || !other) {
        mesh.material = mesh.userData.plain;
        continue;
      }
      mesh.userData.heat ??= heatMaterial(geometry);
      mesh.material = mesh.userData.heat;
      colour(geometry, this.order.get(mesh) ?? [], row, other);
    }
  }
}

function heatMaterial(geometry) {
  geometry.setAttribute("color", new THREE.BufferAttribute(new Float32Array(geometry.attributes.position.count * 3), 3));
  return new THREE.MeshStandardMaterial({ vertexColors: true, roughness: 0.7 });
}

const FAR_MM = 4;

function colour(geometry, places, row, other) {
  const shapes = geometry.morphAttributes.position;
  const apart = new Float32Array(geometry.attributes.position.count * 3);
  places.forEach((target, k) => {
    const difference = row[k] - other[k];
    if (target < 0 || Math.abs(difference) < 1e-4) return;
    const shape = shapes[target].array;
    for (let i = 0; i < apart.length; i++) apart[i] += difference * shape[i];
  });
  const colours = geometry.attributes.color.array;
  for (let i = 0; i < apart.length; i += 3) {
    const share = Math.min((1000 * Math.hypot(apart[i], apart[i + 1], apart[i + 2])) / FAR_MM, 1);
    colours[i] = 0.2 + 0.8 * share;
    colours[i + 1] = 0.35 + 0.3 * (1 - Math.abs(2 * share - 1));
    colours[i + 2] = 0.85 * (1 - share) + 0.05;
  }
  geometry.attributes.color.needsUpdate = true;
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
