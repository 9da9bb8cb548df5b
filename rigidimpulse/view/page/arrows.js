/* Impact arrows and the ring that runs out from the point of contact. They live for `fade` seconds of recorded time.

   A row is one arrow: time, point (3), unit direction (3), unit contact normal (3), length. Rows are sorted by time. */

const ROW = 11;
const MOST_ARROWS = 256; // drawn at once; the longest win
const ARROW_COLOUR = "#ff4a1c";
const HIDDEN_OPACITY = 0.28; // of the part that lies inside or behind a body

/* Unit arrow along +y. `part` is 0 for the shaft and 1 for the head, so that the shader can keep the head's shape. */
function arrowGeometry() {
  const profile = [[0, 0, 0], [0.42, 0, 0], [0.42, 1, 0], [0.42, 0, 1], [1.15, 0, 1], [0, 1, 1]];
  const segments = 20;
  const position = [], part = [], index = [];
  for (let i = 0; i <= segments; i++) {
    const angle = (2 * Math.PI * i) / segments;
    for (const [radius, height, piece] of profile) {
      position.push(radius * Math.cos(angle), height, radius * Math.sin(angle));
      part.push(piece);
    }
  }
  const around = profile.length;
  for (let i = 0; i < segments; i++) {
    for (const k of [0, 1, 3, 4]) {
      const a = i * around + k, b = a + around;
      index.push(a, a + 1, b, b, a + 1, b + 1);
    }
  }
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.Float32BufferAttribute(position, 3));
  geometry.setAttribute("part", new THREE.Float32BufferAttribute(part, 1));
  geometry.setIndex(index);
  return geometry;
}

const ARROW_VERTEX = `
  attribute float part;
  attribute vec3 shape; // length, thickness, opacity
  varying float opacity;
  varying vec3 seen;
  void main() {
    float head = min(3.2 * shape.y, 0.6 * shape.x);
    float along = part > 0.5 ? shape.x - head + head * position.y : (shape.x - head) * position.y;
    vec4 place = modelViewMatrix * instanceMatrix * vec4(position.x * shape.y, along, position.z * shape.y, 1.0);
    opacity = shape.z;
    seen = place.xyz;
    gl_Position = projectionMatrix * place;
  }`;

const ARROW_FRAGMENT = `
  uniform vec3 colour;
  uniform float strength;
  varying float opacity;
  varying vec3 seen;
  void main() {
    vec3 normal = normalize(cross(dFdx(seen), dFdy(seen)));
    float light = 0.72 + 0.36 * max(dot(normal, normalize(vec3(-0.3, 0.9, 0.5))), 0.0);
    gl_FragColor = vec4(colour * light, opacity * strength);
  }`;

const RING_VERTEX = `
  attribute vec3 shape; // radius, width (fraction of the radius), opacity
  varying vec3 look;
  varying vec2 flat_position;
  void main() {
    look = shape;
    flat_position = position.xy;
    gl_Position = projectionMatrix * modelViewMatrix * instanceMatrix * vec4(position.xy * shape.x, 0.0, 1.0);
  }`;

const RING_FRAGMENT = `
  uniform vec3 colour;
  uniform float strength;
  varying vec3 look;
  varying vec2 flat_position;
  void main() {
    float away = length(flat_position);
    float ring = smoothstep(1.0 - look.y, 1.0 - 0.5 * look.y, away) * (1.0 - smoothstep(1.0 - 0.5 * look.y, 1.0, away));
    gl_FragColor = vec4(colour, ring * look.z * strength);
  }`;

/* One set of instances drawn twice: as it is, and faintly where something hides it. */
function instancedPair(geometry, vertexShader, fragmentShader, group, most, colour) {
  const shape = new THREE.InstancedBufferAttribute(new Float32Array(3 * most), 3);
  geometry.setAttribute("shape", shape);
  const meshes = [[THREE.LessEqualDepth, 1], [THREE.GreaterDepth, HIDDEN_OPACITY]].map(([depthFunc, strength]) => {
    const material = new THREE.ShaderMaterial({
      vertexShader, fragmentShader, depthFunc, depthWrite: false, transparent: true, toneMapped: false,
      side: THREE.DoubleSide, extensions: {derivatives: true}, polygonOffset: true, polygonOffsetFactor: -2,
      polygonOffsetUnits: -8, uniforms: {colour: {value: new THREE.Color(colour)}, strength: {value: strength}}});
    const mesh = new THREE.InstancedMesh(geometry, material, most);
    mesh.frustumCulled = false;
    mesh.renderOrder = 2;
    group.add(mesh);
    return mesh;
  });
  meshes[1].instanceMatrix = meshes[0].instanceMatrix;
  return {
    set(i, matrix, x, y, z) {
      meshes[0].setMatrixAt(i, matrix);
      shape.setXYZ(i, x, y, z);
    },
    finish(count) {
      meshes.forEach((mesh) => { mesh.count = count; });
      meshes[0].instanceMatrix.needsUpdate = true;
      shape.needsUpdate = true;
    },
  };
}

class ImpactArrows {
  constructor(rows, fade) {
    this.rows = rows;
    this.fade = fade;
    this.count = rows.length / ROW;
    this.visible = [];
    this.object = new THREE.Group();
    const pair = (geometry, vertex, fragment) => instancedPair(geometry, vertex, fragment, this.object, MOST_ARROWS, ARROW_COLOUR);
    this.rings = pair(new THREE.PlaneGeometry(2, 2), RING_VERTEX, RING_FRAGMENT);
    this.arrows = pair(arrowGeometry(), ARROW_VERTEX, ARROW_FRAGMENT);
  }

  /* First row at or after `time`. */
  firstAt(time) {
    let low = 0, high = this.count;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.rows[middle * ROW] < time) { low = middle + 1; } else { high = middle; }
    }
    return low;
  }

  show(time) {
    const found = [];
    for (let i = this.firstAt(time - this.fade); i < this.count && this.rows[i * ROW] <= time; i++) {
      if (this.rows[i * ROW] > time - this.fade) { found.push(i); }
    }
    if (found.length > MOST_ARROWS) {
      found.sort((i, j) => this.rows[j * ROW + 10] - this.rows[i * ROW + 10]);
      found.length = MOST_ARROWS;
    }
    const turn = new THREE.Quaternion(), one = new THREE.Vector3(1, 1, 1), matrix = new THREE.Matrix4();
    this.visible = found.map((i, instance) => {
      const row = this.rows.subarray(i * ROW, (i + 1) * ROW);
      const age = (time - row[0]) / this.fade, life = 1 - age * age, length = row[10] * (0.55 + 0.45 * life);
      const point = new THREE.Vector3(row[1], row[2], row[3]);
      const direction = new THREE.Vector3(row[4], row[5], row[6]), normal = new THREE.Vector3(row[7], row[8], row[9]);
      turn.setFromUnitVectors(new THREE.Vector3(0, 1, 0), direction);
      this.arrows.set(instance, matrix.compose(point, turn, one), length, 0.075 * row[10] * (0.3 + 0.7 * life), life);
      turn.setFromUnitVectors(new THREE.Vector3(0, 0, 1), normal);
      const radius = row[10] * (0.1 + 0.5 * Math.sqrt(age));
      this.rings.set(instance, matrix.compose(point, turn, one), radius, 0.3 - 0.15 * age, 0.75 * (1 - age));
      return {time: row[0], point: point.toArray(), direction: direction.toArray(), length: row[10]};
    });
    this.arrows.finish(found.length);
    this.rings.finish(found.length);
  }
}
