/* Puts the page together: meshcat's viewer, the contents of the page, and the manifest that names them. */

function decode(base64) {
  const text = atob(base64.trim()), bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) { bytes[i] = text.charCodeAt(i); }
  return bytes;
}

async function unpack(base64) {
  const stream = new Blob([decode(base64)]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/* The page's messages: returns a function that lets the viewer have those of the kinds that a test picks. */
async function readMessages(viewer) {
  const scripts = [...document.querySelectorAll("script.command")];
  const messages = await Promise.all(scripts.map(async (script) => {
    const message = await unpack(script.textContent);
    script.textContent = ""; // it would be in memory twice
    return [script.dataset.kind, message];
  }));
  return (wanted) => messages.forEach((entry) => {
    if (entry[1] !== null && wanted(entry[0])) {
      viewer.handle_command_bytearray(entry[1]);
      entry[1] = null;
    }
  });
}

/* meshcat builds geometries from its own messages; we keep the geometries and make the meshes ourselves. */
function takeGeometries(viewer, count) {
  const geometries = [];
  for (let i = 0; i < count; i++) {
    geometries.push(viewer.scene_tree.find(["shapes", String(i), "<object>"]).object.geometry);
  }
  if (count > 0) { viewer.delete_path(["shapes"]); }
  return geometries;
}

/* What is in the scene besides its bodies, by name; null where the run has none. */
function makeParts(viewer, stage, manifest, geometries, times) {
  const found = (path) => viewer.scene_tree.find([path]).object, {rows} = found("impacts");
  const parts = {
    impacts: new ImpactArrows(rows, manifest.fade),
    contacts: manifest.contacts ? new ContactArrows(found("contacts").rows) : null,
    shapes: new SimulatedShapes(stage, manifest, geometries),
    joints: new Joints(stage, manifest),
    spins: new Spins(stage, manifest, found("spins").rows ?? new Float32Array(0), times),
    softBodies: makeSoftBodies(viewer, manifest.softBodies, times),
    marks: new Marks(viewer, stage, manifest.arrowScale, longestOf(rows)),
    trails: new Trails(viewer, stage, manifest, times),
  };
  for (const name of ["impacts", "contacts", "joints", "spins", "marks"]) {
    if (parts[name]) { viewer.set_object([name], parts[name].object); }
  }
  parts.softBodies.forEach((each) => stage.surfaces.push(each.surface));
  return parts;
}

/* Length of the longest arrow. */
function longestOf(rows) {
  let longest = 0;
  for (let i = 0; i < rows.length / ROW; i++) { longest = Math.max(longest, rows[i * ROW + 10]); }
  return longest;
}

async function main() {
  const manifest = JSON.parse(element("manifest").textContent);
  const viewer = new MeshCat.Viewer(element("meshcat-pane"));
  viewer.gui.domElement.remove();
  const stage = new Stage(viewer, manifest);
  stage.dress();
  const send = await readMessages(viewer);
  send((kind) => kind === "shape");
  const geometries = takeGeometries(viewer, manifest.numShapes);
  manifest.bodies.forEach((body) => stage.addBody(body, geometries));
  motionSource.animate(viewer, stage, send);
  send(() => true);

  const found = (path) => viewer.scene_tree.find([path]).object, {times, marks} = found("impacts"), cards = found("cards"), curves = found("ledger");
  const impacts = new Impacts(cards.keys, cards.rows, manifest);
  const parts = makeParts(viewer, stage, manifest, geometries, times);
  const transport = new Transport(viewer.animator, times, () => {
    const {time, frame} = transport;
    parts.impacts.show(time);
    parts.contacts?.show(frame);
    parts.softBodies.forEach((each) => each.show(frame, time));
    parts.trails.show(time);
    parts.joints.show(time);
    parts.spins.show(frame);
    bar.update();
    parts.ledger?.show();
  });
  const inspector = new Inspector(viewer, stage, transport, impacts, parts);
  const layout = () => {
    fitHeights();
    parts.ledger?.fit();
    stage.refit();
  };
  const spikes = impacts.complete ? makeSpikes(Array.from(impacts.times), impacts.heights())
    : binnedSpikes(marks, transport.start, transport.end, (from, to) => impacts.strongestIn(from, to));
  inspector.timeline = new Timeline(transport, spikes, (index) => inspector.select(index), layout);
  inspector.onLayout = layout;
  const bar = makeBar(transport, inspector.timeline);
  if (manifest.ledger) { parts.ledger = new LedgerPanel(viewer, stage, transport, curves, manifest.ledger.energySpan); }
  const header = showHeader(manifest, transport, layout);
  startViewing({viewer, stage, transport, bar, parts, inspector, header, layout});
  expose(viewer, stage, transport, {...parts, inspector, cards: impacts});
  transport.seek(transport.start);
  if (!reducedMotion) { transport.play(); }
}

const KEYS = [
  ["space", "play or pause"], ["\u2190 \u2192", "a frame back, on; with shift ten"], ["Home End", "start, end"], ["- +", "slower, faster"], ["L", "loop"],
  ["[ ]", "previous, next impact; also , and ."], ["Esc", "close the card"], ["F", "frame the action"], ["U", "hide everything but the picture"],
  ["D", "dark or light"], ["?", "these keys"],
];

function startViewing({viewer, stage, transport, bar, parts, inspector, header, layout}) {
  const layer = (label, key, set, on = true) => ({
    label, key, on, set: (shown) => { set(shown); viewer.set_dirty(); }});
  const folder = (name) => (shown) => { viewer.scene_tree.find([name]).object.visible = shown; };
  const {impacts, contacts, shapes, trails, ledger, joints, spins} = parts;
  const part = (name) => (on) => impacts.turnPart(name, on, transport.time);
  const keys = makeLayers([
    layer("Bodies", "b", folder("bodies")),
    impacts.count > 0 && layer("Impacts", "i", folder("impacts")),
    impacts.count > 0 && layer("Normal part", "n", part("normal"), false),
    impacts.count > 0 && layer("Friction part", "k", part("friction"), false),
    contacts && layer("Contacts", "c", (on) => contacts.turn(on, transport.frame), false),
    joints.count > 0 && layer("Joints", "j", folder("joints")),
    spins.count > 0 && layer("Angular velocity", "v", (on) => spins.turn("velocity", on, transport.frame), false),
    spins.count > 0 && layer("Angular momentum", "a", (on) => spins.turn("momentum", on, transport.frame), false),
    trails.movers.length > 0 && layer("Trails", "r", (on) => trails.turn(on, transport.time), false),
    layer("Ground", "g", folder("ground")),
    shapes.differ && layer("As simulated", "s", (on) => shapes.turn(on), false),
    layer("Wireframe", "w", (on) => stage.surfaces.forEach((surface) => { surface.wireframe = on; }), false),
    layer("Track", "t", (on) => { stage.follow = on; }, stage.follow),
  ].filter(Boolean));
  if (ledger) {
    element("plots-button").hidden = false;
    keys.p = makeSwitch(element("plots-button"), (on) => ledger.turn(on), ledger.shown);
  }
  keys.f = () => stage.frameAction();
  keys.l = bar.flipLoop;
  keys.u = () => { document.body.classList.toggle("bare"); layout(); };
  keys.d = () => theme.set(!theme.dark);
  keys["?"] = header.help;
  keys["-"] = () => bar.changeSpeed(-1);
  keys["+"] = keys["="] = () => bar.changeSpeed(1);
  keys["["] = keys[","] = () => inspector.step(-1);
  keys["]"] = keys["."] = () => inspector.step(1);
  keys.Escape = () => inspector.select(-1);
  bindKeys(transport, keys);
  showKeys(KEYS);
  const render = viewer.render.bind(viewer);
  viewer.render = () => {
    stage.prepare();
    parts.marks.show();
    render();
  };
  inspector.bindScene();
  window.addEventListener("resize", layout);
  layout();
}

/* For scripts and tests. */
function expose(viewer, stage, transport, {impacts, contacts, shapes, trails, softBodies, ledger, joints, spins, inspector, cards}) {
  window.rigidimpulse = {
    get time() { return transport.time; },
    get frame() { return transport.frame; },
    get playing() { return transport.playing; },
    get speed() { return transport.speed; },
    duration: transport.end - transport.start,
    play: () => transport.play(),
    pause: () => transport.pause(),
    seek: (time) => transport.seek(time),
    pose: (name) => {
      const node = stage.nodes.get(name);
      return [...node.position.toArray(), ...node.quaternion.toArray()];
    },
    vertices: (number) => [...softBodies[number].geometry.attributes.position.array],
    visibleArrows: () => (impacts.object.parent.visible ? impacts.visible : []),
    contacts: () => (contacts?.shown ? contacts.visible : []),
    trail: (name) => trails.path(name),
    simulated: () => shapes.shown,
    ledger,
    viewer,
    room: freeRoom,
    camera: () => viewer.camera.position.toArray(),
    joints: () => joints.shapes.map(({entry, object}) => ({name: entry.name, kind: entry.kind, shown: object.visible})),
    spin: (name, kind, frame) => spins[kind](spins.entries.findIndex((entry) => entry.name === name), frame).toArray(),
    impact: {
      get selected() { return inspector.selected; },
      count: cards.count,
      select: (index) => inspector.select(index),
      get: (index) => cards.get(index),
      groups: () => inspector.timeline.line.groups.map((group) => group.map(({time, x, index, count}) => ({time, x, index, count}))),
      strip: () => (inspector.timeline.strip?.groups ?? []).map((group) => group.map(({time, x, index, count}) => ({time, x, index, count}))),
    },
  };
}

main().catch((error) => {
  const reason = error.message.replace(/\.$/, "");
  element("failure").textContent =
    `This page could not be shown: ${reason}. It needs a browser of 2023 or later, with WebGL.`;
  document.body.classList.add("bare");
  element("failure").hidden = false;
  throw error;
});
