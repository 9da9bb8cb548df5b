/* How far the runs are apart, over time, on a logarithmic scale: the largest distance over all bodies as a line over a
   shade, the largest angle as a thin one, and those of one body in its colour. One scale of decades is read in m and in
   rad. What is not played yet is faint. A horizon is a dashed line, beyond which the plot is hatched. */

const BEYOND = "#a8590a";
const LEAST_STEP = 13; // pixels a decade, with less only each third has a figure
const LEAST_DECADES = 3, MOST_DECADES = 16;

/* Largest value over all bodies, frame by frame; `values` holds body after body. */
function largestOf(values, numFrames) {
  const largest = new Float32Array(numFrames);
  for (let i = 0; i < values.length; i++) { largest[i % numFrames] = Math.max(largest[i % numFrames], values[i]); }
  return largest;
}

class DistancePlot extends TimePlot {
  constructor(canvas, times, names, distance, angle, horizon) {
    super(canvas, times);
    this.horizon = horizon;
    const count = times.length, part = (values, k) => values.subarray(k * count, (k + 1) * count);
    const all = {distance: largestOf(distance, count), angle: largestOf(angle, count)};
    const own = new Map(names.map((name, k) => [name, {distance: part(distance, k), angle: part(angle, k)}]));
    this.of = (name) => (name === null ? all : own.get(name));
    this.first = Math.min(...Object.values(horizon), Infinity);
    const positive = (values) => [...values].filter((value) => value > 0), both = [...positive(all.distance), ...positive(all.angle)];
    const seen = all.distance.some((value) => value > 0) ? positive(all.distance) : both; // angles of round-off would stretch the scale
    this.top = seen.length > 0 ? Math.ceil(Math.log10(both.reduce((a, b) => Math.max(a, b))) - 0.05) : 0;
    const low = seen.length > 0 ? Math.floor(Math.log10(seen.reduce((a, b) => Math.min(a, b)))) : -LEAST_DECADES;
    this.bottom = Math.min(Math.max(low, this.top - MOST_DECADES), this.top - LEAST_DECADES);
    this.same = seen.length === 0;
  }

  /* Horizon of a body, of all: the earliest; Infinity where there is none. */
  horizonOf(name) { return name === null ? this.first : this.horizon[name] ?? Infinity; }

  /* Values of a body, or the largest of all, at a time: on straight lines between frames. */
  at(name, frame, time) {
    const {distance, angle} = this.of(name);
    return [distance, angle].map((values) => this.valueAt(values, frame, time));
  }

  /* What is below the scale, zero above all, lies just out of sight. */
  y(value) {
    const power = value > 0 ? Math.log10(value) : -Infinity, low = this.height - PLOT_FOOT;
    if (power < this.bottom) { return low + 4; }
    return low - (low - PLOT_HEAD) * Math.min((power - this.bottom) / (this.top - this.bottom), 1);
  }

  draw(time, frame, focus, colour) {
    const pen = this.pen(this.canvas), now = this.x(time), own = focus === null ? theme.colour("ink") : colour;
    if (this.same) { this.drawSame(pen); } else { this.drawScale(pen); }
    this.drawHorizon(pen, focus);
    this.paintPlayed(pen, now, NOT_PLAYED, () => this.drawCurves(pen, focus, colour));
    this.drawCursor(pen, now);
    this.drawDot(pen, now, Math.min(this.y(this.at(focus, frame, time)[0]), this.height - PLOT_FOOT), own);
  }

  drawCurves(pen, focus, colour) {
    pen.beginPath();
    pen.rect(0, 0, this.width, this.height - PLOT_FOOT + 1); // what is below the scale is out of sight
    pen.clip();
    this.drawShade(pen);
    this.drawLine(pen, this.of(null).angle, theme.colour("soft"), 1);
    this.drawLine(pen, this.of(null).distance, theme.colour("ink"), focus === null ? 1.8 : 1);
    if (focus !== null) {
      this.drawLine(pen, this.of(focus).angle, colour, 1);
      this.drawLine(pen, this.of(focus).distance, colour, 2.4);
    }
  }

  drawScale(pen) {
    const step = (this.height - PLOT_HEAD - PLOT_FOOT) / (this.top - this.bottom), every = step < LEAST_STEP ? 3 : 1;
    for (let power = this.bottom; power <= this.top; power++) {
      const labelled = power % every === 0, y = this.y(Math.pow(10, power));
      pen.fillStyle = theme.ink(labelled ? 0.13 : 0.05);
      pen.fillRect(this.left, y - 0.5, this.right - this.left, 1);
      if (labelled) { this.drawFigure(pen, withUnit(Math.pow(10, power), "m"), y); }
    }
  }

  drawSame(pen) {
    pen.font = "13px system-ui, sans-serif";
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    pen.fillStyle = theme.colour("soft");
    pen.fillText("the runs are the same", (this.left + this.right) / 2, this.height / 2);
  }

  drawHorizon(pen, focus) {
    const end = this.times[this.times.length - 1], own = this.horizonOf(focus);
    for (const time of Object.values(this.horizon)) {
      if (time < end) {
        pen.fillStyle = "rgba(168, 89, 10, 0.55)";
        pen.fillRect(this.x(time) - 0.5, 8, 1, 6); // a tick for each body
      }
    }
    if (!(own < end)) { return; }
    const x = this.x(Math.max(own, this.times[0]));
    pen.save();
    pen.beginPath();
    pen.rect(x, 8, this.right - x, this.height - 16);
    pen.clip();
    pen.strokeStyle = "rgba(168, 89, 10, 0.13)";
    pen.lineWidth = 1;
    pen.beginPath();
    for (let at = x - this.height; at < this.right; at += 6) {
      pen.moveTo(at, this.height);
      pen.lineTo(at + this.height, 0);
    }
    pen.stroke();
    pen.restore();
    pen.strokeStyle = BEYOND;
    pen.setLineDash([3, 3]);
    pen.beginPath();
    pen.moveTo(x, 8);
    pen.lineTo(x, this.height - 8);
    pen.stroke();
    pen.setLineDash([]);
  }

  drawShade(pen) {
    const fade = pen.createLinearGradient(0, 0, 0, this.height);
    fade.addColorStop(0, "rgba(18, 115, 196, 0.34)");
    fade.addColorStop(1, "rgba(18, 115, 196, 0.02)");
    pen.fillStyle = fade;
    this.trace(pen, this.of(null).distance);
    pen.lineTo(this.right, this.height - PLOT_FOOT);
    pen.lineTo(this.left, this.height - PLOT_FOOT);
    pen.fill();
  }
}
