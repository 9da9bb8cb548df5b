/* The stage of the live page: bodies of one run take the place of those of the run before, and the camera stays where people put it. */

const TURN_TIME = 600; // ms in which the camera goes to another view

/* Nodes stand in folders of their own: meshcat's tree keeps a panel for each of its nodes, which is slow to take away. */
const motionSource = {
  folders: {},
  place(viewer, folder, key, object) {
    this.folders[folder].add(object);
    return object;
  },
  clear(viewer) {
    for (const folder of ["bodies", "ground"]) {
      this.folders[folder]?.clear();
      if (!this.folders[folder]) {
        this.folders[folder] = new THREE.Group();
        viewer.set_object([folder], this.folders[folder]);
      }
    }
  },
};

class LiveStage extends Stage {
  constructor(viewer, manifest) {
    super(viewer, manifest);
    Object.assign(this, {held: false, way: null}); // whether people are moving the camera, and its way to another view
    this.dress();
    viewer.controls.addEventListener("start", () => Object.assign(this, {held: true, way: null}));
    viewer.controls.addEventListener("end", () => { this.held = false; });
    const render = viewer.render.bind(viewer);
    viewer.render = () => {
      this.prepare();
      render();
    };
    viewer.camera.aspect = window.innerWidth / window.innerHeight;
  }

  /* The bodies of a run. */
  build(bodies, geometries) {
    this.surfaces.forEach((surface) => surface.dispose());
    Object.assign(this, {bodies, geometries, grounds: [], surfaces: [], floor: -Infinity});
    motionSource.clear(this.viewer);
    this.nodes.clear();
    this.meshOf.clear();
    this.list = bodies.map((body) => {
      this.addBody({...body, group: body.folder}, geometries);
      return this.nodes.get(body.name);
    });
    this.viewer.set_dirty();
  }

  /* More of the motion is known: light and ground fit it; the camera goes there if it follows and nobody has moved it yet. */
  reframe(framing, follows) {
    this.framing = framing;
    this.follow &&= framing.follow;
    this.turn.fromArray(framing.stage);
    this.unturn.copy(this.turn).invert();
    this.viewer.scene.quaternion.copy(this.turn);
    this.viewer.scene_tree.find(["Cameras", "default", "rotated"]).object.quaternion.copy(this.unturn);
    this.centre.fromArray(framing.centre);
    const radius = new THREE.Vector3().fromArray(framing.half).length();
    if (Math.abs(radius - this.radius) > 0.02 * radius) {
      this.radius = radius;
      this.build(this.bodies, this.geometries);
    }
    const light = makeKeyLight(this.turn, this.recorded(this.centre), 1.35 * this.radius), parent = this.light.parent;
    this.light.shadow.map?.dispose();
    parent.remove(this.light);
    parent.add(light);
    this.light = light;
    if (follows && !this.moved && !this.held) { this.goTo(); }
  }

  /* Where the camera is: place and target. */
  get view() { return [this.viewer.camera.position.clone(), this.viewer.controls.target.clone()]; }

  goTo() {
    const from = this.view;
    this.frameAction();
    this.way = {from, to: this.view, begin: performance.now()};
    this.goOn();
  }

  /* Before every picture: one that is drawn does not ask for the next one. */
  goOn() {
    if (!this.way) { return; }
    const share = Math.min((performance.now() - this.way.begin) / TURN_TIME, 1), eased = share * share * (3 - 2 * share);
    this.viewer.camera.position.lerpVectors(this.way.from[0], this.way.to[0], eased);
    this.viewer.controls.target.lerpVectors(this.way.from[1], this.way.to[1], eased);
    if (share === 1) { this.way = null; }
    this.viewer.set_dirty();
  }
}
