/* The bar of the live page: time line with the part that is computed, and the buttons. */

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4];

function element(id) { return document.getElementById(id); }

class LiveTimeline extends Timeline {
  setMarks(marks) {
    Object.assign(this, {bins: marks.length / 2, counts: marks.subarray(0, marks.length / 2), heights: marks.subarray(marks.length / 2), stale: true});
  }

  /* As on the recorded page, in the colours of this one, and with what is computed of the run as a second line below. */
  draw(time, head) {
    this.fitIfChanged();
    const pen = this.pen(this.canvas), now = this.x(time), {middle, left, right} = this, style = getComputedStyle(document.body);
    const ink = style.getPropertyValue("--ink");
    this.copyLayer(pen, now, 0.45);
    pen.lineCap = "round";
    for (const [colour, strength, from, to, y, width] of [
      [ink, 0.18, left, right, middle, 3], [ink, 1, left, now, middle, 3],
      ...(head < this.times[this.times.length - 1] ? [[style.getPropertyValue("--accent"), 0.7, left, this.x(head), middle + 7, 2]] : []),
    ]) {
      Object.assign(pen, {strokeStyle: colour, globalAlpha: strength, lineWidth: width});
      pen.beginPath();
      pen.moveTo(from, y);
      pen.lineTo(to, y);
      pen.stroke();
    }
    pen.globalAlpha = 1;
    pen.fillStyle = ink;
    pen.beginPath();
    pen.arc(now, middle, 6, 0, 2 * Math.PI);
    pen.fill();
  }
}

class Bar {
  constructor(player, arrows) {
    Object.assign(this, {player, arrows, timeline: null});
    const press = (id, action) => element(id).addEventListener("click", () => {
      action();
      element(id).blur(); // so that the space bar plays instead of pressing it again
    });
    press("play", () => (player.playing ? player.pause() : player.play()));
    press("restart", () => this.restart());
    press("back", () => this.toImpact(-1));
    press("next", () => this.toImpact(1));
    press("loop", () => this.flipLoop());
    element("scrubber").addEventListener("input", (event) => player.seek(Number(event.target.value)));
    for (const speed of SPEEDS) { element("speed").add(new Option(`${speed}\u00d7`, speed, speed === 1, speed === 1)); }
    element("speed").addEventListener("change", (event) => {
      player.speed = Number(event.target.value);
      event.target.blur();
    });
    window.addEventListener("resize", () => this.update());
    window.addEventListener("keydown", (event) => this.onKey(event));
    this.keys = {
      " ": () => (player.playing ? player.pause() : player.play()),
      ArrowLeft: (event) => player.step(event.shiftKey ? -10 : -1),
      ArrowRight: (event) => player.step(event.shiftKey ? 10 : 1),
      "[": () => this.toImpact(-1), "]": () => this.toImpact(1), r: () => this.restart(), l: () => this.flipLoop(),
      u: () => document.body.classList.toggle("bare"),
    };
  }

  begin() {
    this.timeline = new LiveTimeline(element("marks"), this.player.times, new Float32Array(2));
    element("scrubber").max = this.player.end;
  }

  setMarks() { this.timeline.setMarks(this.arrows.marks(this.player.end)); }

  restart() {
    this.player.seek(0);
    this.player.play();
  }

  toImpact(way) {
    const time = this.arrows.beside(this.player.time, way);
    this.player.pause();
    if (time !== undefined) { this.player.seek(time); }
  }

  flipLoop() {
    this.player.loop = !this.player.loop;
    element("loop").setAttribute("aria-pressed", String(this.player.loop));
  }

  onKey(event) {
    const typing = event.target.tagName === "SELECT" || (event.target.tagName === "INPUT" && event.target.id !== "scrubber");
    const action = this.keys[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!action || event.ctrlKey || event.metaKey || event.altKey || (typing && event.key !== " ")) { return; }
    event.preventDefault();
    action(event);
  }

  update() {
    const {player} = this;
    element("scrubber").value = player.time;
    element("play").classList.toggle("playing", player.playing);
    element("clock").innerHTML = `${player.time.toFixed(2)} s<small>frame ${player.frame} / ${player.total - 1}</small>`;
    this.timeline?.draw(player.time, player.head);
  }
}
