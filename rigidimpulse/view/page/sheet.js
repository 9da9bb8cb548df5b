/* A contact sheet: cards with a picture each, all drawn by one renderer into the places that the cards leave for it. */

const FIELD_OF_VIEW = 30; // degrees, up and down
const MARGIN = 1.16;
const SHADOW_SIZE = 512;
const SHORT = 32767;
const GROUND_REACH = 7; // in radii of the action
const HOLD = 0.8; // s that the last frame stays before all begin again

const index = JSON.parse(document.getElementById("index").textContent);
const state = {time: 0, playing: true, hold: 0, sort: "", rising: true, drawn: 0};

/* The picture of one run: its bodies, posed at any time. */
class Picture {
  constructor(motion, buffer, geometries, sheet) {
    this.times = motion.times;
    this.position = new Float32Array(buffer, ...motion.position);
    this.quaternion = new Int16Array(buffer, ...motion.quaternion);
    this.tracks = motion.bodies.filter((body) => body.track >= 0).length;
    this.group = new THREE.Group();
    this.moving = [];
    for (const body of motion.bodies) {
      const node = new THREE.Group();
      node.position.fromArray(body.position);
      node.quaternion.fromArray(body.quaternion);
      if (body.shape >= 0) {
        const mesh = new THREE.Mesh(geometries[body.shape], sheet.surface(body.surface, geometries[body.shape]));
        mesh.castShadow = mesh.receiveShadow = true;
        node.add(mesh);
      }
      for (const plane of body.planes) { node.add(sheet.ground(plane)); }
      if (body.track >= 0) { this.moving[body.track] = node; }
      this.group.add(node);
    }
  }

  pose(time) {
    const times = this.times;
    let low = 0, high = times.length - 1;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (times[middle] <= time) { low = middle; } else { high = middle; }
    }
    const share = times.length > 1 ? Math.min(Math.max((time - times[low]) / (times[high] - times[low]), 0), 1) : 0;
    const from = new THREE.Quaternion(), to = new THREE.Quaternion();
    this.moving.forEach((node, k) => {
      const a = low * this.tracks + k, b = high * this.tracks + k;
      for (const [axis, name] of ["x", "y", "z"].entries()) {
        node.position[name] = (1 - share) * this.position[3 * a + axis] + share * this.position[3 * b + axis];
      }
      from.set(...this.quaternion.subarray(4 * a, 4 * a + 4)).normalize();
      to.set(...this.quaternion.subarray(4 * b, 4 * b + 4)).normalize();
      node.quaternion.copy(from).slerp(to, share);
    });
  }
}

class Sheet {
  constructor(buffer) {
    const framing = index.framing;
    this.radius = new THREE.Vector3().fromArray(framing.half).length();
    this.turn = new THREE.Quaternion().fromArray(framing.stage);
    this.centre = new THREE.Vector3().fromArray(framing.centre);
    this.renderer = new THREE.WebGLRenderer({canvas: document.getElementById("pictures"), antialias: true, alpha: true});
    dressRenderer(this.renderer);
    this.renderer.shadowMap.enabled = true;
    this.renderer.setScissorTest(true);
    this.renderer.setClearAlpha(0);
    this.surfaces = new Map();
    this.scene = new THREE.Scene();
    this.scene.add(makeSky());
    this.stage = new THREE.Group();
    this.stage.quaternion.copy(this.turn);
    this.scene.add(this.stage);
    const light = makeKeyLight(this.turn, this.centre.clone().applyQuaternion(this.turn.clone().invert()), 1.35 * this.radius);
    light.shadow.mapSize.set(SHADOW_SIZE, SHADOW_SIZE);
    light.shadow.normalBias *= 4;
    this.stage.add(light, light.target);
    this.camera = new THREE.PerspectiveCamera(FIELD_OF_VIEW, 1.6, 0.01 * this.radius, 60 * this.radius);
    const geometries = index.shapes.map((shape) => makeGeometry(buffer, shape));
    this.cards = index.cards.map((card) => ({...card,
      picture: card.motion ? new Picture(card.motion, buffer, geometries, this) : null, element: makeCard(card)}));
    this.duration = Math.max(0, ...this.cards.map((card) => (card.picture ? card.picture.times[card.picture.times.length - 1] : 0)));
    this.aim();
  }

  surface(surface, geometry) {
    const key = JSON.stringify(surface);
    if (!this.surfaces.has(key)) { this.surfaces.set(key, makeSurface(surface, geometry)); }
    return this.surfaces.get(key);
  }

  ground([x, y, z, offset, colour]) {
    const spacing = this.radius / 3, ground = makeGround(spacing, GROUND_REACH * this.radius, 1), normal = new THREE.Vector3(x, y, z);
    ground.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), normal);
    ground.position.copy(normal).multiplyScalar(offset);
    if (colour) { ground.paint(colour, darker(colour)); }
    return ground;
  }

  /* The nearest place from which the camera sees the whole outline of all runs. */
  aim() {
    const back = new THREE.Vector3().fromArray(index.framing.view), tall = Math.tan((FIELD_OF_VIEW * Math.PI) / 360);
    const {target, distance} = nearestView(index.framing.outline, back, tall, tall * this.camera.aspect, MARGIN, 3 * this.radius);
    target.add(this.centre);
    this.camera.position.copy(target).addScaledVector(back, distance);
    this.camera.lookAt(target);
  }

  /* Draws the cards that can be seen. */
  draw(time) {
    const renderer = this.renderer, width = window.innerWidth, height = window.innerHeight;
    const size = renderer.getSize(new THREE.Vector2());
    if (size.x !== width || size.y !== height) { renderer.setSize(width, height, false); }
    renderer.setScissor(0, 0, width, height);
    renderer.setViewport(0, 0, width, height);
    renderer.clear();
    const top = document.querySelector("header").getBoundingClientRect().bottom;
    state.drawn = 0;
    for (const {picture, element} of this.cards) {
      const place = element.firstElementChild.getBoundingClientRect();
      if (!picture || place.bottom <= top || place.top >= height) { continue; }
      picture.pose(time);
      this.stage.add(picture.group);
      const visible = Math.max(place.top, top);
      renderer.setViewport(place.left, height - place.bottom, place.width, place.height);
      renderer.setScissor(place.left, height - place.bottom, place.width, place.bottom - visible);
      renderer.render(this.scene, this.camera);
      this.stage.remove(picture.group);
      state.drawn++;
    }
  }

  arrange() {
    const value = (card) => (state.sort in card.parameters ? card.parameters[state.sort] : card.measures[state.sort] ?? Infinity);
    const ordered = [...this.cards];
    if (state.sort) {
      ordered.sort((a, b) => (value(a) < value(b) ? -1 : value(a) > value(b) ? 1 : 0));
    }
    if (!state.rising) { ordered.reverse(); }
    document.getElementById("cards").append(...ordered.map((card) => card.element));
    for (const each of document.querySelectorAll("[data-name]")) { each.classList.toggle("sorted", each.dataset.name === state.sort); }
  }
}

function figure(value) {
  return typeof value === "number" ? String(Number(value.toPrecision(4))) : String(value);
}

/* The last word of a parameter's name, where that tells it from the others. */
function shortName(name) {
  const last = (text) => text.split(".").pop(), all = Object.keys(index.cards[0].parameters);
  return all.filter((other) => last(other) === last(name)).length === 1 ? last(name) : name;
}

function makeElement(kind, className, text) {
  const element = document.createElement(kind);
  element.className = className;
  element.textContent = text;
  return element;
}

function makeCard(card) {
  const element = makeElement(card.page ? "a" : "div", `card ${card.outcome}`, "");
  if (card.page) { element.href = card.page; }
  element.title = card.message;
  const lines = {parameters: makeElement("p", "parameters", ""), measures: makeElement("p", "measures", "")};
  lines.parameters.append(makeElement("span", "number", card.name));
  for (const [kind, line] of Object.entries(lines)) {
    for (const [name, value] of Object.entries(card[kind])) {
      const item = makeElement("span", "", kind === "parameters" ? `${shortName(name)} ${figure(value)}` : `${figure(value)} ${name}`);
      item.dataset.name = name;
      line.append(item);
    }
  }
  const told = makeElement("div", "told", "");
  told.append(lines.parameters, lines.measures, makeElement("p", "final", card.final));
  element.append(makeElement("div", "picture", card.motion ? "" : card.message), told);
  return element;
}

function wire(sheet) {
  const at = (name) => document.getElementById(name);
  const names = new Set(sheet.cards.flatMap((card) => [...Object.keys(card.parameters), ...Object.keys(card.measures)]));
  at("sort").append(new Option("number", ""), ...[...names].map((name) => new Option(name, name)));
  at("sort").onchange = () => { state.sort = at("sort").value; sheet.arrange(); };
  at("order").onclick = () => {
    state.rising = !state.rising;
    at("order").innerHTML = state.rising ? "&uarr;" : "&darr;";
    sheet.arrange();
  };
  at("size").oninput = () => at("cards").style.setProperty("--size", `${at("size").value}px`);
  const play = (playing) => {
    state.playing = playing;
    at("play").classList.toggle("playing", playing);
  };
  play(!window.matchMedia("(prefers-reduced-motion: reduce)").matches);
  at("play").onclick = () => play(!state.playing);
  at("scrubber").max = sheet.duration;
  at("scrubber").oninput = () => { play(false); state.time = Number(at("scrubber").value); };
  document.addEventListener("keydown", (event) => {
    if (event.key === " " && event.target === document.body) { event.preventDefault(); play(!state.playing); }
  });
  const outcomes = ["ok", "reported", "failed"].map((outcome) => [sheet.cards.filter((card) => card.outcome === outcome).length, outcome]);
  at("summary").textContent = `${sheet.cards.length} takes  \u00b7  ${outcomes.filter(([count]) => count > 0)
    .map(([count, outcome]) => `${count} ${outcome}`).join("  \u00b7  ")}  \u00b7  ${figure(sheet.duration)} s`;
}

function turnOver(sheet) {
  let before = performance.now();
  const step = (now) => {
    const passed = Math.min((now - before) / 1000, 0.1);
    before = now;
    if (state.playing && state.time >= sheet.duration) {
      state.hold += passed;
      if (state.hold > HOLD) { state.time = state.hold = 0; }
    } else if (state.playing) {
      state.time = Math.min(state.time + passed, sheet.duration);
    }
    document.getElementById("scrubber").value = state.time;
    document.getElementById("clock").textContent = `${state.time.toFixed(2)} s`;
    sheet.draw(state.time);
    requestAnimationFrame(step);
  };
  requestAnimationFrame(step);
}

readBlock(document.getElementById("block").textContent).then((buffer) => {
  const sheet = new Sheet(buffer);
  sheet.arrange();
  wire(sheet);
  turnOver(sheet);
  window.rigidimpulse = {cards: sheet.cards, state, draw: (time) => sheet.draw(time)};
}).catch((error) => {
  const failure = document.getElementById("failure");
  failure.hidden = false;
  failure.textContent = `This page cannot be shown: ${error.message}`;
  throw error;
});
