/* The timeline: impacts as spikes, where each run left the truth, and until when the truth is known. */

const SPIKE = 20; // px, of the strongest impact
const RAIL = 40; // px from the top
const DIAMOND = 5; // px

class Timeline {
  constructor(svg, scrubber) {
    this.svg = svg;
    this.scrubber = scrubber;
    new ResizeObserver(() => this.index && this.draw()).observe(svg);
  }

  show(index) {
    this.index = index;
    this.scrubber.max = index.scene.duration;
    this.draw();
  }

  at(time) { return (time / this.index.scene.duration) * this.svg.clientWidth; }

  draw() {
    const {scene, impacts, runs, verdict} = this.index, width = this.svg.clientWidth;
    const strongest = Math.max(...impacts.map(([, impulse]) => impulse), 1e-300), parts = [];
    for (const [time, impulse] of impacts) {
      const high = 3 + (SPIKE - 3) * Math.sqrt(impulse / strongest);
      parts.push(makeSvg("line", {x1: this.at(time), x2: this.at(time), y1: RAIL - 4, y2: RAIL - 4 - high, stroke: "var(--impact)", opacity: 0.8}));
    }
    parts.push(makeSvg("line", {x1: 0, x2: width, y1: RAIL, y2: RAIL, stroke: "var(--line)", "stroke-width": 4, "stroke-linecap": "round"}));
    if (scene.until < scene.duration - 1e-9 && verdict) {
      const x = this.at(scene.until);
      const hatch = makeSvg("pattern", {id: "hatch", width: 7, height: 7, patternUnits: "userSpaceOnUse", patternTransform: "rotate(35)"});
      hatch.append(makeSvg("line", {x1: 0, x2: 0, y1: 0, y2: 7, stroke: "var(--quiet)", opacity: 0.5}));
      parts.push(hatch, makeSvg("rect", {x, y: RAIL - 26, width: width - x, height: 28, fill: "url(#hatch)"}),
        makeSvg("line", {x1: x, x2: x, y1: RAIL - 28, y2: RAIL + 6, stroke: "var(--ink)", "stroke-width": 1.5}));
      if (width > 500) {
        const left = x > 0.55 * width;
        parts.push(makeSvg("text", {x: x + (left ? -8 : 8), y: RAIL - 18, "text-anchor": left ? "end" : "start"}, `the truth is known until ${timeText(scene.until)}`));
      }
    }
    this.done = makeSvg("line", {x1: 0, y1: RAIL, y2: RAIL, stroke: "var(--ink)", "stroke-width": 4, "stroke-linecap": "round"});
    this.knob = makeSvg("circle", {cy: RAIL, r: 8, fill: "var(--ink)"});
    parts.push(this.done);
    for (const run of runs.filter(({left}) => left !== null)) {
      const x = this.at(run.left), y = RAIL + 12;
      const mark = makeSvg("path", {d: `M${x},${y - DIAMOND}l${DIAMOND},${DIAMOND}l${-DIAMOND},${DIAMOND}l${-DIAMOND},${-DIAMOND}z`,
        style: `fill: ${colourOf(run)}`});
      mark.append(makeSvg("title", {}, `${run.name} leaves the truth at ${timeText(run.left)}`));
      parts.push(mark);
    }
    parts.push(this.knob);
    this.svg.replaceChildren(...parts);
    this.move(Number(this.scrubber.value));
  }

  move(time) {
    this.scrubber.value = time;
    const x = this.at(time);
    this.done?.setAttribute("x2", x);
    this.knob?.setAttribute("cx", x);
  }
}
