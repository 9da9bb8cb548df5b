/* Energy and momentum of the scene over time. `curves` holds kinetic, potential and total energy [J], the potential one measured
   from its least value, then the three components of momentum [kg m/s], each at all frames; `angular` those of the angular momentum about
   the common centre of mass [kg m^2/s], null where nothing spins. */

const CURVE_COLOURS = {kinetic: "blue", potential: "amber", total: "ink", x: "hit", y: "teal", z: "violet"}; // names in the style sheet
const LEAST_MOMENTUM = 1e-9; // N s, N m s, of the scale: what is less is round-off
const ROUND_OFF = 1e-7; // of a plot's range: what is written as zero
const ROOM_FOR_PLOTS = [900, 640]; // pixels of a window in which the plots are there from the start

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
      pen.fillStyle = theme.ink(k === 0 ? 0.3 : 0.1);
      pen.fillRect(this.left, y - 0.5, this.right - this.left, 1);
      if (k === 0 || !this.empty) { this.drawFigure(pen, withUnit(k * this.step, this.unit, 3), y); }
    }
    for (const {values, name, width, shade} of this.curves) {
      if (shade) {
        this.trace(pen, values);
        pen.lineTo(this.right, this.y(0));
        pen.lineTo(this.left, this.y(0));
        pen.fillStyle = theme.ink(0.06);
        pen.fill();
      }
      this.drawLine(pen, values, theme.colour(CURVE_COLOURS[name]), width);
    }
  }

  draw(time, frame) {
    const pen = this.pen(this.canvas), now = this.x(time);
    this.copyLayer(pen, now);
    this.drawCursor(pen, now);
    for (const {values, name} of this.curves) {
      this.drawDot(pen, now, this.y(this.valueAt(values, frame, time)), theme.colour(CURVE_COLOURS[name]));
    }
  }
}

class LedgerPanel extends Panel {
  constructor(viewer, stage, transport, {curves, angular = null}, energySpan) {
    const titles = {energy: "Energy", momentum: "Momentum", ...(angular ? {angular: "Angular momentum"} : {})};
    const part = ([id, title]) => `<div class="part"><canvas id="${id}" role="img" aria-label="${title} over time"></canvas>
      <div class="legend"><h2>${title}</h2><dl id="${id}-legend"></dl></div></div>`;
    super(viewer, stage, transport, "ledger", Object.entries(titles).map(part).join(""));
    this.section.setAttribute("aria-label", "plots");
    this.section.style.setProperty("--parts", Object.keys(titles).length);
    const times = transport.times, row = (values, k) => values.subarray(k * times.length, (k + 1) * times.length);
    const energies = ["kinetic", "potential", "total"].map((name, k) => ({
      label: name, name, values: row(curves, k), width: name === "total" ? 2 : 1.5, shade: name === "total"}));
    const axes = (values, first, word) => ["x", "y", "z"].map((name, k) => ({
      label: `${word} ${name}`, name, values: row(values, first + k), width: 1.5}));
    const plots = [
      this.makePlot("energy", energies, "J", energySpan || 1),
      this.makePlot("momentum", axes(curves, 3, "momentum"), "N\u2009s", LEAST_MOMENTUM),
      angular && this.makePlot("angular", axes(angular, 0, "angular momentum"), "N\u2009m\u2009s", LEAST_MOMENTUM),
    ];
    this.open(plots.filter(Boolean));
    const [wide, tall] = ROOM_FOR_PLOTS;
    if (window.innerWidth < wide || window.innerHeight < tall) { this.turn(false); }
  }

  makePlot(id, curves, unit, least) {
    const plot = new CurvePlot(element(id), this.transport.times, curves, unit, least);
    plot.canvas.title = "click to go there";
    for (const curve of curves) {
      const entry = document.createElement("div"), words = curve.label.split(" ");
      entry.innerHTML = `<dt style="--line: var(--${CURVE_COLOURS[curve.name]})"><span>${words.slice(0, -1).join(" ")} </span>${words.at(-1)}</dt><dd></dd>`;
      if (words.length === 1) { entry.querySelector("span").remove(); }
      entry.title = curve.label === "potential" ? "above its least value in this run" : "";
      element(`${id}-legend`).append(entry);
      curve.figure = entry.querySelector("dd");
    }
    return plot;
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
