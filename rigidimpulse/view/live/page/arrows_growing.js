/* Impact arrows of which more come while the run is computed. Their rows hold the size of the impulse; lengths follow once more from the
   largest impulse until now, as in `view/arrows.py`. */

class GrowingArrows {
  constructor() {
    this.arrows = new ImpactArrows(new Float32Array(0), 0.4);
    this.begin({longestArrow: 1, shortestArrow: 0.15, fade: 0.4});
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

  /* Numbers and heights along the time line, see `Timeline`. */
  marks(duration, bins = 1024) {
    const marks = new Float32Array(2 * bins);
    for (let i = 0; i < this.count; i++) {
      const bin = Math.min(Math.floor((this.rows[i * ROW] / duration) * bins), bins - 1);
      marks[bin] += 1;
      marks[bins + bin] = Math.max(marks[bins + bin], Math.sqrt(this.sizes[i] / this.largest));
    }
    return marks;
  }
}
