/* Error against seconds, both logarithmic: down and left is better. Every point is labelled, and a button. */

const HEIGHT = 280, LEFT = 62, RIGHT = 26, TOP = 22, BOTTOM = 34;
const LETTER = 7.2; // px, of a label
const LINE = 16; // px
const BELOW = 0.12; // of the height, free below the lowest point
const FACTOR = 1.35; // times by which the axes go beyond the points
const SAME = 1.6; // ratio below which two times count as the same
const TELLING = 20; // ratio of errors from which the arrow between two runs of the same cost is drawn
const FAMILIAR = [[0.1, "a hand's width"], [0.016, "a die's edge"], [8e-5, "a hair"]]; // m

class Chart {
  constructor(element, choose) {
    this.element = element;
    this.choose = choose;
    new ResizeObserver(() => this.index && this.draw()).observe(element);
  }

  show(index, chosen) {
    this.index = index;
    this.chosen = chosen;
    this.draw();
  }

  draw() {
    const {runs, scene} = this.index, depth = scene.measure === "depth";
    this.points = runs.filter(({bound, motion, seconds}) => bound !== null && motion && seconds > 0);
    const title = depth ? "Deepest overlap, against seconds to compute" : `Largest error until ${timeText(scene.until)}, against seconds to compute`;
    const head = make("header");
    head.append(make("h3", "", title), make("p", "", "lower left is better · click a point"));
    this.element.replaceChildren(head);
    if (this.points.length === 0) {
      this.element.append(make("p", "", "Points come as soon as there is a reference to measure against."));
      return;
    }
    this.scale();
    const svg = makeSvg("svg", {height: HEIGHT, viewBox: `0 0 ${this.width} ${HEIGHT}`, role: "group", "aria-label": title});
    this.svg = svg;
    this.drawAxes(scene, depth);
    this.drawPath();
    this.drawCost(depth);
    this.drawPoints();
    this.element.append(svg);
    const without = runs.filter(({motion}) => !motion);
    if (without.length) {
      const list = make("ul");
      list.append(...without.map(({name, whyNot}) => make("li", "", `${name}: ${whyNot}`)));
      this.element.append(list);
    }
  }

  /* Errors below what can be told are drawn at it. */
  height(run) { return Math.max(run.bound, this.floor); }

  scale() {
    const {scene} = this.index, times = this.points.map(({seconds}) => seconds);
    this.width = Math.max(this.element.clientWidth - 32, 260);
    const least = Math.min(...this.points.map(({bound}) => bound).filter((bound) => bound > 0), scene.size);
    this.floor = scene.measure === "depth" ? 0.3 * Math.max(least, 1e-9) : Math.max(scene.uncertainty ?? 0, 1e-10);
    const errors = this.points.map((run) => this.height(run));
    const pad = (low, high, least) => {
      const extra = Math.max(Math.log10(FACTOR), 0.5 * (least - Math.log10(high / low)));
      return [Math.log10(low) - extra, Math.log10(high) + extra];
    };
    this.x = pad(Math.min(...times), Math.max(...times), 1.2);
    this.y = pad(Math.min(...errors), Math.max(...errors), 2);
    this.y[0] -= BELOW * (this.y[1] - this.y[0]);
  }

  across(seconds) { return LEFT + ((Math.log10(seconds) - this.x[0]) / (this.x[1] - this.x[0])) * (this.width - LEFT - RIGHT); }

  down(error) { return HEIGHT - BOTTOM - ((Math.log10(error) - this.y[0]) / (this.y[1] - this.y[0])) * (HEIGHT - TOP - BOTTOM); }

  drawAxes(scene, depth) {
    const decades = (range, most) => {
      const all = [];
      for (let power = Math.ceil(range[0]); power <= range[1]; power++) { all.push(power); }
      return all.filter((_, k) => k % Math.max(1, Math.ceil(all.length / most)) === 0);
    };
    const bottom = HEIGHT - BOTTOM, right = this.width - RIGHT;
    if (!depth && this.down(this.floor) < bottom) {
      const top = this.down(this.floor);
      this.svg.append(makeSvg("rect", {class: "below", x: LEFT, y: top, width: right - LEFT, height: bottom - top}));
      if (bottom - top > 24) {
        this.svg.append(makeSvg("text", {x: right - 6, y: bottom - 6, "text-anchor": "end"},
          `finer than the reference can tell, ${lengthText(this.floor)}`));
      }
    }
    for (const power of decades(this.y, 6)) {
      const y = this.down(10 ** power);
      this.svg.append(makeSvg("line", {class: "grid", x1: LEFT, x2: right, y1: y, y2: y}),
        makeSvg("text", {x: LEFT - 8, y: y + 4, "text-anchor": "end"}, lengthText(10 ** power)));
    }
    for (const power of decades(this.x, 5)) {
      const x = this.across(10 ** power);
      this.svg.append(makeSvg("line", {class: "grid", x1: x, x2: x, y1: TOP, y2: bottom}),
        makeSvg("text", {x, y: bottom + 18, "text-anchor": "middle"}, power < -3 ? `${10 ** (power + 3)} ms` : `${10 ** power} s`));
    }
    this.svg.append(makeSvg("text", {x: LEFT, y: HEIGHT - 2}, "faster ← seconds to compute"));
    for (const [size, name] of FAMILIAR) {
      const y = this.down(size);
      if (y > TOP && y < bottom - 14) {
        this.svg.append(makeSvg("line", {class: "path", x1: right - 56, x2: right, y1: y, y2: y}),
          makeSvg("text", {x: right, y: y - 4, "text-anchor": "end"}, name));
      }
    }
  }

  /* A line through the presets, from cheap to exact. */
  drawPath() {
    const presets = this.points.filter(({kind}) => kind === "preset").sort((a, b) => a.seconds - b.seconds);
    const points = presets.map((run) => `${this.across(run.seconds)},${this.down(this.height(run))}`).join(" ");
    this.svg.append(makeSvg("polyline", {class: "path", points}));
  }

  /* The arrow from the standard run up to the worst that cost as much. */
  drawCost(depth) {
    const standard = this.points.find(({name}) => name === "standard");
    if (!standard || !(this.height(standard) > 0)) { return; }
    const equal = this.points.filter((run) => run.kind !== "preset" && Math.max(run.seconds, standard.seconds) <
      SAME * Math.min(run.seconds, standard.seconds) && run.bound > TELLING * this.height(standard));
    const worst = equal.sort((a, b) => b.bound - a.bound)[0];
    if (!worst || depth) { return; }
    const x = this.across(standard.seconds), from = this.down(this.height(standard)) - 14, to = this.down(worst.bound) + 12;
    const group = makeSvg("g", {class: "cost"}), middle = 0.5 * (from + to), left = x > 0.6 * this.width;
    group.append(makeSvg("line", {x1: x, x2: x, y1: from, y2: to}),
      makeSvg("text", {x: x + (left ? -8 : 8), y: middle, "text-anchor": left ? "end" : "start"},
        `same cost, ${timesText(worst.bound / this.height(standard))} the error`));
    this.svg.append(group);
  }

  drawPoints() {
    const taken = this.points.map((run) => {
      const x = this.across(run.seconds), y = this.down(this.height(run));
      return {x0: x - 9, x1: x + 9, y0: y - 9, y1: y + 9};
    });
    const ordered = [...this.points].sort((a, b) => (a.kind === "preset" ? 0 : 1) - (b.kind === "preset" ? 0 : 1));
    for (const run of ordered) {
      const x = this.across(run.seconds), y = this.down(this.height(run)), chosen = run.name === this.chosen;
      const text = chosen ? `${run.name}, ${secondsText(run.seconds)}, ${lengthText(run.bound)}` : run.name;
      const group = makeSvg("g", {class: `point ${run.kind}${chosen ? " chosen" : ""}`, style: `--own: ${colourOf(run)}`, tabindex: 0,
        role: "button", "data-name": run.name, "aria-label": `play ${run.name}: ${lengthText(run.bound)} in ${secondsText(run.seconds)}`});
      const mark = run.kind === "engine" ? makeSvg("rect", {class: "mark", x: x - 5.5, y: y - 5.5, width: 11, height: 11, rx: 1.5}) :
        makeSvg("circle", {class: "mark", cx: x, cy: y, r: run.kind === "preset" ? 7 : 6});
      const at = this.labelPlace(x, y, text, taken);
      group.append(makeSvg("circle", {class: "ring", cx: x, cy: y, r: 12}), makeSvg("circle", {cx: x, cy: y, r: 18, fill: "transparent"}), mark,
        makeSvg("text", {x: at.x, y: at.y, "text-anchor": at.anchor}, text));
      group.addEventListener("click", () => this.choose(run.name));
      group.addEventListener("keydown", (event) => {
        if (event.key === "Enter" || event.key === " ") { event.preventDefault(); event.stopPropagation(); this.choose(run.name); }
      });
      this.svg.append(group);
    }
  }

  /* The first place around a point at which its label covers nothing that is there. */
  labelPlace(x, y, text, taken) {
    const wide = LETTER * text.length, tries = [];
    for (const shift of [0, -1, 1, -2, 2, -3, 3]) {
      tries.push({x: x + 14, y: y + 4 + shift * LINE, anchor: "start", x0: x + 12}, {x: x - 14, y: y + 4 + shift * LINE, anchor: "end", x0: x - 16 - wide},
        {x, y: y + 4 + (shift || 1) * LINE * 1.2, anchor: "middle", x0: x - wide / 2});
    }
    const box = (place) => ({x0: place.x0, x1: place.x0 + wide + 4, y0: place.y - 12, y1: place.y + 4});
    const isFree = ({x0, x1, y0, y1}) => x0 > 2 && x1 < this.width - 2 && y0 > 0 && y1 < HEIGHT - BOTTOM + 4 &&
      taken.every((other) => x1 < other.x0 || x0 > other.x1 || y1 < other.y0 || y0 > other.y1);
    const found = tries.find((place) => isFree(box(place))) ?? tries[0];
    taken.push(box(found));
    return found;
  }
}

function timeText(value) { return `${Number(value.toFixed(2))} s`; }
