/* Run B: its moving bodies as ghosts, which shine at their edges and let the scene through. Meshes are those of run A. */

const GHOST_MIDDLE = "#f3f9ff", GHOST_EDGE = "#1f4468"; // pale against dark bodies, deep against the pale ground
const SURFACE_BACK = 200; // steps of depth, of 2^-24, by which a ghost lies further back than it is
const EDGE_BACK = 1.2e-5; // the same for its edges, of a depth from -1 to 1: less, or the ghost would hide them
const CREASE = 35; // degrees, from which an edge is drawn, as in the display geometry

/* Where run B is where run A is the offset leaves the body of A in front, so a ghost is seen only where it has come away. */
const BEHIND = {transparent: true, side: THREE.DoubleSide, polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: SURFACE_BACK};

/* `rims` is how dark the rim is where the surface is flat and where it is curved: a flat face must not turn dark as a whole
   when it is seen from the side. */
function ghostSurface(octants, rims) {
  return new THREE.ShaderMaterial({
    ...BEHIND, depthWrite: false, toneMapped: false, extensions: {derivatives: true},
    uniforms: {
      middle: {value: new THREE.Color(GHOST_MIDDLE)}, edge: {value: new THREE.Color(GHOST_EDGE)},
      octants: {value: octants}, rims: {value: new THREE.Vector2(...rims)},
    },
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
      uniform vec3 middle, edge;
      uniform vec2 rims;
      uniform bool octants;
      varying vec3 outward, seen, local;
      void main() {
        vec3 normal = normalize(outward);
        float curved = smoothstep(0.001, 0.01, length(fwidth(normal)));
        float rim = pow(1.0 - abs(dot(normal, normalize(seen))), 1.8) * mix(rims.x, rims.y, curved);
        vec3 sides = clamp(local / max(fwidth(local), 1e-12), -1.0, 1.0);
        float dark = octants ? 0.5 - 0.5 * sides.x * sides.y * sides.z : 0.0; // as the bodies of run A are painted
        vec3 colour = mix(middle, edge, max(smoothstep(0.05, 0.7, rim), 0.35 * dark));
        gl_FragColor = vec4(colour, mix(0.3, 0.95, rim));
      }`,
  });
}

/* Hides what lies behind the nearest faces of a ghost, so that a concave one shows its outside only. */
function ghostDepth() { return new THREE.MeshBasicMaterial({...BEHIND, colorWrite: false}); }

/* The outline of what is flat. */
function edgeSurface() {
  const material = new THREE.LineBasicMaterial({
    color: linearColour(GHOST_EDGE), transparent: true, opacity: 0.75, depthWrite: false, toneMapped: false});
  material.onBeforeCompile = (shader) => {
    shader.vertexShader = shader.vertexShader
      .replace("#include <project_vertex>", `#include <project_vertex>\ngl_Position.z += ${EDGE_BACK} * gl_Position.w;`);
  };
  return material;
}

/* The border of a flexible body, which moves with it; a closed surface has none. */
function borderOf(geometry) {
  const faces = geometry.index.array, border = new Map(), lines = new THREE.BufferGeometry();
  for (let i = 0; i < faces.length; i++) {
    const ends = [faces[i], faces[i % 3 === 2 ? i - 2 : i + 1]], key = [Math.min(...ends), Math.max(...ends)].join(" ");
    if (!border.delete(key)) { border.set(key, ends); }
  }
  lines.setAttribute("position", geometry.attributes.position);
  lines.setIndex([...border.values()].flat());
  return lines;
}

class Ghosts {
  constructor(viewer, comparison, times) {
    Object.assign(this, {viewer, times, depth: ghostDepth(), edges: edgeSurface()});
    this.folder = viewer.scene_tree.find(["ghosts"]).object;
    this.round = ghostSurface(true, [1, 1]);
    this.faced = ghostSurface(false, [0.3, 1]);
    this.soft = ghostSurface(false, [0.55, 0.55]); // no two facets of a flexible body have the same curvature
    this.nodes = new Map();
    this.softBodies = [];
    this.turns = new Set(comparison.ghosts.map(({name}) => name)); // bodies that have an attitude
    this.edgesOf = new Map(); // by geometry: equal shapes share them
    comparison.ghosts.forEach((entry) => this.addBody(entry));
    comparison.softBodies.forEach((entry) => this.addSoftBody(entry));
  }

  /* What run A draws of a body. */
  drawn(key) { return this.viewer.scene_tree.find(["bodies", key, "<object>"]).object; }

  addBody({name, key, shape, octants, position, quaternion}) {
    const node = this.viewer.scene_tree.find(["ghosts", key]).object;
    if (shape >= 0) {
      const {geometry} = this.drawn(key).children[0];
      if (!this.edgesOf.has(geometry)) { this.edgesOf.set(geometry, new THREE.EdgesGeometry(geometry, CREASE)); }
      this.put(key, geometry, octants ? this.round : this.faced, this.edgesOf.get(geometry));
    }
    node.position.fromArray(position);
    node.quaternion.fromArray(quaternion);
    this.nodes.set(name, node);
  }

  addSoftBody({name, key}) {
    const node = this.viewer.scene_tree.find(["ghosts", key]).object, own = this.drawn(key).geometry;
    const geometry = new THREE.BufferGeometry();
    geometry.setIndex(own.index);
    geometry.setAttribute("position", own.attributes.position.clone());
    this.softBodies.push({geometry, frames: node.frames, times: this.times});
    this.put(key, geometry, this.soft, borderOf(geometry));
    this.nodes.set(name, node);
  }

  put(key, geometry, surface, edges) {
    const parts = [new THREE.Mesh(geometry, this.depth), new THREE.Mesh(geometry, surface), new THREE.LineSegments(edges, this.edges)];
    const ghost = new THREE.Group();
    parts.forEach((part, pass) => {
      part.renderOrder = 1 + 0.1 * pass; // after the ground, before the arrows
      part.frustumCulled = false;
      ghost.add(part);
    });
    this.viewer.set_object(["ghosts", key], ghost);
  }

  castShadows(on) {
    this.folder.traverse((part) => { if (part.isMesh) { part.castShadow = on; } });
  }

  show(frame, time) { this.softBodies.forEach((each) => SoftBody.prototype.show.call(each, frame, time)); }
}
