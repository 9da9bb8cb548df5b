/* The numbers of pages of many runs: one block, gzip in base64, and the shapes that lie in it. */

async function readBlock(packed) {
  const bytes = Uint8Array.from(atob(packed), (letter) => letter.charCodeAt(0));
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).arrayBuffer();
}

function makeGeometry(buffer, [vertices, normals, faces, colours]) {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(buffer, ...vertices), 3));
  geometry.setAttribute("normal", new THREE.BufferAttribute(new Float32Array(buffer, ...normals), 3));
  if (colours) { geometry.setAttribute("color", new THREE.BufferAttribute(new Float32Array(buffer, ...colours), 3)); }
  geometry.setIndex(new THREE.BufferAttribute(new Uint32Array(buffer, ...faces), 1));
  return geometry;
}
