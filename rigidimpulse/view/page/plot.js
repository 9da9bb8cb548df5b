/* Plots over time whose axis lies over that of the bar. What does not change with time is drawn once, on a layer of its own;
   with each picture it is copied, faintly where it is not played yet, and the cursor comes on top. */

const PREFIXES = ["f", "p", "n", "\u00b5", "m", "", "k", "M", "G"]; // of 10^-15, 10^-12, ...
const NOT_PLAYED = 0.32;
const ROOM_FOR_FIGURES = 52; // pixels beside a plot, without which the figures of its scale are in it
const PLOT_HEAD = 14, PLOT_FOOT = 12; // pixels above and below the scale

/* A figure with a prefix: "3.2 mm". */
function withUnit(value, unit, digits = 2) {
  const size = Math.abs(value);
  if (!(size > 1e-18)) { return `0 ${unit}`; }
  const power = Math.min(Math.max(Math.floor(Math.log10(size * (1 + 1e-7)) / 3), -5), 3);
  const figure = String(Number((value / Math.pow(1000, power)).toPrecision(digits)));
  return `${figure.replace("-", "\u2212")} ${PREFIXES[power + 5]}${unit}`;
}

class TimePlot {
  constructor(canvas, times) {
    Object.assign(this, {canvas, times, layer: document.createElement("canvas"), stale: true});
  }

  /* Fits the canvas to its box; the time axis runs from `left` to `right`. */
  fit(left, right) {
    const scale = window.devicePixelRatio, width = this.canvas.clientWidth, height = this.canvas.clientHeight;
    for (const canvas of [this.canvas, this.layer]) {
      canvas.width = Math.round(width * scale);
      canvas.height = Math.round(height * scale);
    }
    Object.assign(this, {left, right, width, height, scale, stale: true});
  }

  x(time) {
    const start = this.times[0], span = this.times[this.times.length - 1] - start;
    return this.left + (this.right - this.left) * (span > 0 ? (time - start) / span : 0);
  }

  timeAt(x) {
    const start = this.times[0], share = (x - this.left) / Math.max(this.right - this.left, 1);
    return start + Math.min(Math.max(share, 0), 1) * (this.times[this.times.length - 1] - start);
  }

  /* Share of the way from a frame to the next one at a time. */
  shareAt(frame, time) {
    const next = Math.min(frame + 1, this.times.length - 1), span = this.times[next] - this.times[frame];
    return span > 0 ? Math.min(Math.max((time - this.times[frame]) / span, 0), 1) : 0;
  }

  valueAt(values, frame, time) {
    const next = Math.min(frame + 1, this.times.length - 1);
    return values[frame] + this.shareAt(frame, time) * (values[next] - values[frame]);
  }

  pen(canvas) {
    const pen = canvas.getContext("2d");
    pen.setTransform(this.scale, 0, 0, this.scale, 0, 0);
    pen.clearRect(0, 0, this.width, this.height);
    return pen;
  }

  /* Calls `paint(pen)` for the part that is played, then, with a faint pen, for the rest. */
  paintPlayed(pen, now, faint, paint) {
    for (const [from, to, strength] of [[0, now, 1], [now, this.width, faint]]) {
      pen.save();
      pen.beginPath();
      pen.rect(from, 0, to - from, this.height);
      pen.clip();
      pen.globalAlpha = strength;
      paint(pen);
      pen.restore();
    }
  }

  /* Copies the layer, which `drawLayer(pen)` of a subclass draws when it is stale. */
  copyLayer(pen, now, faint = NOT_PLAYED) {
    if (this.layer.width === 0 || this.layer.height === 0) { return; } // everything is hidden
    if (this.stale) {
      this.drawLayer(this.pen(this.layer));
      this.stale = false;
    }
    this.paintPlayed(pen, now, faint, () => pen.drawImage(this.layer, 0, 0, this.width, this.height));
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

  /* Writes a figure at a height of the scale: beside the plot, or where it does not fit just above its line, in the plot. */
  drawFigure(pen, text, y) {
    const inside = this.left < ROOM_FOR_FIGURES;
    pen.font = "12px system-ui, sans-serif";
    pen.textAlign = inside ? "left" : "right";
    pen.textBaseline = "middle";
    pen.fillStyle = theme.colour("soft");
    pen.fillText(text, this.left + (inside ? 2 : -7), inside ? Math.max(y - 7, 7) : y);
  }

  drawCursor(pen, now) {
    pen.fillStyle = theme.ink(0.75);
    pen.fillRect(Math.round(now - 0.5), 6, 1, this.height - 6); // on whole pixels, so that it stays sharp
  }

  drawDot(pen, now, y, colour) {
    pen.fillStyle = colour;
    pen.strokeStyle = theme.colour("panel");
    pen.lineWidth = 1.5;
    pen.beginPath();
    pen.arc(now, y, 4, 0, 2 * Math.PI);
    pen.fill();
    pen.stroke();
  }
}
