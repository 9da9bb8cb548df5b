/* Angular velocity and angular momentum of bodies as vectors from their centres of mass. `rows` holds the recorded angular velocity of body
   after body at all frames, rad/s; the angular momentum follows from the principal moments and the pose. Each kind has one scale. */

const SPIN_REACH = 3; // body radii: the longest vector
const LEAST_VECTOR = 0.01; // of the longest: shorter ones are not drawn

class Spins {
  constructor(stage, manifest, rows, times) {
    Object.assign(this, {stage, rows, times, entries: manifest.spins, reach: SPIN_REACH * manifest.framing.body_radius});
    this.centres = new Map(manifest.bodies.map(({name, center}) => [name, new THREE.Vector3(...center)]));
    this.object = new THREE.Group();
    const kind = (name) => {
      const group = new THREE.Group();
      group.visible = false;
      this.object.add(group);
      return {group, pair: themedPair(arrowGeometry(), group, Math.max(this.count, 1), name)};
    };
    this.kinds = {velocity: kind("violet"), momentum: kind("teal")};
    this.largest = {velocity: this.largestOf(() => 1), momentum: this.largestOf((k) => Math.max(...this.entries[k].moments))};
  }

  get count() { return this.entries.length; }

  largestOf(weight) {
    let most = 0;
    for (let i = 0; i < this.rows.length / 3; i++) {
      const size = Math.hypot(this.rows[3 * i], this.rows[3 * i + 1], this.rows[3 * i + 2]);
      most = Math.max(most, size * weight(Math.floor(i / this.times.length)));
    }
    return most;
  }

  /* Angular velocity of a body at a frame, in the recorded frame. */
  velocity(k, frame) { return new THREE.Vector3().fromArray(this.rows, 3 * (k * this.times.length + frame)); }

  momentum(k, frame) {
    const {name, moments, frame: principal} = this.entries[k], turn = this.stage.nodes.get(name).quaternion.clone();
    turn.multiply(new THREE.Quaternion(...principal));
    return this.velocity(k, frame).applyQuaternion(turn.clone().invert()).multiply(new THREE.Vector3(...moments)).applyQuaternion(turn);
  }

  turn(kind, on, frame) {
    this.kinds[kind].group.visible = on;
    this.show(frame);
  }

  show(frame) {
    const up = new THREE.Vector3(0, 1, 0), one = new THREE.Vector3(1, 1, 1);
    for (const [kind, {group, pair}] of Object.entries(this.kinds)) {
      if (!group.visible) { continue; }
      let drawn = 0;
      this.entries.forEach(({name}, k) => {
        const vector = this[kind](k, frame), share = vector.length() / this.largest[kind], node = this.stage.nodes.get(name);
        if (!(share > LEAST_VECTOR)) { return; }
        const at = this.centres.get(name).clone().applyQuaternion(node.quaternion).add(node.position), length = share * this.reach;
        const turn = new THREE.Quaternion().setFromUnitVectors(up, vector.normalize());
        pair.set(drawn++, new THREE.Matrix4().compose(at, turn, one), length, Math.min(0.022 * this.reach, 0.2 * length), 0.95);
      });
      pair.finish(drawn);
    }
  }
}
