/* The stage: nodes of bodies, ground, light, and the camera that frames the action. */

const GRID_CELLS = 12; // about as many across the action
const FIELD_OF_VIEW = 35; // degrees, up and down
const CAMERA_MARGIN = 1.12;
const FLOOR_MARGIN = 0.02; // of the radius of the action: the camera stays so much above level ground
const SKIES = {
  light: {zenith: "#c3d5e8", horizon: "#f5f1ea", nadir: "#d3d7d9"},
  dark: {zenith: "#0f1418", horizon: "#1d2328", nadir: "#0c1013"},
};
const GROUNDS = {light: ["#b3b8bd", "#5d6b78"], dark: ["#20272d", "#4d5a65"]}; // face, line

function roundSpacing(length) {
  const power = Math.pow(10, Math.floor(Math.log10(length)));
  return power * [1, 2, 5, 10].find((step) => step * power >= 0.999 * length);
}

class Stage {
  constructor(viewer, manifest) {
    this.viewer = viewer;
    this.framing = manifest.framing;
    this.turn = new THREE.Quaternion().fromArray(this.framing.stage); // recorded frame to Y up
    this.unturn = this.turn.clone().invert();
    this.centre = new THREE.Vector3().fromArray(this.framing.centre); // Y up
    this.radius = new THREE.Vector3().fromArray(this.framing.half).length();
    this.nodes = new Map();
    this.meshOf = new Map(); // what is drawn of a body
    this.grounds = [];
    this.floor = -Infinity; // height of the highest level ground, Y up
    this.surfaces = [];
    this.moved = false; // whether people have moved the camera
    this.room = freeRoom();
    this.follow = this.framing.follow;
    viewer.scene.quaternion.copy(this.turn);
    viewer.scene_tree.find(["Cameras", "default", "rotated"]).object.quaternion.copy(this.unturn);
  }

  recorded(point) { return point.clone().applyQuaternion(this.unturn); }

  dress() {
    const viewer = this.viewer;
    dressRenderer(viewer.renderer);
    for (const name of ["Grid", "Axes", "Lights"]) { viewer.delete_path([name]); }
    viewer.scene_tree.find(["Background"]).on_update = () => viewer.set_dirty();
    viewer.scene.background = null;
    this.sky = makeSky();
    viewer.set_object(["sky"], this.sky);
    this.light = makeKeyLight(this.turn, this.recorded(this.centre), 1.35 * this.radius);
    viewer.set_object(["Lights", "key"], this.light);
    this.watchCamera();
    theme.listeners.push(() => this.paint());
    this.paint();
  }

  paint() {
    const name = theme.dark ? "dark" : "light";
    this.sky.paint(SKIES[name]);
    this.grounds.forEach((ground) => this.paintGround(ground));
    this.viewer.set_dirty();
  }

  /* In the theme's colours, or in the one that its body has. */
  paintGround(ground) { ground.paint(...(ground.chosen ?? GROUNDS[theme.dark ? "dark" : "light"])); }

  /* A camera that people have moved stays where they have put it. */
  watchCamera() {
    const {controls, camera} = this.viewer, from = new THREE.Vector3();
    controls.addEventListener("start", () => from.copy(camera.position).sub(controls.target));
    controls.addEventListener("end", () => {
      this.moved ||= camera.position.clone().sub(controls.target).distanceTo(from) > 1e-6 * this.radius;
    });
    this.viewer.renderer.domElement.addEventListener("wheel", () => { this.moved = true; }, {passive: true});
  }

  addBody(body, geometries) {
    const object = new THREE.Group();
    const seen = body.rendered >= 0 ? body.rendered : body.shape;
    if (seen >= 0) {
      this.meshOf.set(body.name, this.makeMesh(body, geometries[seen]));
      object.add(this.meshOf.get(body.name));
    }
    for (const plane of body.planes) { object.add(this.makePlane(plane)); }
    const node = motionSource.place(this.viewer, body.group, body.key, object);
    node.position.fromArray(body.position);
    node.quaternion.fromArray(body.quaternion);
    this.nodes.set(body.name, node);
    for (const plane of body.planes.filter(({level}) => level)) {
      const foot = new THREE.Vector3().fromArray(plane.normal).multiplyScalar(plane.offset);
      foot.applyQuaternion(node.quaternion).add(node.position).applyQuaternion(this.turn);
      this.floor = Math.max(this.floor, foot.y);
    }
  }

  makeMesh(body, geometry) {
    const surface = makeSurface(body.surface, geometry), mesh = new THREE.Mesh(geometry, surface);
    this.surfaces.push(surface);
    mesh.castShadow = true;
    mesh.receiveShadow = true;
    return mesh;
  }

  makePlane(plane) {
    const spacing = roundSpacing((2 * this.radius) / GRID_CELLS);
    const ground = makeGround(spacing, (plane.level ? 9 : 2.2) * this.radius, plane.level ? 1 : 0.8);
    const normal = new THREE.Vector3().fromArray(plane.normal);
    ground.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), normal);
    ground.position.copy(normal).multiplyScalar(plane.offset);
    if (plane.color) { ground.chosen = [plane.color, darker(plane.color)]; }
    this.grounds.push(ground);
    this.paintGround(ground);
    return ground;
  }

  /* The nearest camera along the framing's view direction that sees the whole outline of the action inside the free room. */
  frameAction() {
    const camera = this.viewer.camera, controls = this.viewer.controls, room = this.measureRoom();
    this.moved = false;
    camera.fov = FIELD_OF_VIEW;
    const half = Math.tan((camera.fov * Math.PI) / 360) / window.innerHeight;
    const tall = half * (room.bottom - room.top), wide = half * (room.right - room.left);
    const back = new THREE.Vector3().fromArray(this.framing.view);
    const {target, distance} = nearestView(this.framing.outline, back, tall, wide, CAMERA_MARGIN, 3 * this.radius);
    target.add(this.follow ? this.middleOfMovers() : this.centre);
    controls.target.copy(target);
    controls.minDistance = 0.02 * this.radius;
    controls.maxDistance = 60 * this.radius;
    controls.maxPolarAngle = this.floor > -Infinity ? 0.5 * Math.PI - FLOOR_MARGIN : Math.PI;
    camera.position.copy(target).addScaledVector(back, distance);
    this.centrePicture();
  }

  measureRoom() {
    this.room = freeRoom();
    return this.room;
  }

  /* The middle of the picture is that of the free room. */
  centrePicture() {
    const {room} = this, {camera} = this.viewer;
    const offsetX = 0.5 - (room.left + room.right) / 2 / window.innerWidth, offsetY = 0.5 - (room.top + room.bottom) / 2 / window.innerHeight;
    camera.view = {enabled: true, fullWidth: 1, fullHeight: 1, offsetX, offsetY, width: 1, height: 1};
    camera.updateProjectionMatrix();
    this.viewer.set_dirty();
  }

  /* When the free room has changed. */
  refit() {
    if (!this.moved) { return this.frameAction(); }
    this.measureRoom();
    this.centrePicture();
  }

  middleOfMovers() {
    const middle = new THREE.Vector3(), movers = this.framing.movers;
    for (const name of movers) { middle.addScaledVector(this.nodes.get(name).position, 1 / movers.length); }
    return movers.length > 0 ? middle.applyQuaternion(this.turn) : this.centre.clone();
  }

  /* Before every picture: the camera goes with the bodies if it follows; planes, light and depth range go with it. */
  prepare() {
    const camera = this.viewer.camera, target = this.viewer.controls.target;
    if (this.follow) {
      const shift = this.middleOfMovers().sub(target);
      target.add(shift);
      camera.position.add(shift);
      this.light.aimAt(this.recorded(target));
    }
    if (this.floor > -Infinity) {
      camera.position.y = Math.max(camera.position.y, this.floor + FLOOR_MARGIN * this.radius);
      camera.lookAt(target);
    }
    const distance = camera.position.distanceTo(target);
    camera.near = 0.01 * distance;
    camera.far = 30 * (distance + this.radius);
    for (const ground of this.grounds) {
      const local = this.recorded(target);
      ground.parent.worldToLocal(local.applyQuaternion(this.turn));
      local.sub(ground.position).applyQuaternion(ground.quaternion.clone().invert());
      ground.centreOn(local.x, local.y);
    }
  }
}
