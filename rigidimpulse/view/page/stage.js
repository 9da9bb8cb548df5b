/* The stage: nodes of bodies, ground, light, and the camera that frames the action. */

const GRID_CELLS = 12; // about as many across the action
const FIELD_OF_VIEW = 35; // degrees, up and down
const CAMERA_MARGIN = 1.25;
const CAMERA_DROP = 0.08; // looks below the middle by this share of the half height: the bar lies at the bottom

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
    this.surfaces = [];
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
    viewer.set_object(["sky"], makeSky());
    this.light = makeKeyLight(this.turn, this.recorded(this.centre), 1.35 * this.radius);
    viewer.set_object(["Lights", "key"], this.light);
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
  }

  makeMesh(body, geometry) {
    const surface = makeSurface(body.surface), mesh = new THREE.Mesh(geometry, surface);
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
    this.grounds.push(ground);
    return ground;
  }

  /* The nearest camera along the framing's view direction that sees the whole outline of the action, in the middle of
     what the bar leaves free. */
  frameAction() {
    const camera = this.viewer.camera, controls = this.viewer.controls;
    camera.fov = FIELD_OF_VIEW;
    const tall = Math.tan((camera.fov * Math.PI) / 360), wide = tall * (window.innerWidth / window.innerHeight);
    const back = new THREE.Vector3().fromArray(this.framing.view), over = acrossAndUp(back).over;
    const {target, distance} = nearestView(this.framing.outline, back, tall, wide, CAMERA_MARGIN, 3 * this.radius);
    target.addScaledVector(over, -CAMERA_DROP * tall * distance).add(this.follow ? this.middleOfMovers() : this.centre);
    controls.target.copy(target);
    controls.minDistance = 0.02 * this.radius;
    controls.maxDistance = 60 * this.radius;
    camera.position.copy(target).addScaledVector(back, distance);
    this.viewer.set_dirty();
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
