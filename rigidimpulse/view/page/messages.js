/* Where nodes of bodies and their motion come from: meshcat's tree and messages. `glb.js` has the same members for large recordings. */

const motionSource = {
  /* Puts an object into a folder and returns the node that moves it. */
  place(viewer, folder, key, object) {
    viewer.set_object([folder, key], object);
    return viewer.scene_tree.find([folder, key]).object;
  },

  /* Sets the bodies of the stage in motion. */
  animate(viewer, stage, send) { send((kind) => kind === "motion"); },

  /* Tracks of a node, by property; none if it stands still. */
  tracks(viewer, node) {
    const action = viewer.animator.actions.find((each) => each.getRoot() === node), found = {};
    for (const track of action ? action.getClip().tracks : []) { found[track.name.slice(1)] = track; }
    return found;
  },
};
