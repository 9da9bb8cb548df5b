/* A panel of plots above the bar: a click goes to a time, dragging scrubs, and the picture becomes smaller for it. */

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
    theme.listeners.push(() => this.fit());
    window.addEventListener("resize", () => this.fit());
    this.fit();
  }

  /* Shows or hides it. */
  turn(on) {
    this.shown = on;
    this.section.hidden = !on;
    this.fit();
    this.stage.refit();
  }

  fit() {
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
