/* The page of two runs: run A as on its own page, run B as ghosts, and below them the plot of how far they are apart.
   A body under the pointer, or the one last clicked at, is shown by itself. Bodies beyond their horizon lose colour. */

const FADED = 0.6; // of the colour that a body beyond its horizon has lost
const SEEN = 0.2; // pixels that a ghost must be away from its body to be drawn: outlines on top of each other would flicker
const CLICK = 4; // pixels that a pointer may move in a click

/* Body names by mesh: those of run A, and of the ghosts. */
class Bodies {
  constructor(viewer, manifest, ghosts) {
    this.entries = new Map();
    this.meshes = [];
    const compared = new Set([...manifest.comparison.ghosts, ...manifest.comparison.softBodies].map(({name}) => name));
    for (const {name, key, group = "bodies", surface} of [...manifest.bodies, ...manifest.softBodies]) {
      if (compared.has(name)) {
        const node = viewer.scene_tree.find([group, key]).object, meshes = [];
        node.traverse((part) => { if (part.isMesh) { meshes.push(part); } });
        const own = meshes.map((mesh) => mesh.material.color.clone());
        this.entries.set(name, {node, meshes, own, ghost: ghosts.nodes.get(name), colour: surface.color});
      }
    }
    for (const [name, {node, ghost}] of this.entries) {
      for (const [root, folder] of [[node, node.parent], [ghost, ghosts.folder]]) {
        root.traverse((part) => { if (part.isMesh) { this.meshes.push({part, name, isSeen: () => root.visible && folder.visible}); } });
      }
    }
    this.beyond = new Set();
  }

  showRunA(shown) { for (const {node} of this.entries.values()) { node.visible = shown; } }

  fade(name, beyond) {
    if (this.beyond.has(name) === beyond) { return; }
    this.beyond[beyond ? "add" : "delete"](name);
    const {meshes, own} = this.entries.get(name);
    meshes.forEach(({material}, k) => {
      const {r, g, b} = own[k], grey = 0.21 * r + 0.72 * g + 0.07 * b;
      material.color.copy(own[k]);
      if (beyond) { material.color.lerp(new THREE.Color(grey, grey, grey), FADED); }
    });
  }

  /* Name of the body in sight at a point of the window, or null. */
  at(x, y, camera) {
    const ray = new THREE.Raycaster();
    ray.setFromCamera(new THREE.Vector2((2 * x) / window.innerWidth - 1, 1 - (2 * y) / window.innerHeight), camera);
    const [hit] = ray.intersectObjects(this.meshes.filter(({isSeen}) => isSeen()).map(({part}) => part), false);
    return hit ? this.meshes.find(({part}) => part === hit.object).name : null;
  }
}

class ComparisonPanel extends Panel {
  constructor(viewer, stage, transport, manifest) {
    super(viewer, stage, transport, "comparison", `<canvas id="apart" title="click to go there"></canvas>
      <div id="legend"><div id="runs"></div><p id="who"></p><p id="distance"></p><p id="angle"></p><p id="trust"></p></div>`);
    Object.assign(this, {hovered: null, chosen: null});
    const {labels, ghosts, softBodies, horizon} = manifest.comparison, {distance, angle} = viewer.scene_tree.find(["ghosts"]).object;
    this.ghosts = new Ghosts(viewer, manifest.comparison, transport.times);
    this.bodies = new Bodies(viewer, manifest, this.ghosts);
    this.build(labels);
    this.plot = new DistancePlot(element("apart"), transport.times, [...ghosts, ...softBodies].map(({name}) => name), distance, angle, horizon);
    this.bindScene();
    this.open([this.plot]);
  }

  get focus() { return this.hovered ?? this.chosen; }

  build(labels) {
    const label = document.createElement("div");
    label.id = "label";
    document.body.append(label);
    const redraw = (set) => (shown) => { set(shown); this.viewer.set_dirty(); };
    const run = (k, set) => {
      const button = document.createElement("button");
      button.textContent = labels[k];
      button.title = `run ${"AB"[k]}: ${labels[k]} (${k + 1})`;
      button.className = `run-${"ab"[k]}`;
      element("runs").append(button);
      return makeSwitch(button, redraw(set), true);
    };
    const keys = {
      1: run(0, (shown) => {
        this.bodies.showRunA(shown);
        this.ghosts.castShadows(!shown); // else they would float
      }),
      2: run(1, (shown) => { this.ghosts.folder.visible = shown; }),
    };
    window.addEventListener("keydown", (event) => {
      if (!isTaken(event) && !event.ctrlKey && !event.metaKey && !event.altKey && keys[event.key]) { keys[event.key](); }
    });
    showKeys([["1 2", "show, hide run A, run B"], ["click", "on a body: its own curve"]]);
  }

  bindScene() {
    const pane = element("meshcat-pane");
    let pressed = null;
    const find = (event) => this.bodies.at(event.clientX, event.clientY, this.viewer.camera);
    pane.addEventListener("pointermove", (event) => {
      if (event.buttons === 0) { this.hover(find(event)); }
    });
    pane.addEventListener("pointerleave", () => this.hover(null));
    pane.addEventListener("pointerdown", (event) => { pressed = [event.clientX, event.clientY]; }, true);
    window.addEventListener("pointerup", (event) => {
      if (pressed && Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) < CLICK) {
        const name = find(event);
        this.chosen = name === this.chosen ? null : name;
        this.show();
      }
      pressed = null;
    });
  }

  hover(name) {
    if (name === this.hovered) { return; }
    this.hovered = name;
    this.show();
  }

  show() {
    this.keepFitted();
    const {time, frame} = this.transport, focus = this.focus;
    this.ghosts.show(frame, time);
    for (const [name, until] of Object.entries(this.plot.horizon)) {
      if (this.bodies.entries.has(name)) { this.bodies.fade(name, time > until); }
    }
    const colour = focus === null ? theme.colour("ink") : this.bodies.entries.get(focus).colour;
    this.plot.draw(time, frame, focus, colour);
    const [distance, angle] = this.plot.at(focus, frame, time), until = this.plot.horizonOf(focus);
    element("who").textContent = focus ?? (this.bodies.entries.size === 1 ? [...this.bodies.entries.keys()][0] : "largest of all bodies");
    element("distance").textContent = withUnit(distance, "m");
    element("angle").textContent = withUnit(angle, "rad");
    element("angle").hidden = this.ghosts.turns.size === 0 || (focus !== null && !this.ghosts.turns.has(focus)); // flexible bodies have none
    element("legend").style.setProperty("--line", colour);
    element("trust").textContent = until === Infinity ? "" :
      `${time > until ? "beyond" : "within"} the horizon, ${Number(Math.max(until, this.transport.start).toPrecision(4))} s`;
    element("legend").classList.toggle("beyond", time > until);
    this.viewer.set_dirty();
  }

  /* Hides the ghosts that cannot be told from their bodies; with every picture. */
  hideEqual() {
    const {camera, controls} = this.viewer, {time, frame} = this.transport;
    const pixel = (2 * Math.tan((camera.fov * Math.PI) / 360) * camera.position.distanceTo(controls.target)) / window.innerHeight;
    for (const [name, {node, ghost}] of this.bodies.entries) {
      const [distance, angle] = this.plot.at(name, frame, time);
      ghost.visible = !node.visible || distance + angle * this.stage.framing.body_radius > SEEN * pixel;
    }
  }

  /* Puts the label of the body in focus above it; with every picture. */
  placeLabel() {
    const label = element("label"), entry = this.bodies.entries.get(this.focus);
    label.hidden = entry === undefined;
    if (label.hidden) { return; }
    const {time, frame} = this.transport, box = new THREE.Box3();
    box.setFromObject(entry.node.visible || !this.ghosts.folder.visible ? entry.node : entry.ghost);
    const up = new THREE.Vector3(0, 1, 0), point = box.getCenter(new THREE.Vector3());
    point.addScaledVector(up, 0.5 * box.getSize(new THREE.Vector3()).y).project(this.viewer.camera);
    label.textContent = `${this.focus}  ${withUnit(this.plot.at(this.focus, frame, time)[0], "m")}`;
    label.classList.toggle("beyond", time > this.plot.horizonOf(this.focus));
    label.style.transform = `translate(-50%, -100%) translate(${(0.5 + 0.5 * point.x) * window.innerWidth}px, ` +
      `${(0.5 - 0.5 * point.y) * window.innerHeight - 10}px)`;
  }
}

/* The page of one run knows nothing of a second one: this takes hold where everything of run A is there. */
const exposeOneRun = expose;
expose = (viewer, stage, transport, parts) => {
  exposeOneRun(viewer, stage, transport, parts);
  parts.inspector.picks = false; // here a click on a body shows its curve
  const panel = new ComparisonPanel(viewer, stage, transport, JSON.parse(element("manifest").textContent));
  const tell = transport.onTime, render = viewer.render.bind(viewer);
  transport.onTime = () => {
    tell();
    panel.show();
  };
  viewer.render = () => {
    panel.hideEqual();
    panel.placeLabel();
    render();
  };
  stage.frameAction();
  window.rigidimpulse.comparison = {
    pose: (name) => [...panel.ghosts.nodes.get(name).position.toArray(), ...panel.ghosts.nodes.get(name).quaternion.toArray()],
    vertices: (number) => [...panel.ghosts.softBodies[number].geometry.attributes.position.array],
    apart: (name) => panel.plot.at(name, transport.frame, transport.time),
    beyond: () => [...panel.bodies.beyond],
    get focus() { return panel.focus; },
    plot: panel.plot,
  };
};
