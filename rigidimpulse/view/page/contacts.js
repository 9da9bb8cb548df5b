/* Lasting contacts at a frame: a dot at each point, and the force on the body that it pushes as an arrow.

   A row is one contact with the same force over some frames: first frame, frame after the last, point (3), arrow (3, m).
   Rows are sorted by first frame. */

const CONTACT_ROW = 8;
const MOST_CONTACTS = 4096; // drawn at once; the longest arrows win
const DOT = 0.085; // radius of a dot, relative to the longest arrow

const DOT_VERTEX = `
  attribute vec3 shape; // radius
  varying vec2 flat_position;
  void main() {
    flat_position = position.xy;
    vec4 place = modelViewMatrix * instanceMatrix * vec4(0.0, 0.0, 0.0, 1.0);
    place.xy += shape.x * position.xy;
    gl_Position = projectionMatrix * place;
  }`;

const DOT_FRAGMENT = `
  uniform vec3 colour;
  uniform float strength;
  varying vec2 flat_position;
  void main() {
    float away = length(flat_position), soft = fwidth(away);
    float inside = 1.0 - smoothstep(1.0 - soft, 1.0, away), core = 1.0 - smoothstep(0.5 - soft, 0.5, away);
    gl_FragColor = vec4(mix(colour, vec3(1.0), core), inside * strength);
  }`;

class ContactArrows {
  constructor(rows) {
    this.rows = rows;
    this.count = rows.length / CONTACT_ROW;
    this.shown = false;
    this.visible = [];
    this.object = new THREE.Group();
    this.object.visible = false;
    this.longest = 0;
    for (let i = 0; i < this.count; i++) { this.longest = Math.max(this.longest, this.lengthOf(i)); }
    const most = Math.min(this.count, MOST_CONTACTS);
    this.arrows = themedPair(arrowGeometry(), this.object, most, "violet");
    this.dots = themedPair(new THREE.PlaneGeometry(2, 2), this.object, most, "violet", DOT_VERTEX, DOT_FRAGMENT);
  }

  lengthOf(i) { return Math.hypot(...this.rows.subarray(i * CONTACT_ROW + 5, i * CONTACT_ROW + 8)); }

  turn(on, frame) {
    this.shown = on;
    this.object.visible = on;
    this.show(frame);
  }

  show(frame) {
    if (!this.shown || frame === this.frame) { return; }
    this.frame = frame;
    const {rows} = this, found = [];
    for (let i = 0; i < this.count && rows[i * CONTACT_ROW] <= frame; i++) {
      if (frame < rows[i * CONTACT_ROW + 1]) { found.push(i); }
    }
    if (found.length > MOST_CONTACTS) {
      found.sort((i, j) => this.lengthOf(j) - this.lengthOf(i));
      found.length = MOST_CONTACTS;
    }
    const turn = new THREE.Quaternion(), one = new THREE.Vector3(1, 1, 1), matrix = new THREE.Matrix4(), up = new THREE.Vector3(0, 1, 0);
    this.visible = found.map((i, instance) => {
      const row = rows.subarray(i * CONTACT_ROW, (i + 1) * CONTACT_ROW), length = this.lengthOf(i);
      const point = new THREE.Vector3(row[2], row[3], row[4]), direction = new THREE.Vector3(row[5], row[6], row[7]).divideScalar(length);
      turn.setFromUnitVectors(up, direction);
      matrix.compose(point, turn, one);
      this.arrows.set(instance, matrix, length, 0.035 * (this.longest + length) / 2, 0.9);
      this.dots.set(instance, matrix, DOT * this.longest * 0.7, 0, 0);
      return {point: point.toArray(), direction: direction.toArray(), length};
    });
    this.arrows.finish(found.length);
    this.dots.finish(found.length);
  }
}
