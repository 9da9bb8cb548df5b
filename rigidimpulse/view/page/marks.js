/* What is written over the scene: the value of an arrow, the parts of the selected impulse with its normal, and the scale bar. */

const SCALE_WIDTH = [36, 100]; // pixels of a scale bar
const NORMAL_REACH = 1.5; // of the longest arrow: how far the line of the normal is drawn
const LEAST_APART = 48; // pixels between two labels
const LABEL_GAP = 14; // pixels between an arrow and what is written at it

class Marks {
  constructor(viewer, stage, arrowScale, longest) {
    Object.assign(this, {viewer, stage, arrowScale, longest, chosen: null, hovered: null});
    this.object = new THREE.Group();
    const pair = (name) => themedPair(arrowGeometry(), this.object, 1, name);
    this.normalArrow = pair("hit");
    this.frictionArrow = pair("amber");
    this.line = new THREE.Line(new THREE.BufferGeometry(), new THREE.LineDashedMaterial({depthTest: false, transparent: true, toneMapped: false}));
    this.line.renderOrder = 3;
    this.line.frustumCulled = false;
    this.object.add(this.line);
    theme.listeners.push(() => this.paint());
    this.paint();
    this.choose(null);
  }

  paint() { this.line.material.color.set(theme.colour("ink")); }

  /* Draws the impulse of an impact apart: normal and friction part, on body b if that can be pushed, else on a. */
  choose(impact) {
    this.chosen = impact;
    this.object.visible = impact !== null;
    if (impact === null) { return; }
    const sign = impact.sides[1].mass !== null ? 1 : -1, point = new THREE.Vector3(...impact.point);
    const normal = new THREE.Vector3(...impact.normal).multiplyScalar(sign), slip = new THREE.Vector3(...impact.tangent_impulse).multiplyScalar(sign);
    const least = 0.06 * this.longest, push = Math.max(this.arrowScale * impact.impulse, least), drag = this.arrowScale * impact.friction;
    this.normalEnd = point.clone().addScaledVector(normal, push);
    this.frictionEnd = drag > 0.02 * least ? point.clone().addScaledVector(slip.normalize(), Math.max(drag, least)) : null;
    setArrow(this.normalArrow, point, this.normalEnd, 0.06 * this.longest);
    setArrow(this.frictionArrow, point, this.frictionEnd, 0.05 * this.longest);
    const reach = NORMAL_REACH * Math.max(push, 0.5 * this.longest), top = point.clone().addScaledVector(normal, reach);
    this.line.geometry.setFromPoints([point, top]);
    this.line.material.dashSize = this.line.material.gapSize = reach / 24;
    this.line.computeLineDistances();
    this.normalTop = top;
  }

  hover(arrow, impacts) {
    const card = arrow ? arrow.card : -1;
    if (card === this.hovered?.index) { return; }
    this.hovered = card < 0 ? null : {...impacts.get(card), end: arrow.end};
    this.viewer.set_dirty();
  }

  /* Pixel of a point of the recorded frame; null behind the camera. */
  pixel(point) {
    const seen = point.clone().applyQuaternion(this.stage.turn).project(this.viewer.camera);
    return seen.z > 1 ? null : [(0.5 + 0.5 * seen.x) * window.innerWidth, (0.5 - 0.5 * seen.y) * window.innerHeight];
  }

  put(id, text, point, room) {
    const label = element(id), pixel = point ? this.pixel(point) : null;
    label.hidden = pixel === null;
    if (pixel === null) { return; }
    if (label.textContent !== text) { label.textContent = text; }
    const half = label.offsetWidth / 2, [x, y] = pixel;
    const left = Math.min(Math.max(x, room.left + half + 4), room.right - half - 4), top = Math.min(Math.max(y, room.top + 14), room.bottom - 14);
    label.style.transform = `translate(-50%, -50%) translate(${left}px, ${top}px)`;
  }

  /* With every picture. */
  show() {
    const {room} = this.stage, {chosen, hovered} = this;
    this.viewer.camera.updateWorldMatrix(true, false); // the picture that is drawn next has it, too
    const beyond = (end) => {
      if (!chosen || !end) { return null; }
      const from = new THREE.Vector3(...chosen.point), way = end.clone().sub(from), pixels = this.pixelsAMetre(from);
      return end.clone().addScaledVector(way.normalize(), LABEL_GAP / Math.max(pixels, 1e-9));
    };
    this.put("label-normal", chosen ? `j = ${digits(chosen.impulse)} N\u2009s` : "", beyond(this.normalEnd), room);
    this.put("label-friction", chosen ? `friction ${digits(chosen.friction)} N\u2009s` : "", chosen ? beyond(this.frictionEnd) : null, room);
    const crowded = chosen && this.apart(this.normalTop, this.normalEnd) < LEAST_APART;
    this.put("label-n", "n", chosen && !crowded ? this.normalTop : null, room);
    this.put("label-point", "", chosen ? new THREE.Vector3(...chosen.point) : null, room);
    const seen = hovered && hovered.index !== chosen?.index;
    const size = seen ? Math.hypot(hovered.impulse, hovered.friction) : 0;
    this.put("label-hover", seen ? `${digits(size)} N\u2009s` : "", seen ? hovered.end : null, room);
    this.showScale(room);
  }

  /* Distance of two points in the picture, pixels. */
  apart(one, other) {
    const [a, b] = [this.pixel(one), this.pixel(other)];
    return a && b ? Math.hypot(a[0] - b[0], a[1] - b[1]) : 0;
  }

  pixelsAMetre(point) {
    const {camera} = this.viewer, away = point.clone().applyQuaternion(this.stage.turn).distanceTo(camera.position);
    return window.innerHeight / (2 * Math.tan((camera.fov * Math.PI) / 360) * away);
  }

  /* How long 1 N s, and a length, are at the selected impact, or in the middle of the action. */
  showScale(room) {
    const at = this.chosen ? new THREE.Vector3(...this.chosen.point) : this.stage.recorded(this.viewer.controls.target), pixels = this.pixelsAMetre(at);
    const bar = (id, unit, size) => {
      const value = roundBelow(SCALE_WIDTH[1] / size), box = element(id);
      box.querySelector("span").textContent = withUnit(value, unit, 3);
      box.style.setProperty("--length", `${Math.max(value * size, SCALE_WIDTH[0] * 0.5)}px`);
    };
    const scale = element("scale");
    element("scale-impulse").hidden = !(this.arrowScale > 0);
    if (this.arrowScale > 0) { bar("scale-impulse", "N\u2009s", this.arrowScale * pixels); }
    bar("scale-length", "m", pixels);
    scale.style.left = `${room.left + (window.innerWidth > NARROW ? 24 : 14)}px`;
    scale.style.top = `${room.bottom - 44}px`;
  }
}

/* The largest of 1, 2 and 5 times a power of ten that is not above a value. */
function roundBelow(value) {
  const power = Math.pow(10, Math.floor(Math.log10(value) + 1e-9));
  return power * [5, 2, 1].find((step) => step * power <= value * (1 + 1e-9) || step === 1);
}
