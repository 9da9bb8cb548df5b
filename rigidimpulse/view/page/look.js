/* The look: renderer, sky, light, ground and the surfaces of bodies. Colours are written as people see them (sRGB). */

const SKY = {zenith: "#6397d2", horizon: "#f4efe8", nadir: "#b9bdc1"};
const KEY_DIRECTION = new THREE.Vector3(-0.55, 1.0, 0.42).normalize(); // from the scene to the key light, Y up
const SHADOW_MAP_SIZE = 2048;

function linearColour(hex) {
  return new THREE.Color(hex).convertSRGBToLinear();
}

function dressRenderer(renderer) {
  renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
  renderer.outputEncoding = THREE.sRGBEncoding;
  renderer.toneMapping = THREE.ACESFilmicToneMapping;
  renderer.toneMappingExposure = 1.05;
  renderer.physicallyCorrectLights = true;
  renderer.shadowMap.type = THREE.PCFShadowMap; // the only filter of this three.js whose width can be chosen
}

/* A dome at infinity. It writes screen colours, so it passes by the tone mapping. */
function makeSky() {
  const material = new THREE.ShaderMaterial({
    side: THREE.BackSide,
    depthTest: false,
    depthWrite: false,
    toneMapped: false,
    uniforms: {
      zenith: {value: new THREE.Color(SKY.zenith)},
      horizon: {value: new THREE.Color(SKY.horizon)},
      nadir: {value: new THREE.Color(SKY.nadir)},
    },
    vertexShader: `
      varying vec3 direction;
      void main() {
        direction = position;
        gl_Position = (projectionMatrix * vec4(mat3(viewMatrix) * position, 1.0)).xyww;
      }`,
    fragmentShader: `
      uniform vec3 zenith, horizon, nadir;
      varying vec3 direction;
      void main() {
        float height = normalize(direction).y;
        vec3 colour = mix(horizon, zenith, smoothstep(0.0, 0.22, height));
        colour = mix(colour, nadir, smoothstep(0.0, 0.35, -height));
        float noise = fract(52.9829189 * fract(dot(gl_FragCoord.xy, vec2(0.06711056, 0.00583715)))) - 0.5;
        gl_FragColor = vec4(colour + noise / 255.0, 1.0); // the noise hides the bands of an 8-bit gradient
      }`,
  });
  const sky = new THREE.Mesh(new THREE.SphereGeometry(1, 48, 32), material);
  sky.frustumCulled = false;
  sky.renderOrder = -1;
  return sky;
}

/* What shiny surfaces mirror: a bright overcast room with a large soft box overhead and a strip at the side. */
function makeEnvironment(renderer) {
  const room = new THREE.Scene();
  const walls = new THREE.SphereGeometry(10, 32, 24);
  const colours = [];
  for (let i = 0; i < walls.attributes.position.count; i++) {
    const height = walls.attributes.position.getY(i) / 10;
    const colour = linearColour(SKY.horizon).lerp(linearColour(height > 0 ? SKY.zenith : "#8d8a86"), Math.abs(height));
    colours.push(colour.r, colour.g, colour.b);
  }
  walls.setAttribute("color", new THREE.Float32BufferAttribute(colours, 3));
  room.add(new THREE.Mesh(walls, new THREE.MeshBasicMaterial({vertexColors: true, side: THREE.BackSide})));
  for (const [width, height, brightness, position] of [
    [7, 5, 7, [-3, 8, 2]],
    [2, 7, 4, [8, 3, -3]],
    [6, 1.5, 3, [2, 2.5, 9]],
  ]) {
    const colour = new THREE.Color(1, 1, 1).multiplyScalar(brightness);
    const panel = new THREE.Mesh(
      new THREE.PlaneGeometry(width, height), new THREE.MeshBasicMaterial({color: colour, side: THREE.DoubleSide}));
    panel.position.set(...position);
    panel.lookAt(0, 0, 0);
    room.add(panel);
  }
  const generator = new THREE.PMREMGenerator(renderer);
  const texture = generator.fromScene(room, 0.03).texture;
  generator.dispose();
  return texture;
}

/* Key light with shadows, its frustum fitted to a ball of `radius` about `centre` (recorded frame). */
function makeKeyLight(stage, centre, radius) {
  const light = new THREE.DirectionalLight(0xffecd2, 3.6);
  const direction = KEY_DIRECTION.clone().applyQuaternion(stage.clone().invert());
  light.castShadow = true;
  light.shadow.mapSize.set(SHADOW_MAP_SIZE, SHADOW_MAP_SIZE);
  light.shadow.radius = 3.5;
  light.shadow.normalBias = (2.5 * 2 * radius) / SHADOW_MAP_SIZE;
  light.shadow.bias = -0.0002;
  Object.assign(light.shadow.camera, {
    left: -radius, right: radius, top: radius, bottom: -radius, near: 0.1 * radius, far: 6 * radius});
  light.aimAt = (point) => {
    light.target.position.copy(point);
    light.position.copy(point).addScaledVector(direction, 3 * radius);
    light.target.updateMatrixWorld();
  };
  light.aimAt(centre);
  return light;
}

/* The face of a half space: a plane (its own xy) with a grid, which dissolves into the sky `reach` away from `centre`. */
function makeGround(spacing, reach, opacity) {
  const uniforms = {
    centre: {value: new THREE.Vector2()}, spacing: {value: spacing}, reach: {value: reach},
    line: {value: linearColour("#5d6b78")},
  };
  const material = new THREE.MeshStandardMaterial({
    color: linearColour("#b3b8bd"), roughness: 0.9, metalness: 0, envMapIntensity: 0.55, transparent: true, opacity,
    depthWrite: false});
  material.onBeforeCompile = (shader) => {
    Object.assign(shader.uniforms, uniforms);
    shader.vertexShader = shader.vertexShader
      .replace("#include <common>", "#include <common>\nuniform vec2 centre;\nvarying vec2 plane;")
      .replace("#include <begin_vertex>", "#include <begin_vertex>\nplane = position.xy + centre;");
    shader.fragmentShader = shader.fragmentShader
      .replace("#include <common>", `#include <common>
        uniform vec2 centre;
        uniform vec3 line;
        uniform float spacing, reach;
        varying vec2 plane;
        float grid(float step, float width) { // 1 on a line; lines thinner than a pixel fade instead of flickering
          vec2 cell = plane / step, pixel = fwidth(cell);
          vec2 wide = max(vec2(width), 1.3 * pixel);
          vec2 on = 1.0 - smoothstep(0.5 * wide, 0.5 * wide + pixel, abs(fract(cell - 0.5) - 0.5));
          on *= clamp(width / wide, 0.0, 1.0) * (1.0 - smoothstep(0.25, 0.6, pixel));
          return max(on.x, on.y);
        }`)
      .replace("#include <color_fragment>", `#include <color_fragment>
        float away = distance(plane, centre) / reach;
        float lines = max(0.34 * grid(spacing, 0.007), 0.55 * grid(5.0 * spacing, 0.003)) * (1.0 - smoothstep(0.1, 0.7, away));
        diffuseColor.rgb = mix(diffuseColor.rgb, line, lines);
        diffuseColor.a *= 1.0 - smoothstep(0.12, 1.0, away);`);
  };
  const face = new THREE.Mesh(new THREE.PlaneGeometry(2 * reach, 2 * reach), material);
  face.receiveShadow = true;
  const ground = new THREE.Group();
  ground.add(face);
  ground.centreOn = (x, y) => {
    uniforms.centre.value.set(x, y);
    face.position.set(x, y, 0);
  };
  return ground;
}

/* Round bodies are painted in octants, else one could not see them spin. */
function paintOctants(material) {
  material.onBeforeCompile = (shader) => {
    shader.vertexShader = shader.vertexShader
      .replace("#include <common>", "#include <common>\nvarying vec3 local;")
      .replace("#include <begin_vertex>", "#include <begin_vertex>\nlocal = position;");
    shader.fragmentShader = shader.fragmentShader
      .replace("#include <common>", "#include <common>\nvarying vec3 local;")
      .replace("#include <color_fragment>", `#include <color_fragment>
        vec3 sides = clamp(local / max(fwidth(local), 1e-12), -1.0, 1.0);
        float octant = 0.5 + 0.5 * sides.x * sides.y * sides.z;
        diffuseColor.rgb = mix(diffuseColor.rgb, mix(diffuseColor.rgb, vec3(0.9), 0.72), octant);`);
  };
}

function makeSurface(surface) {
  const material = new THREE.MeshPhysicalMaterial({
    color: linearColour(surface.color), roughness: surface.roughness, metalness: surface.metalness,
    clearcoat: surface.clearcoat, clearcoatRoughness: 0.25, envMapIntensity: 0.75});
  if (surface.octants) {
    paintOctants(material);
  }
  return material;
}
