/* The time line of the bar. Impacts stand on it as spikes, as high as the root of their impulse; many close ones are a hill with their
   number, which opens as a strip of its own above the bar. A click on a spike selects its impact, on the line it goes to a time. */

const TIMELINE_END = 8; // pixels beside its ends
const SPIKE = 24, LEAST_SPIKE = 4; // pixels
const NEAR = 7; // pixels from a spike at which a click is meant for it
const SMALL = 0.5; // of the height of the highest spike: below are the hills of small impacts
const STRIP_GAP = 5; // pixels between spikes of an open hill
const KNOB = 7; // pixels

/* A strip of time with spikes and hills, and what a click on it does. */
class ImpactStrip extends TimePlot {
  constructor(canvas, times, spikes, {gap, onSelect, onOpen, holder}) {
    super(canvas, times);
    Object.assign(this, {spikes, gap, onSelect, onOpen, holder, selected: -1, groups: []});
  }

  get base() { return this.height - 14; }

  fit(left, right) {
    super.fit(left, right);
    this.spikes.forEach((spike) => { spike.x = this.x(spike.time); });
    const start = this.times[0], end = this.times[this.times.length - 1];
    this.groups = gather(this.spikes.filter(({time}) => time >= start && time <= end), this.gap);
    this.label();
  }

  /* A button over each hill, with words where there is space. */
  label() {
    this.holder.querySelectorAll(".hill").forEach((old) => old.remove());
    const hills = this.groups.filter(({length}) => length > 1), boxes = hills.map((group) => this.hillButton(group));
    boxes.forEach((box, k) => {
      const from = k > 0 ? boxes[k - 1].right : 0, to = k + 1 < hills.length ? hills[k + 1][0].x : this.width;
      const place = (text) => {
        box.button.textContent = text;
        const width = box.button.offsetWidth;
        return [Math.min(Math.max(box.middle - width / 2, from), Math.max(this.width - width, from)), width];
      };
      let [left, width] = place(`${box.text} ${box.words}`);
      if (left + width > to && hills.length > 1) { [left, width] = place(box.text); }
      box.right = left + width;
      box.button.style.left = `${left}px`;
    });
  }

  hillButton(group) {
    const count = group.reduce((sum, spike) => sum + spike.count, 0).toLocaleString("en"), [first, last] = [group[0], group[group.length - 1]];
    const button = make("button", {
      className: "hill", type: "button", "aria-expanded": String(this.openFrom === first.time),
      "aria-label": `${count} impacts between ${digits(first.time)} and ${digits(last.time)} s: show each`});
    button.addEventListener("click", () => this.onOpen(group));
    this.holder.append(button);
    return {button, text: count, words: group.every(({height}) => height < SMALL) ? "small impacts" : "impacts", middle: (first.x + last.x) / 2, right: 0};
  }

  fitIfChanged() {
    const {clientWidth, clientHeight} = this.canvas;
    if (clientWidth !== this.width || clientHeight !== this.height || window.devicePixelRatio !== this.scale) {
      this.fit(TIMELINE_END, clientWidth - TIMELINE_END);
    }
  }

  tall(height) { return LEAST_SPIKE + (SPIKE - LEAST_SPIKE) * height; }

  drawLayer(pen) {
    for (const group of this.groups) {
      if (group.length > 1) { this.drawHill(pen, group); } else { this.drawSpike(pen, group[0]); }
    }
  }

  drawSpike(pen, {x, height}) {
    pen.fillStyle = theme.colour("spike");
    pen.fillRect(x - 1, this.base - 2 - this.tall(height), 2, this.tall(height));
  }

  /* As high everywhere as the highest spike near by. */
  drawHill(pen, group) {
    const from = Math.floor(group[0].x) - 2, to = Math.ceil(group[group.length - 1].x) + 2, heights = new Float32Array(to - from + 1);
    for (const {x, height} of group) {
      for (let k = Math.max(Math.round(x) - from - LEAST_GAP / 2, 0); k <= Math.min(Math.round(x) - from + LEAST_GAP / 2, to - from); k++) {
        heights[k] = Math.max(heights[k], height);
      }
    }
    pen.fillStyle = theme.colour("spike");
    pen.globalAlpha = 0.42;
    pen.beginPath();
    pen.moveTo(from, this.base - 2);
    heights.forEach((height, k) => pen.lineTo(from + k, this.base - 2 - this.tall(height)));
    pen.lineTo(to, this.base - 2);
    pen.fill();
    pen.globalAlpha = 1;
  }

  draw(time) {
    this.fitIfChanged();
    const pen = this.pen(this.canvas), now = Math.min(Math.max(this.x(time), this.left), this.right), base = this.base;
    this.copyLayer(pen, now, 0.75);
    pen.lineCap = "round";
    for (const [colour, from, to] of [[theme.ink(0.25), this.left, this.right], [theme.colour("ink"), this.left, now]]) {
      pen.strokeStyle = colour;
      pen.lineWidth = 3;
      pen.beginPath();
      pen.moveTo(from, base);
      pen.lineTo(to, base);
      pen.stroke();
    }
    const chosen = this.spikes.find(({members}) => members.includes(this.selected));
    if (chosen && chosen.x >= this.left && chosen.x <= this.right) { this.drawChosen(pen, chosen); }
    pen.fillStyle = theme.colour("ink");
    pen.beginPath();
    pen.arc(now, base, KNOB, 0, 2 * Math.PI);
    pen.fill();
  }

  drawChosen(pen, {x, height}) {
    const top = this.base - 2 - this.tall(height);
    pen.fillStyle = theme.colour("hit");
    pen.fillRect(x - 2, top, 4, this.base - 2 - top);
    pen.beginPath();
    pen.arc(x, top - 3, 4.5, 0, 2 * Math.PI);
    pen.fill();
  }

  /* The spike or hill that a click is meant for, or null. */
  groupAt(x, y) {
    if (y > this.base - 3) { return null; }
    let found = null, best = NEAR;
    for (const group of this.groups) {
      const away = Math.max(group[0].x - x, x - group[group.length - 1].x, 0);
      if (away < best) { [found, best] = [group, away]; }
    }
    return found;
  }

  /* A click selects; a pressed pointer that is moved scrubs. */
  bind(transport) {
    let pressed = null, moved = false;
    const at = (event) => {
      const box = this.canvas.getBoundingClientRect();
      return [event.clientX - box.left, event.clientY - box.top];
    };
    this.canvas.addEventListener("pointerdown", (event) => {
      this.canvas.setPointerCapture(event.pointerId);
      [pressed, moved] = [at(event), false];
      if (this.groupAt(...pressed) === null) { transport.seek(this.timeAt(pressed[0])); }
    });
    this.canvas.addEventListener("pointermove", (event) => {
      const [x, y] = at(event);
      this.canvas.style.cursor = this.groupAt(x, y) ? "pointer" : "crosshair";
      if (pressed === null || !(event.buttons & 1)) { return; }
      moved ||= Math.abs(x - pressed[0]) > 3;
      if (moved) { transport.seek(this.timeAt(x)); }
    });
    this.canvas.addEventListener("pointerup", () => {
      const group = pressed && !moved ? this.groupAt(...pressed) : null;
      pressed = null;
      if (group === null) { return; }
      if (group.length > 1) { this.onOpen(group); } else if (group[0].index >= 0) { this.onSelect(group[0].index); }
    });
  }
}

/* The strip of the whole run, and that of an open hill above it. */
class Timeline {
  constructor(transport, spikes, onSelect, onLayout) {
    Object.assign(this, {transport, spikes, onSelect, onLayout, strip: null});
    const options = {gap: LEAST_GAP, onSelect, onOpen: (group) => this.open(group), holder: element("timeline")};
    this.line = new ImpactStrip(element("marks"), transport.times, spikes, options);
    this.line.bind(transport);
    element("close-hill").addEventListener("click", () => this.close());
    theme.listeners.push(() => { this.line.stale = true; if (this.strip) { this.strip.stale = true; } this.draw(transport.time); });
  }

  /* Opens a hill; one that is open already is closed. */
  open(group) {
    const from = group[0].time, to = group[group.length - 1].time;
    if (this.strip && this.from === from && this.to === to) { return this.close(); }
    const margin = 0.02 * (to - from) || 1e-6, old = element("hill"), canvas = old.cloneNode();
    old.replaceWith(canvas); // without what was bound to the last one
    Object.assign(this, {from, to});
    element("magnifier").hidden = false;
    const highest = group.reduce((most, {height}) => Math.max(most, height), 0);
    element("hill-title").textContent = `${group.reduce((sum, {count}) => sum + count, 0).toLocaleString("en")} impacts, ${digits(from)} to ${digits(to)} s, drawn higher here`;
    const options = {gap: STRIP_GAP, onSelect: this.onSelect, onOpen: (inner) => this.open(inner), holder: element("magnifier-strip")};
    this.strip = new ImpactStrip(canvas, [from - margin, to + margin], group.map((spike) => ({...spike, height: spike.height / highest})), options);
    this.strip.selected = this.line.selected;
    this.strip.bind(this.transport);
    this.line.openFrom = from;
    this.line.label();
    this.onLayout();
    this.draw(this.transport.time);
  }

  close() {
    this.strip = null;
    this.line.openFrom = undefined;
    element("magnifier").hidden = true;
    this.line.label();
    this.onLayout();
  }

  select(index) {
    this.line.selected = index;
    if (this.strip) { this.strip.selected = index; }
    this.draw(this.transport.time);
  }

  draw(time) {
    this.line.draw(time);
    this.strip?.draw(time);
  }
}
