/* Impact arrows of which more come while the run is computed. Their rows hold the size of the impulse in the place of a length, and the
   number of the impact in that of a card; lengths follow once more from the largest impulse until now, as in `view/arrows.py`. */

const MOST_SPIKES = 20000; // impacts; more are gathered before they are drawn
const MARK_BINS = 1024; // parts of a run in which they are

class GrowingArrows {
  constructor() {
    this.arrows = new ImpactArrows(new Float32Array(0), 0.4);
    this.begin({longestArrow: 1, shortestArrow: 0.06, fade: 0.4});
  }

  begin({longestArrow, shortestArrow, fade}) {
    Object.assign(this, {longest: longestArrow, shortest: shortestArrow, rows: new Float32Array(64 * ROW), sizes: new Float32Array(64), largest: 0});
    this.arrows.fade = fade;
    this.resize(0);
  }

  get count() { return this.arrows.count; }

  resize(count) {
    if (count > this.sizes.length) {
      const rows = new Float32Array(2 * count * ROW), sizes = new Float32Array(2 * count);
      rows.set(this.rows);
      sizes.set(this.sizes);
      Object.assign(this, {rows, sizes});
    }
    this.arrows.rows = this.rows;
    this.arrows.count = count;
  }

  add(first, rows) {
    this.resize(first + rows.length / ROW);
    this.rows.set(rows, first * ROW);
    let largest = first > 0 ? this.largest : 0;
    for (let i = first; i < this.count; i++) {
      this.sizes[i] = this.rows[i * ROW + 10];
      largest = Math.max(largest, this.sizes[i]);
    }
    const from = largest > this.largest || first === 0 ? 0 : first; // all of them, where there is a larger one than before
    this.largest = largest;
    this.measure(from);
  }

  measure(from) {
    for (let i = from; i < this.count; i++) {
      this.rows[i * ROW + 10] = Math.max((this.longest * this.sizes[i]) / this.largest, this.shortest);
    }
  }

  resizeArrows({longestArrow, shortestArrow}) {
    Object.assign(this, {longest: longestArrow, shortest: shortestArrow});
    this.measure(0);
  }

  /* Time of the next impact after a time, or of the last one before it; undefined if there is none. */
  beside(time, way) {
    const near = 1e-6 * (1 + time);
    if (way > 0) {
      const at = this.arrows.firstAt(time + near);
      return at < this.count ? this.rows[at * ROW] : undefined;
    }
    const at = this.arrows.firstAt(time - near) - 1;
    return at >= 0 ? this.rows[at * ROW] : undefined;
  }

  /* Time and height on the time line of each impact, by number; it has an arrow for each body that it pushes. */
  get impacts() {
    const impacts = new Map();
    for (let i = 0; i < this.count; i++) {
      impacts.set(this.rows[i * ROW + 11], {time: this.rows[i * ROW], height: Math.sqrt(this.sizes[i] / this.largest)});
    }
    return impacts;
  }

  timeOf(number) { return this.impacts.get(number).time; }

  /* What stands on the time line of a run of this duration, see `Timeline`. */
  spikes(duration) {
    const impacts = [...this.impacts].sort(([, a], [, b]) => a.time - b.time);
    if (impacts.length > MOST_SPIKES) { return gatheredSpikes(impacts, duration); }
    const numbered = (spike) => Object.assign(spike, {index: impacts[spike.index][0]});
    return makeSpikes(impacts.map(([, {time}]) => time), impacts.map(([, {height}]) => height)).map(numbered);
  }
}

/* One spike for each part of a run; impacts are [number, {time, height}]. */
function gatheredSpikes(impacts, duration) {
  const marks = new Float32Array(2 * MARK_BINS), strongest = new Int32Array(MARK_BINS).fill(-1);
  const binOf = (time) => Math.min(Math.floor((time / duration) * MARK_BINS), MARK_BINS - 1);
  for (const [number, {time, height}] of impacts) {
    const bin = binOf(time);
    marks[bin] += 1;
    if (height > marks[MARK_BINS + bin]) { [marks[MARK_BINS + bin], strongest[bin]] = [height, number]; }
  }
  return binnedSpikes(marks, 0, duration, (from, to) => strongest[binOf((from + to) / 2)]);
}
