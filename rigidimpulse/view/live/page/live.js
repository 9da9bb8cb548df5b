/* Puts the live page together: meshcat's viewer, which is told of runs while they are computed, and the socket for what people do. */

const MARKS_PAUSE = 200; // ms between two drawings of all impacts on the time line, while more of them come
const RETRY = 1000; // ms until the page asks for a server that is gone again

const KEYS = [
  ["drag", "on a body: throw it; elsewhere: turn the camera"], ["space", "play or pause"], ["\u2190 \u2192", "a frame back, on; with shift ten"],
  ["R", "play from the start"], ["- +", "slower, faster"], ["L", "loop"], ["[ ]", "previous, next impact"], ["F", "frame the action"],
  ["U", "hide everything but the picture"], ["D", "dark or light"], ["?", "these keys"],
];

class LivePage {
  constructor() {
    this.viewer = new MeshCat.Viewer(element("meshcat-pane"));
    this.viewer.gui.domElement.remove();
    Object.assign(this, {stage: null, thrower: null, shapes: [], nextShapes: [], softBodies: [], pictures: 0, lots: 0, marked: 0, number: 0, doing: "starting", throws: 0});
    this.arrows = new GrowingArrows();
    this.player = new Player(this.viewer.animator, () => this.show(), () => this.refresh());
    this.timeline = new LiveTimeline(this.player, this.arrows, () => this.layout());
    this.bar = makeBar(this.player, this.timeline);
    this.bindActions();
    this.controls = new Controls((command) => this.send(command));
    this.listen();
    this.connect();
  }

  /* Buttons and keys. */
  bindActions() {
    const {player, bar} = this, help = makeMenu(element("help-button"), element("help")), dark = () => theme.set(!theme.dark);
    const toImpact = (way) => {
      const time = this.arrows.beside(player.time, way);
      player.pause();
      if (time !== undefined) { player.seek(time); }
    };
    const restart = () => { player.seek(0); player.play(); };
    element("previous").addEventListener("click", () => toImpact(-1));
    element("next").addEventListener("click", () => toImpact(1));
    element("theme-button").addEventListener("click", dark);
    element("controls").addEventListener("toggle", () => this.layout());
    window.addEventListener("resize", () => this.layout());
    showKeys(KEYS);
    bindKeys(player, {
      "[": () => toImpact(-1), "]": () => toImpact(1), r: restart, l: bar.flipLoop, f: () => this.stage?.goTo(), d: dark,
      "-": () => bar.changeSpeed(-1), "+": () => bar.changeSpeed(1), "=": () => bar.changeSpeed(1), "?": () => help(element("help").hidden),
      u: () => {
        document.body.classList.toggle("bare");
        this.layout();
      },
    });
  }

  /* The parts around the picture have changed. */
  layout() {
    fitHeights();
    this.stage?.refit();
  }

  /* meshcat hangs properties on nodes; those of /live are ours. */
  listen() {
    const set = this.viewer.set_property.bind(this.viewer);
    const actions = {
      shape: (numbers) => this.takeShape(numbers),
      begin: (text) => this.begin(JSON.parse(text)),
      frames: (numbers) => this.takeFrames(numbers[0], numbers.subarray(1)),
      impacts: (numbers) => this.takeImpacts(numbers[0], numbers.subarray(1)),
      framing: (text) => this.takeFraming(JSON.parse(text)),
      softBody: (text) => this.takeSoftBody(JSON.parse(text)),
      softFrames: (numbers) => this.softBodies[numbers[0]].frames.set(numbers.subarray(2), numbers[1] * this.softBodies[numbers[0]].row),
      state: (text) => this.takeState(JSON.parse(text)),
    };
    this.viewer.set_property = (path, name, value) => {
      if (path[0] === "live" && actions[name]) { actions[name](value); } else { set(path, name, value); }
    };
  }

  connect() {
    const address = location.origin.replace("http", "ws");
    this.viewer.connect(address);
    this.viewer.connection.onclose = () => this.lose();
    this.socket = new WebSocket(`${address}/live`);
    this.socket.onopen = () => { for (const command of this.waiting ?? []) { this.send(command); } this.waiting = []; };
  }

  send(command) {
    if (this.socket.readyState === WebSocket.OPEN) { this.socket.send(JSON.stringify(command)); } else { (this.waiting ??= []).push(command); }
  }

  /* The server is gone: what is shown stays, and the page is loaded again when there is a server. */
  lose() {
    this.say("lost", "the program has ended");
    const again = async () => {
      try {
        if ((await fetch("/static/", {cache: "no-store"})).ok) { location.reload(); return; }
      } catch { /* not there yet */ }
      setTimeout(again, RETRY);
    };
    setTimeout(again, RETRY);
  }

  takeShape(numbers) {
    const [number, vertices, painted] = numbers, geometry = new THREE.BufferGeometry(), size = 3 * vertices;
    let place = 3;
    for (const name of painted ? ["position", "normal", "color"] : ["position", "normal"]) {
      geometry.setAttribute(name, new THREE.BufferAttribute(numbers.slice(place, place + size), 3));
      place += size;
    }
    geometry.setIndex(new THREE.BufferAttribute(Uint32Array.from(numbers.subarray(place)), 1));
    this.nextShapes[number] = geometry;
  }

  begin(manifest) {
    this.shapes.forEach((geometry) => geometry.dispose());
    this.shapes = this.nextShapes;
    this.nextShapes = [];
    this.number = manifest.number;
    this.isFirst = !this.stage;
    if (this.isFirst) {
      this.stage = new LiveStage(this.viewer, manifest);
      this.thrower = new Thrower(this.stage, this.player, (command) => this.send(command));
      this.viewer.set_object(["impacts"], this.arrows.arrows.object);
      this.bodies = manifest.bodies;
      this.player.lastTick = performance.now();
    }
    this.softBodies.forEach(({geometry, mesh}) => {
      geometry.dispose();
      mesh.material.dispose();
    });
    this.softBodies = [];
    this.stage.build(manifest.bodies, this.shapes);
    this.thrower.dynamic = new Set(manifest.dynamic);
    this.nodes = this.stage.list;
    this.player.begin(manifest);
    this.arrows.begin(manifest);
    this.timeline.begin();
    this.controls.show(manifest.controls, manifest.chosen, manifest.throws);
    this.throws = manifest.throws;
    if (this.isFirst) { this.layout(); }
    this.show();
  }

  /* A flexible body as on the recorded page, with room for the frames that are to come. */
  takeSoftBody({number, faces, vertices, surface, thin}) {
    const geometry = new THREE.BufferGeometry(), row = 3 * vertices, material = makeSurface(surface, geometry);
    geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(row), 3));
    geometry.setIndex(faces);
    Object.assign(material, {side: THREE.DoubleSide, polygonOffset: thin, polygonOffsetUnits: -DRAPE});
    const body = Object.assign(Object.create(SoftBody.prototype), {geometry, row, times: this.player.times, frames: new Float32Array(row * this.player.total)});
    body.mesh = Object.assign(new THREE.Mesh(geometry, material), {castShadow: true, receiveShadow: true, frustumCulled: false});
    this.softBodies[number] = body;
    this.addSoftBodies();
  }

  /* Once more after the stage was built again. */
  addSoftBodies() { this.softBodies.forEach((body) => motionSource.place(this.viewer, "bodies", "", body.mesh)); }

  takeFrames(first, poses) {
    this.player.add(first, poses);
    this.lots += 1;
    this.stale = true;
  }

  takeImpacts(first, rows) {
    this.arrows.add(first, rows);
    this.stale = this.unmarked = true;
  }

  takeFraming({framing, ...sizes}) {
    this.arrows.resizeArrows(sizes);
    this.stage.reframe(framing, this.isFirst);
    this.addSoftBodies();
    this.nodes = this.stage.list;
    this.show();
  }

  takeState({doing, problem, seconds, warnings}) {
    const text = {
      making: "reading the scene", preparing: "preparing", compiling: "compiling kernels, once for this machine", computing: "computing",
      done: `computed in ${Number((seconds ?? 0).toPrecision(2))} s`, failed: "the last good run is shown"}[doing];
    if (doing === "failed") { this.showProblem(problem); } else if (doing === "computing") { element("problem").hidden = true; }
    this.warnings = warnings ?? [];
    this.stale = true;
    this.say(doing, this.warnings.length > 0 ? `${text} \u00b7 ${this.warnings.length === 1 ? "a warning" : `${this.warnings.length} warnings`}` : text);
    element("state").title = this.warnings.join("\n");
  }

  say(doing, text) {
    this.doing = doing;
    element("state").dataset.doing = doing;
    element("state").lastElementChild.textContent = text + (this.throws > 0 ? ` \u00b7 ${this.throws === 1 ? "1 throw" : `${this.throws} throws`}` : "");
  }

  showProblem({where, problem, remedy, line, source}) {
    const box = element("problem"), part = (tag, text, name = "") => Object.assign(document.createElement(tag), {textContent: text, className: name});
    const parts = [part("b", line === null ? "This scene cannot be run" : `Line ${line}`)];
    if (where) { parts.push(part("span", where)); }
    if (source) { parts.push(part("code", source)); }
    parts.push(part("p", problem));
    if (remedy) { parts.push(part("p", remedy, "remedy")); }
    box.replaceChildren(...parts);
    box.hidden = false;
  }

  /* Before a picture: what has come since the last one. */
  refresh() {
    const now = performance.now();
    if (this.unmarked && (now > this.marked + MARKS_PAUSE || this.doing === "done")) {
      this.unmarked = false;
      this.marked = now;
      this.timeline.readImpacts();
    }
    if (this.stale) { this.show(); }
    this.stage?.goOn();
  }

  show() {
    this.stale = false;
    if (this.nodes) {
      this.player.pose(this.nodes);
      this.arrows.arrows.show(this.player.time);
      this.softBodies.forEach((body) => body.show(this.player.frame, this.player.time));
    }
    this.bar.update();
    this.viewer.set_dirty();
  }
}

try {
  const page = new LivePage(), {player, viewer} = page;
  const draw = viewer.renderer.render.bind(viewer.renderer);
  viewer.renderer.render = (...scene) => {
    draw(...scene);
    page.pictures += 1;
  };
  /* For scripts and tests. */
  window.rigidimpulse = {
    page, player, viewer,
    get doing() { return page.doing; },
    get number() { return page.number; },
    pose: (name) => {
      const node = page.stage.nodes.get(name);
      return [...node.position.toArray(), ...node.quaternion.toArray()];
    },
    visibleArrows: () => page.arrows.arrows.visible,
    camera: () => [...viewer.camera.position.toArray(), ...viewer.controls.target.toArray()],
    onScreen: (name) => {
      const at = page.stage.nodes.get(name).getWorldPosition(new THREE.Vector3()).project(viewer.camera), box = viewer.renderer.domElement.getBoundingClientRect();
      return [box.left + ((at.x + 1) / 2) * box.width, box.top + ((1 - at.y) / 2) * box.height];
    },
  };
} catch (error) {
  element("failure").textContent = `This page could not be shown: ${error.message.replace(/\.$/, "")}. It needs a browser of 2023 or later, with WebGL.`;
  document.body.classList.add("bare");
  element("failure").hidden = false;
  throw error;
}
