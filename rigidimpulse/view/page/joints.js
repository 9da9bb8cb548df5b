/* Joints and springs: anchors, rods to the bodies they join, axes, and limits with where the joint is between them. They are drawn over the
   bodies, which would hide them. Anchors and axes are given in the frame of their bodies. */

const JOINT_SIZE = [0.28, 0.022]; // of a body's radius, and of that of the action, the smaller; half a hinge's axis is three of them
const ROD = 0.14, THREAD = 0.07; // thickness, in joint sizes
const COIL_TURNS = 12, COIL_HEIGHT = 30;
const ARC_STEPS = 48;
const FULL_TURN = 2 * Math.PI;

function jointMaterial(name, opacity) {
  const material = new THREE.MeshBasicMaterial({transparent: true, opacity, depthTest: false, depthWrite: false, toneMapped: false, side: THREE.DoubleSide});
  const paint = () => material.color.set(theme.colour(name));
  theme.listeners.push(paint);
  paint();
  return material;
}

/* A coil about +y, as high as COIL_HEIGHT of its radii: it is scaled to the length of its spring, and so is its wire. */
class Coil extends THREE.Curve {
  getPoint(share) {
    const turn = FULL_TURN * COIL_TURNS * share, wide = share > 0.06 && share < 0.94 ? 1 : 0;
    return new THREE.Vector3(wide * Math.cos(turn), share * COIL_HEIGHT, wide * Math.sin(turn));
  }
}

/* A body, or the world, as the frame of an anchor. */
function frameOf(stage, entries, name) {
  if (name === null) { return {place: (point) => point.clone(), turn: (way) => way.clone(), middle: null}; }
  const node = stage.nodes.get(name), centre = new THREE.Vector3(...entries.get(name).center);
  const place = (point) => point.clone().applyQuaternion(node.quaternion).add(node.position);
  return {place, turn: (way) => way.clone().applyQuaternion(node.quaternion), middle: () => place(centre)};
}

class JointShape {
  constructor(stage, entries, entry, size, group) {
    Object.assign(this, {entry, size, frames: [frameOf(stage, entries, entry.a), frameOf(stage, entries, entry.b)]});
    this.anchors = [new THREE.Vector3(...entry.anchorA), new THREE.Vector3(...entry.anchorB)];
    this.axis = entry.axis ? new THREE.Vector3(...entry.axis).normalize() : null;
    this.object = new THREE.Group();
    group.add(this.object);
    const add = (geometry, material) => {
      const mesh = new THREE.Mesh(geometry, material);
      mesh.renderOrder = 1.7;
      mesh.frustumCulled = false;
      this.object.add(mesh);
      return mesh;
    };
    const rod = () => new THREE.CylinderGeometry(1, 1, 1, 12).translate(0, 0.5, 0);
    const solid = jointMaterial("joint", 0.9), faint = jointMaterial("joint", 0.45);
    this.link = ["distance", "spring"].includes(entry.kind);
    this.rods = (this.link ? [0] : this.frames.map((frame, k) => (frame.middle ? k : -1)).filter((k) => k >= 0)).map((k) => ({k, mesh: add(
      entry.kind === "spring" ? new THREE.TubeGeometry(new Coil(), 240, 0.18, 6).scale(1, 1 / COIL_HEIGHT, 1) : rod(), this.link ? solid : faint)}));
    this.knobs = (this.link ? [0, 1] : [0]).map((k) => ({k, mesh: add(
      entry.kind === "fixed" ? new THREE.BoxGeometry(1.4, 1.4, 1.4) : new THREE.SphereGeometry(this.link ? 0.45 : 0.7, 20, 14), solid)}));
    this.pin = ["hinge", "slider"].includes(entry.kind) ? add(rod(), solid) : null;
    this.makeLimits(add);
  }

  /* Limits of a hinge: a sector, whose zero is where b is at the start. */
  makeLimits(add) {
    const {kind, lower, upper} = this.entry;
    if (kind !== "hinge" || lower === null || upper === null) { return; }
    const zero = this.towardsB();
    if (zero === null) { return; }
    const turnBack = this.inFrameOfA(zero), across = turnBack.clone().addScaledVector(this.axis, -turnBack.dot(this.axis)).normalize();
    const side = this.axis.clone().cross(across), radius = 4.5 * this.size, position = [0, 0, 0], index = [];
    for (let k = 0; k <= ARC_STEPS; k++) {
      const angle = lower + ((upper - lower) * k) / ARC_STEPS;
      const point = across.clone().multiplyScalar(Math.cos(angle)).addScaledVector(side, Math.sin(angle)).multiplyScalar(radius);
      position.push(...point.toArray());
      if (k > 0) { index.push(0, k, k + 1); }
    }
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.Float32BufferAttribute(position, 3));
    geometry.setIndex(index);
    this.sector = add(geometry, jointMaterial("teal", 0.32));
  }

  /* From the anchor to the middle of b, null where that is at the anchor or on the axis. */
  towardsB() {
    const {middle} = this.frames[1];
    if (middle === null) { return null; }
    const way = middle().sub(this.frames[1].place(this.anchors[1])), axis = this.frames[0].turn(this.axis);
    way.addScaledVector(axis, -way.dot(axis));
    return way.length() > 1e-6 * this.size ? way : null;
  }

  inFrameOfA(way) {
    const basis = [new THREE.Vector3(1, 0, 0), new THREE.Vector3(0, 1, 0), new THREE.Vector3(0, 0, 1)];
    return new THREE.Vector3(...basis.map((axis) => way.dot(this.frames[0].turn(axis))));
  }

  show(time) {
    this.object.visible = this.entry.until === null || time <= this.entry.until;
    const ends = this.frames.map((frame, k) => frame.place(this.anchors[k])), {size} = this;
    for (const {k, mesh} of this.rods) {
      const to = this.link ? ends[1] : this.frames[k].middle(), wide = this.entry.kind === "spring" ? 0.7 * size : (this.link ? THREAD : ROD) * size * 1.6;
      this.lay(mesh, ends[k], to, wide);
    }
    for (const {k, mesh} of this.knobs) {
      mesh.position.copy(ends[k]);
      mesh.scale.setScalar(size);
    }
    if (this.pin) {
      const axis = this.frames[0].turn(this.axis), {kind, lower, upper} = this.entry, slides = kind === "slider";
      const from = slides && lower !== null ? lower : -(slides ? 6 : 3) * size, to = slides && upper !== null ? upper : (slides ? 6 : 3) * size;
      this.lay(this.pin, ends[0].clone().addScaledVector(axis, from), ends[0].clone().addScaledVector(axis, to), 0.3 * size);
    }
    if (this.sector) {
      this.sector.position.copy(ends[0]);
      this.sector.quaternion.setFromRotationMatrix(this.turnOfA());
    }
  }

  turnOfA() {
    const [x, y, z] = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map((axis) => this.frames[0].turn(new THREE.Vector3(...axis)));
    return new THREE.Matrix4().makeBasis(x, y, z);
  }

  /* Lays a unit rod between two points. */
  lay(mesh, from, to, wide) {
    const way = to.clone().sub(from), length = Math.max(way.length(), 1e-9);
    mesh.position.copy(from);
    mesh.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), way.divideScalar(length));
    mesh.scale.set(wide, length, wide);
  }
}

class Joints {
  constructor(stage, manifest) {
    const entries = new Map(manifest.bodies.map((body) => [body.name, body])), {body_radius: radius} = manifest.framing;
    const size = Math.min(JOINT_SIZE[0] * radius, JOINT_SIZE[1] * stage.radius);
    this.object = new THREE.Group();
    this.shapes = manifest.joints.filter(({a, b}) => [a, b].every((name) => name === null || entries.has(name)))
      .map((entry) => new JointShape(stage, entries, entry, size, this.object));
  }

  get count() { return this.shapes.length; }

  show(time) { this.shapes.forEach((shape) => shape.show(time)); }
}
