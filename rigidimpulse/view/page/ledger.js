/* Energy and momentum of the scene over time. `curves` holds kinetic, potential and total energy [J], the potential one measured
   from its least value, then the three components of momentum [kg m/s], each at all frames. */

const ENERGY_COLOURS = {kinetic: "#2f7fb8", potential: "#d9911f", total: PLOT_INK};
const AXIS_COLOURS = {x: "#c4493a", y: "#3d8f5f", z: "#3b6fc4"};
const LEAST_MOMENTUM = 1e-9; // N s, of the scale: what is less is round-off
const ROUND_OFF = 1e-7; // of a plot's range: what is written as zero
const ROOM_FOR_PLOTS = [900, 620]; // pixels of a window in which the plots are there from the start

/* Curves with one linear scale, which holds zero and as much above it as `leastSpan`. */
class CurvePlot extends TimePlot {
  constructor(canvas, times, curves, unit, leastSpan) {
    super(canvas, times);
    Object.assign(this, {curves, unit});
    let low = 0, high = 0;
    for (const {values} of curves) {
      for (const value of values) {
        low = Math.min(low, value);
        high = Math.max(high, value);
      }
    }
    const span = Math.max(high - low, leastSpan), power = Math.pow(10, Math.floor(Math.log10(span / 2)));
    this.step = power * [5, 2, 1].find((step) => span >= 1.6 * step * power || step === 1);
    Object.assign(this, {low, high: low + span, empty: high - low < leastSpan});
  }

  y(value) {
    const foot = this.height - PLOT_FOOT / 2;
    return foot - ((foot - PLOT_HEAD / 2) * (value - this.low)) / (this.high - this.low);
  }

  drawLayer(pen) {
    for (let k = Math.ceil(this.low / this.step - 1e-9); k * this.step <= this.high * (1 + 1e-9); k++) {
      const y = this.y(k * this.step);
      pen.fillStyle = `rgba(29, 39, 48, ${k === 0 ? 0.22 : 0.08})`;
      pen.fillRect(this.left, y - 0.5, this.right - this.left, 1);
      if (k === 0 || !this.empty) { this.drawFigure(pen, withUnit(k * this.step, this.unit, 3), y); }
    }
    for (const {values, colour, width, shade} of this.curves) {
      if (shade) {
        this.trace(pen, values);
        pen.lineTo(this.right, this.y(0));
        pen.lineTo(this.left, this.y(0));
        pen.fillStyle = shade;
        pen.fill();
      }
      this.drawLine(pen, values, colour, width);
    }
  }

  draw(time, frame) {
    const pen = this.pen(this.canvas), now = this.x(time);
    this.copyLayer(pen, now);
    this.drawCursor(pen, now);
    for (const {values, colour} of this.curves) { this.drawDot(pen, now, this.y(this.valueAt(values, frame, time)), colour); }
  }
}

class LedgerPanel extends Panel {
  constructor(viewer, stage, transport, curves, energySpan) {
    const part = (name) => `<div class="part"><canvas id="${name}" title="click to go there"></canvas>
      <dl class="legend" id="${name}-legend"></dl></div>`;
    super(viewer, stage, transport, "ledger", part("energy") + part("momentum"));
    const times = transport.times, row = (k) => curves.subarray(k * times.length, (k + 1) * times.length);
    const energies = ["kinetic", "potential", "total"].map((label, k) => ({
      label, values: row(k), colour: ENERGY_COLOURS[label], width: label === "total" ? 2 : 1.5,
      shade: label === "total" ? "rgba(29, 39, 48, 0.06)" : null}));
    const axes = ["x", "y", "z"].map((axis, k) => ({label: `momentum ${axis}`, values: row(3 + k), colour: AXIS_COLOURS[axis], width: 1.5}));
    const open = (name, list, unit, least) => {
      const plot = new CurvePlot(element(name), times, list, unit, least);
      for (const curve of list) {
        const entry = document.createElement("div");
        entry.innerHTML = `<dt style="--line: ${curve.colour}">${curve.label.replace("momentum ", "<span>momentum </span>")}</dt><dd></dd>`;
        entry.title = curve.label === "potential" ? "above its least value in this run" : "";
        element(`${name}-legend`).append(entry);
        curve.figure = entry.querySelector("dd");
      }
      return plot;
    };
    this.open([open("energy", energies, "J", energySpan || 1), open("momentum", axes, "N\u2009s", LEAST_MOMENTUM)]);
    const [wide, tall] = ROOM_FOR_PLOTS;
    if (window.innerWidth < wide || window.innerHeight < tall) { this.turn(false); }
  }

  show() {
    if (!this.shown) { return; }
    this.keepFitted();
    const {time, frame} = this.transport;
    for (const plot of this.plots) {
      plot.draw(time, frame);
      for (const {values, figure} of plot.curves) {
        const value = plot.valueAt(values, frame, time), seen = Math.abs(value) > ROUND_OFF * (plot.high - plot.low);
        const text = withUnit(seen ? value : 0, plot.unit, 3);
        if (figure.textContent !== text) { figure.textContent = text; }
      }
    }
  }
}
