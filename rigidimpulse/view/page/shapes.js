/* Bodies as they are simulated: the faces and edges that collide, where what is drawn is another mesh. */

const FLAT_EDGE = 1; // degrees, from which an edge of the collision shape is drawn: all but those inside flat faces
const ROUND_EDGE = 25; // the same where round bodies collide, whose corners are only drawn: 16 of them at least
const SIMULATED_EDGE = "#17222c";

class SimulatedShapes {
  constructor(stage, manifest, geometries) {
    Object.assign(this, {stage, geometries, shown: false, built: null});
    this.bodies = manifest.bodies.filter(({shape}) => shape >= 0);
    this.differ = this.bodies.some(({rendered}) => rendered >= 0);
  }

  /* Once it is asked for: beside the mesh that is drawn of each body, the one that collides. */
  build() {
    const edges = new THREE.LineBasicMaterial({color: linearColour(SIMULATED_EDGE), transparent: true, opacity: 0.8, toneMapped: false});
    const edgesOf = new Map(); // by number: equal shapes share them
    return this.bodies.map((body) => {
      const own = this.stage.meshOf.get(body.name), geometry = this.geometries[body.shape];
      const mesh = this.stage.makeMesh(body, geometry);
      Object.assign(mesh.material, {flatShading: body.faceted, polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1});
      if (!edgesOf.has(body.shape)) { edgesOf.set(body.shape, new THREE.EdgesGeometry(geometry, body.faceted ? FLAT_EDGE : ROUND_EDGE)); }
      mesh.add(new THREE.LineSegments(edgesOf.get(body.shape), edges));
      own.parent.add(mesh);
      return {own, mesh};
    });
  }

  turn(on) {
    this.built ??= this.build();
    this.shown = on;
    for (const {own, mesh} of this.built) {
      own.visible = !on;
      mesh.visible = on;
    }
  }
}
