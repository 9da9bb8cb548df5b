/* The card of an impact: whom it joins, how large it is, why, and what it does to the bodies. All numbers are those of `impact_cards`. */

const SAME = 1e-3; // relative: what is the same to the digits shown
const ROUND_OFF_SHARE = 1e-9; // of what is beside it: shown as zero
const PART_COLOURS = ["blue", "teal", "violet", "amber", "soft"];

/* A row of terms and values. */
function fact(term, value) { return make("div", {children: [make("dt", {textContent: term}), make("dd", {textContent: value})]}); }

function impactTitle({sides, known, normal, separation_speed: separation, approach_speed: approach}) {
  const [a, b] = sides, along = (side) => side.velocity[0].reduce((sum, part, k) => sum + part * normal[k], 0);
  if (a.mass !== null && b.mass !== null) {
    if (!known) { return `${a.name} and ${b.name}`; }
    const [first, second] = Math.abs(along(a)) >= Math.abs(along(b)) ? [a, b] : [b, a];
    return `${first.name} hits ${second.name}`;
  }
  const [mover, support] = a.mass !== null ? [a, b] : [b, a];
  return `${mover.name} ${separation > SAME * approach ? "hits" : "lands on"} ${support.name}`;
}

/* What adds up below the line of the formula: symbol, value, and what it is. What cannot be pushed adds nothing. */
function formulaParts(impact) {
  const [a, b] = impact.sides, both = a.mass !== null && b.mass !== null;
  const part = (symbol, side, value, words) => ({symbol: side !== "" && both ? `${symbol}_${side}` : symbol, value, words});
  const parts = [
    part("1/m", "a", impact.inverse_mass[0], `mass of ${a.name}`),
    part("1/m", "b", impact.inverse_mass[1], `mass of ${b.name}`),
    part("spin", "a", impact.spin[0], `turning of ${a.name}`),
    part("spin", "b", impact.spin[1], `turning of ${b.name}`),
    part("slip", "", impact.slip, "turning by friction"),
    part("others", "", impact.others, "other points of this impact"),
  ];
  const total = parts.reduce((sum, {value}) => sum + Math.abs(value), 0);
  return parts.filter(({value}) => Math.abs(value) > ROUND_OFF_SHARE * total);
}

/* Letters with what follows "_" below them. */
function symbols(text) {
  return text.split(/(_[ab])/).map((piece) => (piece.startsWith("_") ? make("sub", {textContent: piece.slice(1)}) : piece));
}

function fraction(above, below) {
  return make("span", {className: "fraction", children: [make("span", {children: symbols(above)}), make("span", {children: symbols(below)})]});
}

/* The formula in letters, and again with its numbers. */
function formula(impact) {
  const {impulse, approach_speed: approach, separation_speed: separation, restitution} = impact, speed = approach + separation;
  const rebounds = approach > 0 && Math.abs(separation - restitution * approach) <= SAME * Math.abs(speed);
  const above = rebounds ? ["(1 + e) u", `(1 + ${digits(restitution, 3)}) \u00d7 ${digits(approach)} m/s`]
    : ["u + u\u2032", `${digits(approach)} + ${digits(separation)} m/s`.replace("+ \u2212", "\u2212 ")];
  const known = Number.isFinite(impact.slip), parts = known ? formulaParts(impact) : [];
  const below = known
    ? [parts.map(({symbol}) => symbol).join(" + "), `${parts.map(({value}) => digits(value, 4)).join(" + ").replaceAll("+ \u2212", "\u2212 ")} kg\u207b\u00b9`]
    : ["1/m", `1 / ${digits(impulse / speed)} kg`];
  const spins = parts.some(({symbol}) => symbol.startsWith("spin")), held = impact.sides.find(({mass}) => mass === null);
  const fixed = known && held ? ` ${held.name} cannot be pushed and adds nothing.` : "";
  const said = `j is ${above[0]} over ${below[0]}: ${digits(impulse)} N s is ${above[1]} over ${below[1]}`;
  const lines = [["j", ...[above[0], below[0]]], [digits(impulse), above[1], below[1]]];
  const math = make("div", {className: "formula", role: "math", "aria-label": said, children: lines.map(([left, up, down]) => make("p", {
    children: [make("b", {textContent: left}), " = ", fraction(up, down)]}))});
  return [math, known ? shares(parts) : make("p", {className: "note", textContent:
    "m is what the contact feels of both bodies, with everything that holds them or touches them."}), make("p", {className: "note", textContent:
    `u is the approach speed${rebounds ? "" : ", u\u2032 the separation speed"}${spins ? "; spin = (r \u00d7 n) \u00b7 I\u207b\u00b9 (r \u00d7 n)" : ""}.${fixed}`})];
}

/* How much each part gives way, as a bar. */
function shares(parts) {
  const total = parts.reduce((sum, {value}) => sum + Math.max(value, 0), 0);
  const bar = make("div", {className: "bar", "aria-hidden": "true"}), key = make("ul", {className: "key"});
  parts.forEach(({value, words}, k) => {
    const colour = `var(--${PART_COLOURS[k % PART_COLOURS.length]})`;
    const piece = make("span");
    piece.style.flex = `${Math.max(value, 0) / total}`;
    piece.style.background = colour;
    if (value > 0) { bar.append(piece); } // what takes from the sum is told below the bar
    const entry = make("li", {textContent: `${words}, ${((100 * value) / total).toFixed(0).replace("-", "\u2212")} %`});
    entry.style.setProperty("--line", colour);
    key.append(entry);
  });
  return make("div", {children: [bar, key]});
}

/* Velocities before and after of the bodies that can be pushed. */
function velocities(impact) {
  const head = impact.known ? ["", "before", "after"] : ["", "frame before", "frame after"];
  const header = make("tr", {children: head.map((text) => make(text ? "th" : "td", {textContent: text, ...(text ? {scope: "col"} : {})}))});
  const body = make("tbody"), row = (name, values) => body.append(make("tr", {children: [
    make("th", {scope: "row", textContent: name}), ...values.map((text) => make("td", {textContent: text}))]}));
  for (const {name, mass, velocity, spin} of impact.sides) {
    if (mass === null && [...velocity, ...spin].flat().every((part) => part === 0)) { continue; }
    const least = ROUND_OFF_SHARE * Math.max(...[...velocity, ...spin].flat().map(Math.abs));
    body.append(make("tr", {className: "who", children: make("th", {colSpan: 3, scope: "rowgroup", textContent: name})}));
    row("v, m/s", velocity.map((vector) => vectorText(vector, least)));
    row("\u03c9, rad/s", spin.map((vector) => vectorText(vector, least)));
  }
  return [make("table", {children: [make("caption", {className: "unseen", textContent: "velocities"}), make("thead", {children: header}), body]}),
    impact.known ? null : make("p", {className: "note", textContent:
      "Other forces act on these bodies in this frame, so their velocities at the very instant were not recorded: these are those of the frames around it."})];
}

function facts(impact, others) {
  const {approach_speed: approach, separation_speed: separation} = impact;
  const body = ({name, mass}) => `${name} (${mass === null ? "not pushed" : `${digits(mass)} kg`})`;
  const friction = impact.staticFriction === impact.dynamicFriction ? digits(impact.staticFriction, 3)
    : `${digits(impact.staticFriction, 3)} static, ${digits(impact.dynamicFriction, 3)} sliding`;
  return make("dl", {className: "facts", children: [
    fact("approach speed", `${digits(approach)} m/s`),
    fact("separation speed", Math.abs(separation) <= ROUND_OFF_SHARE * Math.abs(approach) ? "0 m/s" : `${digits(separation)} m/s`),
    fact("bodies", impact.sides.map(body).join(", ")),
    fact("point", `${vectorText(impact.point, 1e-9)} m`),
    fact("normal n", vectorText(impact.normal, 0)),
    fact("friction impulse", `${vectorText(impact.tangent_impulse, ROUND_OFF_SHARE * impact.impulse)} N\u2009s`),
    fact("restitution e", digits(impact.restitution, 3)),
    fact("friction \u03bc", friction),
    Number.isFinite(impact.energy) ? fact("energy lost", `${digits(Math.abs(impact.energy) <= ROUND_OFF_SHARE * impact.impulse * Math.abs(approach) ? 0 : -impact.energy)} J`) : null,
    others > 0 ? fact("at this instant", `${others} more ${others === 1 ? "point" : "points"}`) : null,
  ]});
}

/* Fills the card. `others`: impacts at the same instant besides this one. */
function fillCard(card, impact, place, others) {
  const {impulse, friction, approach_speed: approach, separation_speed: separation} = impact;
  const slips = friction > ROUND_OFF_SHARE * impulse ? `along the normal, and ${digits(friction)} N\u2009s of friction` : "along the normal, without friction";
  const why = approach + separation > ROUND_OFF_SHARE * Math.abs(approach) && approach > 0
    ? [make("h3", {textContent: `Why ${digits(impulse)} N\u2009s`}), ...formula(impact)]
    : [make("p", {className: "note", textContent: "This point did not approach: it is pushed by the others of the same impact."})];
  card.querySelector("#impact-place").textContent = place;
  card.querySelector("#impact-title").textContent = impactTitle(impact);
  card.querySelector("#impact-value").textContent = `${digits(impulse)} N\u2009s`;
  card.querySelector("#impact-friction").textContent = slips;
  const section = (children) => make("div", {className: "section", children});
  card.querySelector("#impact-body").replaceChildren(section(why), section(velocities(impact)), section(facts(impact, others)));
}
