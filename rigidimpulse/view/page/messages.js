/* Where bodies and their motion come from: meshcat's messages. `glb.js` has the same members for large recordings. */

const motionSource = {
  /* Display geometries by number. meshcat builds them from its own messages; we keep them and make the meshes ourselves. */
  async geometries(viewer, manifest, send) {
    send((kind) => kind === "shape");
    const geometries = [];
    for (let i = 0; i < manifest.numShapes; i++) {
      geometries.push(viewer.scene_tree.find(["shapes", String(i), "<object>"]).object.geometry);
    }
    if (geometries.length > 0) { viewer.delete_path(["shapes"]); }
    return geometries;
  },

  /* Sets the bodies of the stage in motion. */
  animate(viewer, stage, send) { send((kind) => kind === "motion"); },

  /* Whether a node is one of those that are animated. */
  moves(viewer, node, roots) { return roots.has(node); },

  /* Tracks of the node of a body, by property. */
  tracks(viewer, node) {
    const action = viewer.animator.actions.find((each) => each.getRoot() === node), found = {};
    for (const track of action ? action.getClip().tracks : []) { found[track.name.slice(1)] = track; }
    return found;
  },
};
