/* Where nodes of bodies and their motion come from in a large recording: a glTF file, and three.js without meshcat's tree, whose
   panel has a folder for every node. The file is one that this library wrote: one animation, of float32 keys on straight lines. */

const COMPONENTS = {SCALAR: 1, VEC3: 3, VEC4: 4};
const TRACKS = {
  translation: ["position", THREE.VectorKeyframeTrack],
  rotation: ["quaternion", THREE.QuaternionKeyframeTrack],
};

/* JSON and data of a .glb file. */
function glbChunks(file) {
  const view = new DataView(file.buffer, file.byteOffset, file.byteLength), size = view.getUint32(12, true);
  return {
    tree: JSON.parse(new TextDecoder().decode(file.subarray(20, 20 + size))),
    data: file.slice(28 + size), // a copy of its own, where floats lie at multiples of four bytes
  };
}

const motionSource = {
  byNode: new Map(),

  /* Puts an object into a folder and returns it: it moves itself. */
  place(viewer, folder, key, object) {
    viewer.scene_tree.find([folder]).object.add(object);
    return object;
  },

  /* Sets the bodies of the stage in motion. */
  animate(viewer, stage, send) {
    send((kind) => kind === "glb");
    const holder = viewer.scene_tree.find(["motion"]).object, {tree, data} = glbChunks(holder.file), views = new Map();
    delete holder.file;
    const values = (index) => {
      if (!views.has(index)) {
        const {bufferView, byteOffset = 0, count, type} = tree.accessors[index];
        const start = (tree.bufferViews[bufferView].byteOffset ?? 0) + byteOffset;
        views.set(index, new Float32Array(data.buffer, start, count * COMPONENTS[type]));
      }
      return views.get(index);
    };
    const [{channels, samplers}] = tree.animations, tracks = [];
    for (const {sampler, target} of channels) {
      const node = stage.nodes.get(tree.nodes[target.node].name), [property, Track] = TRACKS[target.path];
      const track = new Track(`${node.uuid}.${property}`, values(samplers[sampler].input), values(samplers[sampler].output));
      tracks.push(track);
      if (!this.byNode.has(node)) { this.byNode.set(node, {}); }
      this.byNode.get(node)[property] = track;
    }
    const animator = viewer.animator;
    animator.mixer = new THREE.AnimationMixer(viewer.scene);
    const action = animator.mixer.clipAction(new THREE.AnimationClip("motion", -1, tracks));
    action.setLoop(THREE.LoopRepeat, 1);
    action.clampWhenFinished = true; // as meshcat has it: the end of the run is not its start
    animator.actions = [action];
  },

  /* Tracks of a node, by property; none if it stands still. */
  tracks(viewer, node) { return this.byNode.get(node) ?? {}; },
};
