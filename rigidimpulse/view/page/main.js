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

async function main() {
  const manifest = JSON.parse(element("manifest").textContent);
  const viewer = new MeshCat.Viewer(element("meshcat-pane"));
  viewer.gui.domElement.style.display = "none";
  const stage = new Stage(viewer, manifest);
  stage.dress();
  const send = await readMessages(viewer);
  send((kind) => kind === "shape");
  const geometries = takeGeometries(viewer, manifest.numShapes);
  manifest.bodies.forEach((body) => stage.addBody(body, geometries));
  motionSource.animate(viewer, stage, send);
  send(() => true);

  const {times, rows, marks} = viewer.scene_tree.find(["impacts"]).object;
  const contactRows = viewer.scene_tree.find(["contacts"]).object.rows;
  const parts = {
    impacts: new ImpactArrows(rows, manifest.fade),
    contacts: manifest.contacts ? new ContactArrows(contactRows) : null,
    shapes: new SimulatedShapes(stage, manifest, geometries),
    softBodies: makeSoftBodies(viewer, manifest.softBodies, times),
  };
  viewer.set_object(["impacts"], parts.impacts.object);
  if (parts.contacts) { viewer.set_object(["contacts"], parts.contacts.object); }
  parts.softBodies.forEach((each) => stage.surfaces.push(each.surface));
  const transport = new Transport(viewer.animator, times, () => {
    parts.impacts.show(transport.time);
    parts.contacts?.show(transport.frame);
    parts.softBodies.forEach((each) => each.show(transport.frame, transport.time));
    parts.trails.show(transport.time);
    bar.update();
    parts.ledger?.show();
  });
  parts.trails = new Trails(viewer, stage, manifest, times);
  const bar = makeBar(transport, marks);
  if (manifest.ledger) {
    parts.ledger = new LedgerPanel(viewer, stage, transport, viewer.scene_tree.find(["ledger"]).object.curves,
      manifest.ledger.energySpan);
  }
  startViewing(viewer, stage, transport, bar, parts);
  expose(viewer, stage, transport, parts);
  element("summary").textContent = manifest.summary;
  showWarnings(manifest.warnings, transport);
  transport.seek(transport.start);
  transport.play();
}

function startViewing(viewer, stage, transport, bar, parts) {
  const layer = (label, key, set, on = true) => ({
    label, key, on, set: (shown) => { set(shown); viewer.set_dirty(); }});
  const folder = (name) => (shown) => { viewer.scene_tree.find([name]).object.visible = shown; };
  const {impacts, contacts, shapes, trails, ledger} = parts;
  const keys = makeLayers([
    layer("Bodies", "b", folder("bodies")),
    impacts.count > 0 && layer("Impacts", "i", folder("impacts")),
    contacts && layer("Contacts", "c", (on) => contacts.turn(on, transport.frame), false),
    trails.movers.length > 0 && layer("Trails", "r", (on) => trails.turn(on, transport.time), false),
    layer("Ground", "g", folder("ground")),
    shapes.differ && layer("As simulated", "s", (on) => shapes.turn(on), false),
    layer("Wireframe", "w", (on) => stage.surfaces.forEach((surface) => { surface.wireframe = on; }), false),
    layer("Track", "t", (on) => { stage.follow = on; }, stage.follow),
    ledger && layer("Plots", "p", (on) => ledger.turn(on), ledger.shown),
    layer("More", "m", (on) => {
      viewer.gui.domElement.style.display = on ? "" : "none";
      viewer.gui.open();
    }, false),
  ].filter(Boolean));
  keys.f = () => stage.frameAction();
  keys.l = bar.flipLoop;
  keys.u = () => document.body.classList.toggle("bare");
  keys["-"] = () => bar.changeSpeed(-1);
  keys["+"] = keys["="] = () => bar.changeSpeed(1);
  bindKeys(transport, keys);
  const render = viewer.render.bind(viewer);
  viewer.render = () => {
    stage.prepare();
    render();
  };
  stage.frameAction();
}

/* For scripts and tests. */
function expose(viewer, stage, transport, {impacts, contacts, shapes, trails, softBodies, ledger}) {
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
