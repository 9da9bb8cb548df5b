/* Bodies are thrown: press on one, drag, let go. The arrow that is dragged is the velocity: its length in metres over `THROW_TIME`. */

const THROW_TIME = 0.25; // s
const LEAST_DRAG = 6; // pixels, below which it is only a click

class Thrower {
  constructor(stage, player, send) {
    Object.assign(this, {stage, player, send, dynamic: new Set(), held: null, ray: new THREE.Raycaster()});
    this.canvas = stage.viewer.renderer.domElement;
    this.arrow = new ImpactArrows(new Float32Array(ROW), 1); // one of those of impacts, at the time 0
    this.arrow.object.visible = false;
    stage.viewer.set_object(["throw"], this.arrow.object);
    // Before the camera's own controls hear of it.
    const pane = this.canvas.parentElement;
    pane.addEventListener("pointerdown", (event) => this.press(event), true);
    window.addEventListener("pointermove", (event) => this.drag(event), true);
    window.addEventListener("pointerup", (event) => this.release(event), true);
    window.addEventListener("pointercancel", () => this.drop(), true);
    window.addEventListener("keydown", (event) => { if (event.key === "Escape") { this.drop(); } });
  }

  aim(event) {
    const box = this.canvas.getBoundingClientRect(), at = new THREE.Vector2(
      (2 * (event.clientX - box.left)) / box.width - 1, 1 - (2 * (event.clientY - box.top)) / box.height);
    this.ray.setFromCamera(at, this.stage.viewer.camera);
  }

  /* The dynamic body under the pointer, and where on it. */
  pick(event) {
    this.stage.viewer.scene.updateMatrixWorld(); // there may have been no picture since bodies and camera moved
    this.aim(event);
    const nameOf = new Map([...this.stage.meshOf].map(([name, mesh]) => [mesh, name]));
    const hit = this.ray.intersectObjects([...nameOf.keys()], false)[0];
    return hit && this.dynamic.has(nameOf.get(hit.object)) ? {body: nameOf.get(hit.object), point: hit.point} : null;
  }

  press(event) {
    const found = event.button === 0 ? this.pick(event) : null;
    if (!found) { return; }
    event.preventDefault();
    event.stopPropagation();
    this.stage.viewer.controls.enabled = false;
    const back = this.stage.viewer.camera.getWorldDirection(new THREE.Vector3());
    this.held = {...found, playing: this.player.playing, x: event.clientX, y: event.clientY, velocity: new THREE.Vector3(),
      plane: new THREE.Plane().setFromNormalAndCoplanarPoint(back, found.point)};
    this.player.pause();
  }

  drag(event) {
    if (!this.held) { return; }
    const {held} = this, to = new THREE.Vector3();
    this.aim(event);
    held.moved ||= Math.hypot(event.clientX - held.x, event.clientY - held.y) >= LEAST_DRAG;
    if (!held.moved || !this.ray.ray.intersectPlane(held.plane, to)) { return; }
    const way = this.stage.recorded(to.sub(held.point)), length = way.length();
    held.velocity.copy(way).divideScalar(THROW_TIME);
    way.normalize();
    this.arrow.rows.set([0, ...this.stage.recorded(held.point).toArray(), ...way.toArray(), ...way.toArray(), length, -1]);
    this.arrow.show(0);
    this.arrow.object.visible = true;
    const label = element("throw");
    label.hidden = false;
    label.textContent = `${held.body}  ${Number(held.velocity.length().toPrecision(3))}\u2009m/s`;
    Object.assign(label.style, {left: `${event.clientX}px`, top: `${event.clientY}px`});
    this.stage.viewer.set_dirty();
  }

  release(event) {
    if (!this.held) { return; }
    this.drag(event);
    const {body, moved, velocity, playing} = this.held;
    this.drop();
    if (moved) {
      this.send({do: "throw", body, time: this.player.times[this.player.frame], velocity: velocity.toArray()});
      this.player.play();
    } else if (playing) {
      this.player.play();
    }
  }

  drop() {
    this.held = null;
    this.arrow.object.visible = false;
    element("throw").hidden = true;
    this.stage.viewer.controls.enabled = true;
    this.stage.viewer.set_dirty();
  }
}
