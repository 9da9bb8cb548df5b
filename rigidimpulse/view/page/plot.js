/* How far the runs are apart, over time, on a logarithmic scale: the largest distance over all bodies as a line over a
   shade, the largest angle as a thin one, and those of one body in its colour. One scale of decades is read in m and in
   rad. What is not played yet is faint. A horizon is a dashed line, beyond which the plot is hatched. */

const PLOT_INK = "#1d2730", PLOT_SOFT = "#5b6873", BEYOND = "#a8590a";
const PREFIXES = ["f", "p", "n", "\u00b5", "m", "", "k", "M"]; // of 10^-15, 10^-12, ...
const LEAST_DECADES = 3, MOST_DECADES = 16;
const NOT_PLAYED = 0.32;
const PLOT_HEAD = 14, PLOT_FOOT = 12; // pixels above and below the scale

/* A figure with a prefix: "3.2 mm". */
function withUnit(value, unit) {
  if (!(value > 1e-18)) { return `0 ${unit}`; }
  const power = Math.min(Math.max(Math.floor(Math.log10(value * (1 + 1e-7)) / 3), -5), 2);
  return `${Number((value / Math.pow(1000, power)).toPrecision(2))} ${PREFIXES[power + 5]}${unit}`;
}

/* Largest value over all bodies, frame by frame; `values` holds body after body. */
function largestOf(values, numFrames) {
  const largest = new Float32Array(numFrames);
  for (let i = 0; i < values.length; i++) { largest[i % numFrames] = Math.max(largest[i % numFrames], values[i]); }
  return largest;
}

class Plot {
  constructor(canvas, times, names, distance, angle, horizon) {
    Object.assign(this, {canvas, times, horizon});
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
    const next = Math.min(frame + 1, this.times.length - 1), span = this.times[next] - this.times[frame];
    const share = span > 0 ? Math.min(Math.max((time - this.times[frame]) / span, 0), 1) : 0;
    const {distance, angle} = this.of(name);
    return [distance, angle].map((values) => values[frame] + share * (values[next] - values[frame]));
  }

  /* Fits the canvas to its box; the time axis runs from `left` to `right`, so that it lies over the bar's. */
  fit(left, right) {
    const scale = window.devicePixelRatio, width = this.canvas.clientWidth, height = this.canvas.clientHeight;
    this.canvas.width = Math.round(width * scale);
    this.canvas.height = Math.round(height * scale);
    Object.assign(this, {left, right, width, height, scale});
  }

  x(time) {
    const start = this.times[0], span = this.times[this.times.length - 1] - start;
    return this.left + (this.right - this.left) * (span > 0 ? (time - start) / span : 0);
  }

  timeAt(x) {
    const start = this.times[0], share = (x - this.left) / Math.max(this.right - this.left, 1);
    return start + Math.min(Math.max(share, 0), 1) * (this.times[this.times.length - 1] - start);
  }

  /* What is below the scale, zero above all, lies just out of sight. */
  y(value) {
    const power = value > 0 ? Math.log10(value) : -Infinity, low = this.height - PLOT_FOOT;
    if (power < this.bottom) { return low + 4; }
    return low - (low - PLOT_HEAD) * Math.min((power - this.bottom) / (this.top - this.bottom), 1);
  }

  draw(time, frame, focus, colour) {
    const pen = this.canvas.getContext("2d"), now = this.x(time);
    pen.setTransform(this.scale, 0, 0, this.scale, 0, 0);
    pen.clearRect(0, 0, this.width, this.height);
    if (this.same) { this.drawSame(pen); } else { this.drawScale(pen); }
    this.drawHorizon(pen, focus);
    for (const [from, to, strength] of [[0, now, 1], [now, this.width, NOT_PLAYED]]) {
      pen.save();
      pen.beginPath();
      pen.rect(from, 0, to - from, this.height - PLOT_FOOT + 1);
      pen.clip();
      pen.globalAlpha = strength;
      this.drawShade(pen);
      this.drawLine(pen, this.of(null).angle, PLOT_SOFT, 1);
      this.drawLine(pen, this.of(null).distance, PLOT_INK, focus === null ? 1.8 : 1);
      if (focus !== null) {
        this.drawLine(pen, this.of(focus).angle, colour, 1);
        this.drawLine(pen, this.of(focus).distance, colour, 2.4);
      }
      pen.restore();
    }
    this.drawCursor(pen, now, this.at(focus, frame, time)[0], focus === null ? PLOT_INK : colour);
  }

  drawScale(pen) {
    const decades = this.top - this.bottom, every = decades > 7 ? 3 : 1;
    pen.font = "10.5px system-ui, sans-serif";
    pen.textAlign = "right";
    pen.textBaseline = "middle";
    for (let power = this.bottom; power <= this.top; power++) {
      const labelled = power % every === 0, y = this.y(Math.pow(10, power));
      pen.fillStyle = `rgba(29, 39, 48, ${labelled ? 0.13 : 0.05})`;
      pen.fillRect(this.left, y - 0.5, this.right - this.left, 1);
      pen.fillStyle = PLOT_SOFT;
      if (labelled) { pen.fillText(withUnit(Math.pow(10, power), "m"), this.left - 7, y); }
    }
  }

  drawSame(pen) {
    pen.font = "13px system-ui, sans-serif";
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    pen.fillStyle = PLOT_SOFT;
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

  trace(pen, values) {
    pen.beginPath();
    for (let i = 0; i < values.length; i++) { pen.lineTo(this.x(this.times[i]), this.y(values[i])); }
  }

  drawLine(pen, values, colour, width) {
    pen.strokeStyle = colour;
    pen.lineWidth = width;
    pen.lineJoin = "round";
    this.trace(pen, values);
    pen.stroke();
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

  drawCursor(pen, now, distance, colour) {
    pen.fillStyle = "rgba(29, 39, 48, 0.6)";
    pen.fillRect(now - 0.5, 6, 1, this.height - 6);
    pen.fillStyle = colour;
    pen.strokeStyle = "#fff";
    pen.lineWidth = 1.5;
    pen.beginPath();
    pen.arc(now, Math.min(this.y(distance), this.height - PLOT_FOOT), 4, 0, 2 * Math.PI);
    pen.fill();
    pen.stroke();
  }
}
