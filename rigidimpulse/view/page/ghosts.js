/* Run B: its moving bodies as ghosts, which shine at their edges and let the scene through. Meshes are those of run A. */

const GHOST_CORE = "#f3f9ff", GHOST_EDGE = "#1f4468"; // pale against dark bodies, deep against the pale ground

/* Where run B is where run A is the offset leaves the body of A in front, so a ghost is seen only where it has come away. */
function ghostSurface(octants) {
  return new THREE.ShaderMaterial({
    transparent: true, depthWrite: false, toneMapped: false, side: THREE.DoubleSide,
    polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 4,
    uniforms: {core: {value: new THREE.Color(GHOST_CORE)}, edge: {value: new THREE.Color(GHOST_EDGE)}, octants: {value: octants}},
    extensions: {derivatives: true},
    vertexShader: `
      varying vec3 outward, seen, local;
      void main() {
        local = position;
        vec4 place = modelViewMatrix * vec4(position, 1.0);
        outward = normalMatrix * normal;
        seen = place.xyz;
        gl_Position = projectionMatrix * place;
      }`,
    fragmentShader: `
      uniform vec3 core, edge;
      uniform bool octants;
      varying vec3 outward, seen, local;
      void main() {
        float facing = abs(dot(normalize(outward), normalize(seen)));
        float rim = pow(1.0 - facing, 1.8);
        vec3 sides = clamp(local / max(fwidth(local), 1e-12), -1.0, 1.0);
        float dark = octants ? 0.5 - 0.5 * sides.x * sides.y * sides.z : 0.0; // as the bodies of run A are painted
        vec3 colour = mix(core, edge, max(smoothstep(0.05, 0.7, rim), 0.35 * dark));
        gl_FragColor = vec4(colour, mix(0.3, 0.95, rim));
      }`,
  });
}

/* Hides what lies behind the nearest faces of a ghost, so that a concave one shows its outside only. */
function ghostDepth() {
  return new THREE.MeshBasicMaterial({
    colorWrite: false, transparent: true, side: THREE.DoubleSide, polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 4});
}

class Ghosts {
  constructor(viewer, comparison, times) {
    this.folder = viewer.scene_tree.find(["ghosts"]).object;
    this.surfaces = [ghostSurface(false), ghostSurface(true)];
    this.depth = ghostDepth();
    this.nodes = new Map();
    this.nets = [];
    this.turns = new Set(comparison.ghosts.map(({name}) => name)); // bodies that have an attitude
    const drawn = (key) => viewer.scene_tree.find(["bodies", key, "<object>"]).object;
    for (const {name, key, shape, octants, position, quaternion} of comparison.ghosts) {
      const node = viewer.scene_tree.find(["ghosts", key]).object;
      if (shape >= 0) { viewer.set_object(["ghosts", key], this.makeGhost(drawn(key).children[0].geometry, octants)); }
      node.position.fromArray(position);
      node.quaternion.fromArray(quaternion);
      this.nodes.set(name, node);
    }
    for (const {name, key} of comparison.nets) {
      const node = viewer.scene_tree.find(["ghosts", key]).object, own = drawn(key).geometry;
      const geometry = new THREE.BufferGeometry();
      geometry.setIndex(own.index);
      geometry.setAttribute("position", own.attributes.position.clone());
      this.nets.push({geometry, frames: node.frames, times});
      viewer.set_object(["ghosts", key], this.makeGhost(geometry, false));
      this.nodes.set(name, node);
    }
  }

  makeGhost(geometry, octants) {
    const ghost = new THREE.Group();
    [this.depth, this.surfaces[Number(octants)]].forEach((material, pass) => {
      const mesh = new THREE.Mesh(geometry, material);
      mesh.renderOrder = 1 + 0.1 * pass; // after the ground, before the arrows
      mesh.frustumCulled = false;
      ghost.add(mesh);
    });
    return ghost;
  }

  castShadows(on) {
    this.folder.traverse((part) => { if (part.isMesh) { part.castShadow = on; } });
  }

  show(frame, time) { this.nets.forEach((net) => Net.prototype.show.call(net, frame, time)); }
}
