/* The impacts that have a card, in order of time: what `impact_cards` wrote of each. */

class Impacts {
  constructor(keys, rows, manifest) {
    this.entries = manifest.cards;
    this.names = manifest.bodies.map(({name}) => name);
    const numbers = keys ? new Float64Array(keys.slice().buffer) : new Float64Array(0);
    this.count = numbers.length / 2;
    this.times = numbers.subarray(0, this.count);
    this.impulses = numbers.subarray(this.count);
    this.rows = rows ?? new Float32Array(0);
    this.places = {};
    let width = 0;
    for (const [name, size] of Object.entries(this.entries.columns)) {
      this.places[name] = [width, size];
      width += size;
    }
    this.width = width;
    this.largest = this.impulses.reduce((a, b) => Math.max(a, b), 0);
  }

  /* Whether each impact of the run has a card. */
  get complete() { return this.count === this.entries.numImpacts; }

  /* Height of each on the time line: the root of its share of the largest impulse. */
  heights() { return Array.from(this.impulses, (impulse) => Math.sqrt(impulse / this.largest)); }

  value(index, name) {
    const [place, size] = this.places[name], start = index * this.width + place;
    return size === 1 ? this.rows[start] : Array.from(this.rows.subarray(start, start + size));
  }

  /* All that is known of an impact. `sides` are those of body a and b: name, mass (null: cannot be pushed), velocities before and after. */
  get(index) {
    const impact = {index, time: this.times[index], impulse: this.impulses[index]};
    for (const name of Object.keys(this.entries.columns)) { impact[name] = this.value(index, name); }
    const parts = (values, side, when) => values.slice(6 * side + 3 * when, 6 * side + 3 * when + 3);
    impact.sides = [impact.body_a, impact.body_b].map((body, side) => ({
      name: this.names[body], mass: this.entries.masses[body],
      velocity: [0, 1].map((when) => parts(impact.velocity, side, when)),
      spin: [0, 1].map((when) => parts(impact.angular_velocity, side, when)),
    }));
    impact.friction = Math.hypot(...impact.tangent_impulse);
    [impact.restitution, impact.staticFriction, impact.dynamicFriction] = this.entries.pairs[`${impact.body_a},${impact.body_b}`];
    return impact;
  }

  /* The last impact at or before a time, -1 where there is none. */
  lastAt(time) {
    let low = 0, high = this.count;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.times[middle] <= time) { low = middle + 1; } else { high = middle; }
    }
    return low - 1;
  }

  /* The strongest from one time until before another, -1 where there is none. */
  strongestIn(from, to) {
    let best = -1;
    for (let i = this.lastAt(from); i < this.count && this.times[Math.max(i, 0)] < to; i++) {
      if (i >= 0 && this.times[i] >= from && (best < 0 || this.impulses[i] > this.impulses[best])) { best = i; }
    }
    return best;
  }

  /* The impact of a body that is nearest to a time, -1 where it has none. */
  nearestOf(name, time) {
    const body = this.names.indexOf(name);
    let best = -1;
    for (let i = 0; i < this.count; i++) {
      const [a, b] = [this.value(i, "body_a"), this.value(i, "body_b")];
      if ((a === body || b === body) && (best < 0 || Math.abs(this.times[i] - time) < Math.abs(this.times[best] - time))) { best = i; }
    }
    return best;
  }
}
