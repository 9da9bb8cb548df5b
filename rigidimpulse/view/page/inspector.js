/* One impact is selected at a time: by a click on its spike, its arrow or a body, by buttons or by keys. The card follows it. */

const PICK = 11; // pixels from an arrow at which a click is meant for it
const CLICK_MOVE = 4; // pixels that a pointer may move in a click

class Inspector {
  constructor(viewer, stage, transport, impacts, parts) {
    Object.assign(this, {viewer, stage, transport, impacts, parts, selected: -1, picks: true});
    this.card = element("impact");
    for (const [id, step] of [["previous", -1], ["next", 1], ["card-previous", -1], ["card-next", 1]]) {
      element(id).hidden = impacts.count === 0;
      element(id).addEventListener("click", () => this.step(step));
    }
    element("card-close").addEventListener("click", () => this.select(-1));
  }

  get open() { return this.selected >= 0; }

  /* Selects an impact and goes to its time; -1 closes the card. */
  select(index) {
    const was = this.open;
    this.selected = index;
    this.card.hidden = index < 0;
    document.body.classList.toggle("has-card", index >= 0);
    this.timeline.select(index);
    if (index >= 0) {
      this.transport.pause();
      this.transport.seek(this.impacts.times[index]);
      this.fill();
    }
    this.parts.impacts.leaveOut(index, this.transport.time);
    this.parts.marks.choose(index < 0 ? null : this.impacts.get(index));
    if (was !== this.open) { this.onLayout(); }
    this.viewer.set_dirty();
  }

  fill() {
    const {impacts, selected} = this, impact = impacts.get(selected), kept = impacts.count.toLocaleString("en");
    const all = impacts.complete ? kept : `the ${kept} strongest`;
    const place = `Impact ${(selected + 1).toLocaleString("en")} of ${all}, at ${digits(impact.time)} s`;
    const others = impacts.times.filter((time) => time === impact.time).length - 1;
    fillCard(this.card, impact, place, others);
    element("card-previous").disabled = selected === 0;
    element("card-next").disabled = selected === impacts.count - 1;
    element("announce").textContent = `${place}: ${impactTitle(impact)}, ${digits(impact.impulse)} newton seconds`;
  }

  /* The impact before or after the one selected, or after the present time. */
  step(by) {
    const {impacts} = this, last = impacts.lastAt(this.transport.time);
    const from = this.open ? this.selected + by : by > 0 ? last + 1 : last;
    if (impacts.count > 0) { this.select(Math.min(Math.max(from, 0), impacts.count - 1)); }
  }

  /* A click in the scene: on an arrow its impact, on a body the one of its impacts nearest in time. */
  pick(x, y) {
    const arrow = this.parts.impacts.at(x, y, this.viewer, PICK);
    if (arrow && arrow.card >= 0) { return this.select(arrow.card); }
    const name = this.bodyAt(x, y), index = name === null ? -1 : this.impacts.nearestOf(name, this.transport.time);
    if (index >= 0) { this.select(index); } else if (name !== null) { element("announce").textContent = `${name} has no impacts in this run`; }
  }

  bodyAt(x, y) {
    const ray = new THREE.Raycaster();
    ray.setFromCamera(new THREE.Vector2((2 * x) / window.innerWidth - 1, 1 - (2 * y) / window.innerHeight), this.viewer.camera);
    const names = [...this.stage.meshOf.keys()], meshes = names.map((name) => this.stage.meshOf.get(name));
    const [hit] = ray.intersectObjects(meshes, false);
    return hit ? names[meshes.indexOf(hit.object)] : null;
  }

  /* Clicks and hovering in the scene, unless `picks` is off: a page may have clicks of its own. */
  bindScene() {
    const pane = element("meshcat-pane");
    let pressed = null;
    pane.addEventListener("pointerdown", (event) => { pressed = [event.clientX, event.clientY]; }, true);
    window.addEventListener("pointerup", (event) => {
      const near = pressed && Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) < CLICK_MOVE;
      pressed = null;
      if (this.picks && near && pane.contains(event.target)) { this.pick(event.clientX, event.clientY); }
    });
    pane.addEventListener("pointermove", (event) => {
      if (this.picks && event.buttons === 0) { this.parts.marks.hover(this.parts.impacts.at(event.clientX, event.clientY, this.viewer, PICK), this.impacts); }
    });
    pane.addEventListener("pointerleave", () => this.parts.marks.hover(null, this.impacts));
  }
}
