/* The look: renderer, sky, light, ground and the surfaces of bodies. Colours are written as people see them (sRGB). */

const SKY = {zenith: "#6397d2", horizon: "#f4efe8", nadir: "#b9bdc1"};
const KEY_DIRECTION = new THREE.Vector3(-0.55, 1.0, 0.42).normalize(); // from the scene to the key light, Y up
const SHADOW_MAP_SIZE = 2048;
const DARKER = 0.75; // lines of ground that has a colour of its own, against it

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

/* A dome at infinity. It writes screen colours, so it passes by the tone mapping; `paint(colours)` of its result changes them. */
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
  sky.paint = (colours) => Object.entries(colours).forEach(([name, colour]) => material.uniforms[name].value.set(colour));
  return sky;
}

/* What surfaces mirror: a bright room with a large soft box overhead, a strip at the side and one in front. It is a
   formula, not a picture: a picture would have to be blurred for every roughness first, which takes a machine without
   a graphics card ten seconds. A panel lies around the direction `at`; roughness blurs its edges and thins its
   light. */
const ROOM = `
  float panel(vec3 ray, vec3 at, vec2 size, float blur) {
    float ahead = dot(ray, at);
    vec3 aside = normalize(cross(vec3(0.0, 0.0, 1.0), at));
    vec2 place = abs(vec2(dot(ray, aside), dot(ray, cross(at, aside)))) / max(ahead, 1e-3);
    vec2 inside = 1.0 - smoothstep(size - blur, size + blur, place);
    vec2 thin = size / (size + 0.5 * blur);
    return ahead > 0.0 ? inside.x * inside.y * thin.x * thin.y : 0.0;
  }
  vec3 roomRadiance(vec3 ray, float roughness) {
    float blur = 0.03 + 1.2 * roughness * roughness;
    float above = smoothstep(-0.05 - blur, 0.05 + 0.5 * blur, ray.y);
    vec3 light = mix(vec3(0.27, 0.26, 0.25), vec3(0.84, 0.82, 0.78), above);
    light = mix(light, vec3(0.30, 0.43, 0.62), 0.8 * smoothstep(0.0, 1.0, ray.y));
    light += 6.0 * panel(ray, normalize(vec3(-0.36, 0.93, 0.2)), vec2(0.42, 0.3), blur);
    light += 3.5 * panel(ray, normalize(vec3(0.88, 0.33, -0.33)), vec2(0.12, 0.42), blur);
    light += 2.5 * panel(ray, normalize(vec3(0.2, 0.28, 0.94)), vec2(0.3, 0.09), blur);
    return light;
  }
  vec3 roomIrradiance(vec3 normal) {
    vec3 light = mix(vec3(0.9, 0.87, 0.83), vec3(1.55, 1.65, 1.8), 0.5 + 0.5 * normal.y);
    light += 0.8 * max(dot(normal, vec3(-0.36, 0.93, 0.2)), 0.0);
    return light + 0.5 * max(dot(normal, vec3(0.5, 0.3, 0.8)), 0.0);
  }`;

/* Lets a physical material see the room, `strength` of it. */
function seeRoom(shader, strength) {
  shader.fragmentShader = shader.fragmentShader
    .replace("#include <common>", `#include <common>\n${ROOM}`)
    .replace("#include <lights_fragment_maps>", `#include <lights_fragment_maps>
      vec3 mirrored = inverseTransformDirection(reflect(-geometry.viewDir, geometry.normal), viewMatrix);
      iblIrradiance += ${strength} * roomIrradiance(inverseTransformDirection(geometry.normal, viewMatrix));
      // Rough surfaces mirror less than the formula has it: the top of a black box was grey.
      radiance += ${strength} * (1.0 - 0.7 * material.roughness) * roomRadiance(mirrored, material.roughness);
      #ifdef USE_CLEARCOAT
        clearcoatRadiance += ${strength} * roomRadiance(mirrored, material.clearcoatRoughness);
      #endif`);
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

/* The face of a half space: a plane (its own xy) with a grid, which dissolves into the sky `reach` from `centre`. */
function makeGround(spacing, reach, opacity) {
  const uniforms = {
    centre: {value: new THREE.Vector2()}, spacing: {value: spacing}, reach: {value: reach},
    line: {value: linearColour("#5d6b78")},
  };
  const material = new THREE.MeshStandardMaterial({
    color: linearColour("#b3b8bd"), roughness: 0.9, metalness: 0, transparent: true, opacity,
    depthWrite: false});
  material.onBeforeCompile = (shader) => {
    seeRoom(shader, "0.55");
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
        float lines = max(0.5 * grid(spacing, 0.009), 0.75 * grid(5.0 * spacing, 0.004));
        lines *= 1.0 - smoothstep(0.1, 0.7, away);
        diffuseColor.rgb = mix(diffuseColor.rgb, line, lines);
        diffuseColor.a *= 1.0 - smoothstep(0.12, 1.0, away);`);
  };
  const face = new THREE.Mesh(new THREE.PlaneGeometry(2 * reach, 2 * reach), material);
  face.receiveShadow = true;
  const ground = new THREE.Group();
  ground.add(face);
  ground.paint = (face, line) => {
    material.color.copy(linearColour(face));
    uniforms.line.value.copy(linearColour(line));
  };
  ground.centreOn = (x, y) => {
    uniforms.centre.value.set(x, y);
    face.position.set(x, y, 0);
  };
  return ground;
}

/* The lines of ground that has a colour of its own. */
function darker(hex) {
  return `#${new THREE.Color(hex).multiplyScalar(DARKER).getHexString()}`;
}

/* Round bodies are painted in octants, else one could not see them spin. */
function paintOctants(shader) {
  shader.vertexShader = shader.vertexShader
    .replace("#include <common>", "#include <common>\nvarying vec3 local;")
    .replace("#include <begin_vertex>", "#include <begin_vertex>\nlocal = position;");
  shader.fragmentShader = shader.fragmentShader
    .replace("#include <common>", "#include <common>\nvarying vec3 local;")
    .replace("#include <color_fragment>", `#include <color_fragment>
      vec3 sides = clamp(local / max(fwidth(local), 1e-12), -1.0, 1.0);
      float octant = 0.5 + 0.5 * sides.x * sides.y * sides.z;
      diffuseColor.rgb = mix(diffuseColor.rgb, mix(diffuseColor.rgb, vec3(0.9), 0.72), octant);`);
}

/* A mesh with colours of its own shows them on a body that is painted. */
function makeSurface(surface, geometry) {
  const painted = surface.painted && geometry.getAttribute("color") !== undefined;
  const material = new THREE.MeshPhysicalMaterial({
    color: painted ? 0xffffff : linearColour(surface.color), vertexColors: painted, roughness: surface.roughness, metalness: surface.metalness,
    clearcoat: surface.clearcoat, clearcoatRoughness: 0.25, side: surface.open ? THREE.DoubleSide : THREE.FrontSide});
  material.onBeforeCompile = (shader) => {
    seeRoom(shader, "0.8");
    if (surface.octants) { paintOctants(shader); }
  };
  material.customProgramCacheKey = () => (surface.octants ? "octants" : "plain");
  return material;
}

/* Right and up of a camera that looks against `back`. */
function acrossAndUp(back) {
  const right = new THREE.Vector3(0, 1, 0).cross(back).normalize();
  return {right, over: back.clone().cross(right)};
}

/* The nearest view along `back` of all points of an outline: the point in its middle, and the distance from there. tall, wide: tangents
   of half the field of view. Each round centres the picture of the outline and then steps back as far as needed. */
function nearestView(outline, back, tall, wide, margin, distance) {
  const {right, over} = acrossAndUp(back), target = new THREE.Vector3();
  const points = outline.map((point) => new THREE.Vector3().fromArray(point));
  const middle = (values) => (Math.min(...values) + Math.max(...values)) / 2;
  for (let round = 0; round < 4; round++) {
    const seen = points.map((point) => {
      const from = point.clone().sub(target);
      return {across: from.dot(right), up: from.dot(over), near: from.dot(back)};
    });
    distance = Math.max(...seen.map(({across, up, near}) => near + margin * Math.max(Math.abs(across) / wide, Math.abs(up) / tall)));
    target.addScaledVector(right, distance * middle(seen.map(({across, near}) => across / (distance - near))));
    target.addScaledVector(over, distance * middle(seen.map(({up, near}) => up / (distance - near))));
  }
  return {target, distance};
}
