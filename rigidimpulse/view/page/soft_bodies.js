/* Flexible bodies: one mesh each, whose vertices are written again for each picture, on straight lines between frames. */

const DRAPE = 400; // steps of depth by which cloth is drawn nearer: its faces cut into round bodies between its vertices

class SoftBody {
  constructor(viewer, entry, number, times) {
    const path = ["softBodies", String(number)];
    const {frames} = viewer.scene_tree.find(path).object;
    this.geometry = viewer.scene_tree.find([...path, "<object>"]).object.geometry;
    this.frames = frames;
    this.times = times;
    this.surface = makeSurface(entry.surface, this.geometry);
    Object.assign(this.surface, {side: THREE.DoubleSide, polygonOffset: entry.thin, polygonOffsetUnits: -DRAPE});
    const mesh = new THREE.Mesh(this.geometry, this.surface);
    mesh.castShadow = true;
    mesh.receiveShadow = true;
    mesh.frustumCulled = false;
    viewer.set_object(["bodies", entry.key], mesh);
    this.show(0, times[0]);
  }

  /* `frame` is the one at or before the time. */
  show(frame, time) {
    const position = this.geometry.attributes.position, target = position.array, size = target.length;
    const next = Math.min(frame + 1, this.times.length - 1), span = this.times[next] - this.times[frame];
    const share = span > 0 ? Math.min(Math.max((time - this.times[frame]) / span, 0), 1) : 0;
    for (let i = 0, a = frame * size, b = next * size; i < size; i++) {
      target[i] = this.frames[a + i] + share * (this.frames[b + i] - this.frames[a + i]);
    }
    position.needsUpdate = true;
    this.geometry.computeVertexNormals();
  }
}

/* The flexible bodies of a page; meshcat's own meshes of them are taken away. */
function makeSoftBodies(viewer, entries, times) {
  const softBodies = entries.map((entry, number) => new SoftBody(viewer, entry, number, times));
  if (softBodies.length > 0) { viewer.delete_path(["softBodies"]); }
  return softBodies;
}
