/* Impact arrows and the ring that runs out from the point of contact. They live for `fade` seconds of recorded time.

   A row is one arrow: time, point (3), unit direction (3), unit contact normal (3), length, number of its card. Rows are sorted by time.
   In the place of the whole arrow its normal part, its friction part or both can be shown. */

const ROW = 12;
const MOST_ARROWS = 256; // drawn at once; the longest win
const LEAST_PART = 0.02; // of an arrow: shorter friction is not drawn
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
    paint(colour) { meshes.forEach(({material}) => material.uniforms.colour.value.set(colour)); },
    finish(count) {
      meshes.forEach((mesh) => { mesh.count = count; });
      meshes[0].instanceMatrix.needsUpdate = true;
      shape.needsUpdate = true;
    },
  };
}

/* One in a colour of the style sheet. */
function themedPair(geometry, group, most, name, vertex = ARROW_VERTEX, fragment = ARROW_FRAGMENT) {
  const pair = instancedPair(geometry, vertex, fragment, group, most, theme.colour(name));
  theme.listeners.push(() => pair.paint(theme.colour(name)));
  return pair;
}

/* Draws one arrow from a point to another, or none. */
function setArrow(pair, from, to, thickness) {
  if (to === null) { return pair.finish(0); }
  const way = to.clone().sub(from), turn = new THREE.Quaternion().setFromUnitVectors(new THREE.Vector3(0, 1, 0), way.clone().normalize());
  pair.set(0, new THREE.Matrix4().compose(from, turn, new THREE.Vector3(1, 1, 1)), way.length(), Math.min(thickness, 0.2 * way.length()), 1);
  pair.finish(1);
}

/* Distance of a pixel from a piece of a line. */
function awayFrom([x, y], [ax, ay], [bx, by]) {
  const length = (bx - ax) ** 2 + (by - ay) ** 2, share = length > 0 ? ((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / length : 0;
  const at = Math.min(Math.max(share, 0), 1);
  return Math.hypot(x - ax - at * (bx - ax), y - ay - at * (by - ay));
}

class ImpactArrows {
  constructor(rows, fade) {
    this.rows = rows;
    this.fade = fade;
    this.count = rows.length / ROW;
    this.visible = [];
    this.object = new THREE.Group();
    this.parts = {normal: false, friction: false};
    this.left = -1; // card of the impact that is drawn otherwise
    this.rings = themedPair(new THREE.PlaneGeometry(2, 2), this.object, MOST_ARROWS, "hit", RING_VERTEX, RING_FRAGMENT);
    this.arrows = themedPair(arrowGeometry(), this.object, MOST_ARROWS, "hit");
    this.friction = themedPair(arrowGeometry(), this.object, MOST_ARROWS, "amber");
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
    this.draw(found, time);
  }

  draw(found, time) {
    const up = new THREE.Vector3(0, 1, 0), out = new THREE.Vector3(0, 0, 1), one = new THREE.Vector3(1, 1, 1);
    const turn = new THREE.Quaternion(), matrix = new THREE.Matrix4(), whole = !this.parts.normal && !this.parts.friction;
    let pushes = 0, drags = 0, rings = 0;
    this.visible = found.map((i) => {
      const row = this.rows.subarray(i * ROW, (i + 1) * ROW);
      const age = (time - row[0]) / this.fade, life = reducedMotion ? 1 : 1 - age * age, share = 0.55 + 0.45 * life;
      const point = new THREE.Vector3(row[1], row[2], row[3]), thick = 0.3 + 0.7 * life;
      const direction = new THREE.Vector3(row[4], row[5], row[6]), normal = new THREE.Vector3(row[7], row[8], row[9]);
      const place = (pair, number, vector) => {
        const length = row[10] * share * vector.length();
        turn.setFromUnitVectors(up, vector.clone().normalize());
        pair.set(number, matrix.compose(point, turn, one), length, Math.min(0.075 * row[10] * thick, 0.2 * length), life);
      };
      const push = normal.clone().multiplyScalar(direction.dot(normal)), drag = direction.clone().sub(push);
      const drawn = row[11] !== this.left || this.left < 0;
      if (drawn && whole) { place(this.arrows, pushes++, direction); }
      if (drawn && this.parts.normal) { place(this.arrows, pushes++, push); }
      if (drawn && this.parts.friction && drag.length() > LEAST_PART) { place(this.friction, drags++, drag); }
      turn.setFromUnitVectors(out, normal);
      const radius = row[10] * (reducedMotion ? 0.3 : 0.1 + 0.5 * Math.sqrt(age));
      this.rings.set(rings++, matrix.compose(point, turn, one), radius, 0.3 - 0.15 * age, 0.75 * (1 - age));
      const end = point.clone().addScaledVector(direction, row[10] * share);
      return {time: row[0], point: point.toArray(), direction: direction.toArray(), length: row[10], card: row[11], end};
    });
    this.arrows.finish(pushes);
    this.friction.finish(drags);
    this.rings.finish(found.length);
  }

  /* Leaves out the arrows of an impact. */
  leaveOut(card, time) {
    this.left = card;
    this.show(time);
  }

  /* Shows a part in the place of whole arrows, or no more. */
  turnPart(name, on, time) {
    this.parts[name] = on;
    this.show(time);
  }

  /* The visible arrow at a pixel of the window, or null. */
  at(x, y, viewer, near) {
    if (!this.object.parent.visible) { return null; }
    const pixel = (point) => {
      const seen = point.clone().applyMatrix4(viewer.scene.matrixWorld).project(viewer.camera);
      return [(0.5 + 0.5 * seen.x) * window.innerWidth, (0.5 - 0.5 * seen.y) * window.innerHeight];
    };
    let found = null, best = near;
    for (const arrow of this.visible) {
      const away = awayFrom([x, y], pixel(new THREE.Vector3(...arrow.point)), pixel(arrow.end));
      if (away < best) { [found, best] = [arrow, away]; }
    }
    return found;
  }
}
