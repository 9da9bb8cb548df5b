/* Paths of the centres of mass, in the colours of their bodies: strong where they were just now, faint where they were long ago.

   A point is (x, y, z, time); each segment between neighbours is an instance of one flat strip, as wide as some pixels. */

const TRAIL_POINTS = 400000; // in all; longer runs have fewer points a body
const TRAIL_TIME = [0.25, 1]; // how long a trail is strong: a share of the run, and at least this many seconds
const TRAIL_WIDTH = 4; // pixels where it is strongest
const TRAIL_FAINT = 0.22; // what is left of its strength

const TRAIL_VERTEX = `
  attribute vec4 from, to;
  attribute vec3 tint;
  uniform float now, span, width;
  uniform vec2 screen;
  varying vec4 look;
  void main() {
    float along = to.w > from.w ? clamp((now - from.w) / (to.w - from.w), 0.0, 1.0) : 0.0;
    vec4 a = projectionMatrix * modelViewMatrix * vec4(from.xyz, 1.0);
    vec4 b = projectionMatrix * modelViewMatrix * vec4(mix(from.xyz, to.xyz, along), 1.0);
    vec2 way = (b.xy / b.w - a.xy / a.w) * screen;
    float age = (now - mix(from.w, to.w, position.x * along)) / span, life = clamp(1.0 - age, 0.0, 1.0);
    look = vec4(tint, mix(${TRAIL_FAINT}, 0.95, life * life));
    gl_Position = vec4(2.0, 2.0, 2.0, 1.0); // out of sight
    if (along > 0.0 && a.w > 0.0 && b.w > 0.0 && length(way) > 1e-6) {
      vec2 across = vec2(-way.y, way.x) / length(way), ahead = way / length(way);
      vec4 place = position.x > 0.5 ? b : a;
      vec2 shift = position.y * across + (2.0 * position.x - 1.0) * 0.2 * ahead; // neighbours overlap a little
      place.xy += 0.5 * width * mix(0.4, 1.0, life) * shift / (0.5 * screen) * place.w;
      gl_Position = place;
    }
  }`;

const TRAIL_FRAGMENT = `
  varying vec4 look;
  void main() { gl_FragColor = look; }`;

class Trails {
  constructor(viewer, stage, manifest, times) {
    Object.assign(this, {viewer, stage, times, shown: false, object: null});
    this.movers = manifest.bodies.filter(({name}) => Object.keys(motionSource.tracks(viewer, stage.nodes.get(name))).length > 0);
    this.step = Math.max(Math.ceil((this.movers.length * times.length) / TRAIL_POINTS), 1);
  }

  /* Points of a body's path, flat. */
  path(name) {
    const body = this.movers.find((each) => each.name === name), node = this.stage.nodes.get(name);
    const {position, quaternion} = motionSource.tracks(this.viewer, node), last = this.times.length - 1;
    const placeAt = position?.createInterpolant(new Float32Array(3)), turnAt = quaternion?.createInterpolant(new Float32Array(4));
    const offset = new THREE.Vector3().fromArray(body.center), turned = offset.lengthSq() > 0;
    const place = new THREE.Vector3(), turn = new THREE.Quaternion(), points = [];
    for (let frame = 0; ; frame = Math.min(frame + this.step, last)) {
      const time = this.times[frame];
      place.fromArray(placeAt ? placeAt.evaluate(time) : body.position);
      if (turned) {
        turn.fromArray(turnAt ? turnAt.evaluate(time) : body.quaternion);
        place.add(offset.clone().applyQuaternion(turn));
      }
      points.push(place.x, place.y, place.z, time);
      if (frame === last) { return points; }
    }
  }

  build() {
    const paths = this.movers.map(({name}) => this.path(name)), total = paths.reduce((sum, path) => sum + path.length / 4, 0);
    const points = new Float32Array(4 * total), tints = new Uint8Array(4 * total);
    let at = 0;
    paths.forEach((path, k) => {
      const colour = linearColour(this.movers[k].surface.color).convertLinearToSRGB();
      points.set(path, 4 * at);
      for (let i = 0; i < path.length / 4; i++, at++) { tints.set([255 * colour.r, 255 * colour.g, 255 * colour.b], 4 * at); }
    });
    const geometry = new THREE.InstancedBufferGeometry();
    geometry.setAttribute("position", new THREE.Float32BufferAttribute([0, -1, 0, 1, -1, 0, 0, 1, 0, 1, 1, 0], 3));
    geometry.setIndex([0, 1, 2, 2, 1, 3]);
    const data = new THREE.InstancedInterleavedBuffer(points, 4, 1), ahead = new THREE.InstancedInterleavedBuffer(points.subarray(4), 4, 1);
    geometry.setAttribute("from", new THREE.InterleavedBufferAttribute(data, 4, 0));
    geometry.setAttribute("to", new THREE.InterleavedBufferAttribute(ahead, 4, 0));
    geometry.setAttribute("tint", new THREE.InterleavedBufferAttribute(new THREE.InstancedInterleavedBuffer(tints, 4, 1), 3, 0, true));
    geometry.instanceCount = Math.max(total - 1, 0);
    const span = this.times[this.times.length - 1] - this.times[0], [share, least] = TRAIL_TIME;
    this.uniforms = {
      now: {value: 0}, span: {value: Math.max(share * span, Math.min(least, span), 1e-9)}, width: {value: TRAIL_WIDTH},
      screen: {value: new THREE.Vector2()}};
    const material = new THREE.ShaderMaterial({
      uniforms: this.uniforms, vertexShader: TRAIL_VERTEX, fragmentShader: TRAIL_FRAGMENT, transparent: true, depthWrite: false,
      toneMapped: false, side: THREE.DoubleSide});
    this.object = new THREE.Mesh(geometry, material);
    this.object.frustumCulled = false;
    this.object.renderOrder = 1.5; // after the ground, before the arrows
    this.object.onBeforeRender = () => this.uniforms.screen.value.set(window.innerWidth, window.innerHeight);
    this.viewer.set_object(["trails"], this.object);
  }

  turn(on, time) {
    if (on && this.object === null) { this.build(); }
    this.shown = on;
    if (this.object) { this.object.visible = on; }
    this.show(time);
  }

  show(time) { if (this.shown) { this.uniforms.now.value = time; } }
}
