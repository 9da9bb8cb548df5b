/* A panel of plots above the bar: a click goes to a time, dragging scrubs, and the picture becomes smaller for it. */

const ROOM_ABOVE = 0.07, ROOM_BELOW = 0.015; // of the window: left free at its top, and above the panel

class Panel {
  constructor(viewer, stage, transport, id, content) {
    Object.assign(this, {viewer, stage, transport, shown: true, plots: []});
    this.section = document.createElement("section");
    this.section.id = id;
    this.section.className = "panel";
    this.section.innerHTML = content;
    document.body.insertBefore(this.section, document.querySelector("footer"));
  }

  /* When the plots are there. */
  open(plots) {
    this.plots = plots;
    for (const plot of plots) { bindScrub(plot, this.transport); }
    this.liftPicture();
    window.addEventListener("resize", () => this.fit());
    this.fit();
  }

  /* Shows or hides it. The camera stays where people have put it; only the middle of the picture moves. */
  turn(on) {
    this.shown = on;
    this.section.hidden = !on;
    this.fit();
  }

  /* The camera looks at the action in the middle of what panel and bar leave free. */
  liftPicture() {
    const stage = this.stage, camera = this.viewer.camera, frame = stage.frameAction.bind(stage);
    stage.frameAction = () => {
      frame();
      const target = this.viewer.controls.target, back = camera.position.clone().sub(target), distance = back.length();
      const over = new THREE.Vector3(0, 1, 0).projectOnPlane(back.normalize()).normalize();
      const tall = Math.tan((camera.fov * Math.PI) / 360), middle = stage.follow ? target : stage.centre;
      const heights = stage.framing.outline.map((point) => { // of half the window above its middle
        const from = new THREE.Vector3().fromArray(point).add(middle).sub(target);
        return from.dot(over) / (tall * (distance - from.dot(back)));
      });
      const at = 0.5 - 0.5 * this.share, free = this.section.offsetTop / window.innerHeight; // where the middle is seen, from the top
      const above = 2 * (at - ROOM_ABOVE), below = 2 * (free - ROOM_BELOW - at);
      const further = this.shown ? Math.max(Math.max(...heights) / above, -Math.min(...heights) / below, 1) : 1;
      camera.position.copy(target).addScaledVector(back, further * distance);
    };
    camera.view = {enabled: true, fullWidth: 1, fullHeight: 1, offsetX: 0, offsetY: 0, width: 1, height: 1};
  }

  get share() { return Math.min(this.section.offsetHeight / window.innerHeight, 0.4); }

  fit() {
    this.viewer.camera.view.offsetY = 0.5 * this.share; // nothing of a panel that is hidden
    const marks = element("marks").getBoundingClientRect(), box = this.section.getBoundingClientRect();
    this.section.style.setProperty("--after", `${Math.round(box.right - marks.right)}px`);
    for (const plot of this.shown ? this.plots : []) {
      const canvas = plot.canvas.getBoundingClientRect();
      plot.fit(marks.left + TIMELINE_END - canvas.left, marks.right - TIMELINE_END - canvas.left);
    }
    this.fitted = element("marks").clientWidth;
    this.show();
  }

  /* Fits the panel again where the clock beside the bar has grown. */
  keepFitted() {
    if (element("marks").clientWidth !== this.fitted) { this.fit(); }
  }
}

/* A click on a plot goes to its time, and so does every place that a pressed pointer is dragged over. */
function bindScrub(plot, transport) {
  const seek = (event) => transport.seek(plot.timeAt(event.clientX - plot.canvas.getBoundingClientRect().left));
  plot.canvas.addEventListener("pointerdown", (event) => {
    plot.canvas.setPointerCapture(event.pointerId);
    seek(event);
  });
  plot.canvas.addEventListener("pointermove", (event) => { if (event.buttons & 1) { seek(event); } });
}
