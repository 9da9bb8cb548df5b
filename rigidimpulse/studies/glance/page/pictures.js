/* The pictures of all runs, drawn by one renderer into the places that the page leaves for them, from one camera that a drag turns. */

const FIELD_OF_VIEW = 30; // degrees, up and down
const MARGIN = 1.12;
const SHADOW_SIZE = 1024;
const GROUND_REACH = 7; // in radii of the action
const EDGE = 25; // degrees between faces, from which an edge is drawn in an outline
const GHOST = 0.3; // opacity of the surface in an outline
const SEEN = 0.004; // of the radius of the action: an outline nearer to its body than this would flicker on it
const TURN = 0.006; // rad for a pixel of a drag
const STEEPEST = 1.35; // rad
const GROUNDS = {light: "#b3b8bd", dark: "#39434b"};

/* The motion of one run: poses of its moving bodies at any time. */
class Motion {
  constructor(entry, buffer) {
    this.times = entry.times;
    this.bodies = entry.bodies;
    this.position = new Float32Array(buffer, ...entry.position);
    this.quaternion = new Int16Array(buffer, ...entry.quaternion);
    this.tracks = entry.bodies.filter(({track}) => track >= 0).length;
  }

  pose(time, nodes) {
    const times = this.times;
    let low = 0, high = times.length - 1;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (times[middle] <= time) { low = middle; } else { high = middle; }
    }
    const share = high > low ? Math.min(Math.max((time - times[low]) / (times[high] - times[low]), 0), 1) : 0;
    const to = new THREE.Quaternion(), next = new THREE.Vector3();
    nodes.forEach((node, track) => {
      const a = low * this.tracks + track, b = high * this.tracks + track;
      node.position.fromArray(this.position, 3 * a).lerp(next.fromArray(this.position, 3 * b), share);
      node.quaternion.fromArray(this.quaternion, 4 * a).normalize().slerp(to.fromArray(this.quaternion, 4 * b).normalize(), share);
    });
  }
}

/* What is drawn of a run: its bodies as solids, and as outlines in a colour. */
class Figure {
  constructor(motion, pictures) {
    this.motion = motion;
    this.pictures = pictures;
    this.solid = new THREE.Group();
    this.nodes = [];
    for (const body of motion.bodies) {
      const node = this.place(body, this.solid);
      if (body.shape >= 0) {
        const mesh = new THREE.Mesh(pictures.geometries[body.shape], pictures.surface(body.surface));
        mesh.castShadow = mesh.receiveShadow = true;
        node.add(mesh);
      }
      for (const plane of body.planes) { node.add(pictures.ground(plane)); }
      if (body.track >= 0) { this.nodes[body.track] = node; }
    }
  }

  place(body, group) {
    const node = new THREE.Group();
    node.position.fromArray(body.position);
    node.quaternion.fromArray(body.quaternion);
    group.add(node);
    return node;
  }

  /* Outlines of the moving bodies; those on their body in another figure are left out. */
  outline(colour) {
    if (!this.lines) {
      this.material = new THREE.LineBasicMaterial({toneMapped: false, transparent: true, opacity: 0.95});
      this.veil = new THREE.MeshBasicMaterial({toneMapped: false, transparent: true, opacity: GHOST, depthWrite: false});
      this.lines = new THREE.Group();
      this.outlined = [];
      for (const body of this.motion.bodies.filter(({track, shape}) => track >= 0 && shape >= 0)) {
        const node = this.place(body, this.lines);
        node.add(new THREE.LineSegments(this.pictures.edges(body.shape), this.material),
          new THREE.Mesh(this.pictures.geometries[body.shape], this.veil));
        this.outlined[body.track] = node;
      }
    }
    this.material.color.copy(linearColour(colour));
    this.veil.color.copy(this.material.color);
    return this.lines;
  }

  poseOutline(time, other) {
    this.motion.pose(time, this.outlined);
    this.outlined.forEach((node, track) => {
      const there = other.nodes[track];
      node.visible = node.position.distanceTo(there.position) + node.quaternion.angleTo(there.quaternion) * 0.1 * this.pictures.radius >
        SEEN * this.pictures.radius;
    });
  }
}

class Pictures {
  constructor(canvas) {
    this.renderer = new THREE.WebGLRenderer({canvas, antialias: true, alpha: true});
    dressRenderer(this.renderer);
    this.renderer.shadowMap.enabled = true;
    this.renderer.setScissorTest(true);
    this.renderer.setClearAlpha(0);
    this.camera = new THREE.PerspectiveCamera(FIELD_OF_VIEW);
    this.around = {turn: 0, lift: 0};
    this.surfaces = new Map();
  }

  /* Takes what a study knows by now. */
  load(index, buffer) {
    const framing = index.framing;
    this.framing = framing;
    this.radius = new THREE.Vector3().fromArray(framing.half).length();
    this.turn = new THREE.Quaternion().fromArray(framing.stage);
    this.centre = new THREE.Vector3().fromArray(framing.centre);
    this.scene = new THREE.Scene();
    this.stage = new THREE.Group();
    this.stage.quaternion.copy(this.turn);
    this.scene.add(this.stage);
    const light = makeKeyLight(this.turn, this.centre.clone().applyQuaternion(this.turn.clone().invert()), 1.35 * this.radius);
    light.shadow.mapSize.set(SHADOW_SIZE, SHADOW_SIZE);
    light.shadow.normalBias *= 2;
    this.stage.add(light, light.target);
    this.camera.near = 0.01 * this.radius;
    this.camera.far = 60 * this.radius;
    this.geometries = index.shapes.map((shape) => makeGeometry(buffer, shape));
    this.outlines = [];
    this.grounds = [];
    const figure = (motion) => (motion ? new Figure(new Motion(motion, buffer), this) : null);
    this.figures = new Map(index.runs.map((run) => [run.name, figure(run.motion)]));
    this.truth = figure(index.truth);
    this.paintGrounds();
  }

  surface(surface) {
    const key = JSON.stringify(surface);
    if (!this.surfaces.has(key)) { this.surfaces.set(key, makeSurface(surface)); }
    return this.surfaces.get(key);
  }

  edges(shape) { return (this.outlines[shape] ??= new THREE.EdgesGeometry(this.geometries[shape], EDGE)); }

  ground([x, y, z, offset]) {
    const ground = makeGround(this.radius / 3, GROUND_REACH * this.radius, 1), normal = new THREE.Vector3(x, y, z);
    ground.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), normal);
    ground.position.copy(normal).multiplyScalar(offset);
    this.grounds.push(ground);
    return ground;
  }

  paintGrounds() {
    const colour = linearColour(GROUNDS[document.documentElement.dataset.theme] ?? GROUNDS.light);
    for (const ground of this.grounds) { ground.traverse((part) => { if (part.isMesh) { part.material.color.copy(colour); } }); }
  }

  /* The nearest place from which the camera sees the whole outline of the action in a picture so much wider than high. */
  aim(aspect) {
    const {turn, lift} = this.around, back = new THREE.Vector3().fromArray(this.framing.view);
    const flat = Math.atan2(back.x, back.z) + turn, high = Math.min(Math.max(Math.asin(back.y) + lift, -STEEPEST), STEEPEST);
    back.set(Math.sin(flat) * Math.cos(high), Math.sin(high), Math.cos(flat) * Math.cos(high));
    const tall = Math.tan((FIELD_OF_VIEW * Math.PI) / 360);
    const {target, distance} = nearestView(this.framing.outline, back, tall, tall * aspect, MARGIN, 3 * this.radius);
    target.add(this.centre);
    this.camera.aspect = aspect;
    this.camera.position.copy(target).addScaledVector(back, distance);
    this.camera.lookAt(target);
    this.camera.updateProjectionMatrix();
  }

  begin() {
    const renderer = this.renderer, width = window.innerWidth, height = window.innerHeight;
    const size = renderer.getSize(new THREE.Vector2());
    if (size.x !== width || size.y !== height) { renderer.setSize(width, height, false); }
    renderer.setScissor(0, 0, width, height);
    renderer.setViewport(0, 0, width, height);
    renderer.clear();
    this.drawn = 0;
  }

  /* Draws a figure as a solid into the place of an element, and others as outlines: [figure, colour] each. */
  draw(element, solid, outlines, time) {
    const place = element.getBoundingClientRect(), height = window.innerHeight;
    if (!solid || place.bottom <= 0 || place.top >= height || place.width === 0) { return; }
    solid.motion.pose(time, solid.nodes);
    this.stage.add(solid.solid);
    const lines = outlines.map(([figure, colour]) => {
      const group = figure.outline(colour);
      figure.poseOutline(time, solid);
      this.stage.add(group);
      return group;
    });
    this.aim(place.width / place.height);
    this.renderer.setViewport(place.left, height - place.bottom, place.width, place.height);
    this.renderer.setScissor(place.left, height - place.bottom, place.width, place.height);
    this.renderer.render(this.scene, this.camera);
    this.stage.remove(solid.solid, ...lines);
    this.drawn++;
  }

  /* Lets a drag on an element turn the camera. */
  bindDrag(element) {
    element.addEventListener("pointerdown", (event) => {
      if (event.target.closest("button") !== event.currentTarget.closest("button")) { return; }
      const start = [event.clientX, event.clientY], before = {...this.around};
      const move = (moved) => {
        this.around.turn = before.turn - TURN * (moved.clientX - start[0]);
        this.around.lift = before.lift + TURN * (moved.clientY - start[1]);
        this.dragged = Math.hypot(moved.clientX - start[0], moved.clientY - start[1]) > 4;
      };
      this.dragged = false;
      window.addEventListener("pointermove", move);
      window.addEventListener("pointerup", () => window.removeEventListener("pointermove", move), {once: true});
    });
  }
}
