/* Lengths, times and colours as people read them. */

const LENGTHS = [[1, "m"], [1e-3, "mm"], [1e-6, "µm"], [1e-9, "nm"]];
const NOTHING = 1e-10; // m
const INFINITE = "lost"; // what is infinitely far away

/* A length, m, with up to three digits. */
function lengthText(value) {
  if (value === null || value === undefined) { return "…"; }
  if (!Number.isFinite(value)) { return INFINITE; }
  if (value < NOTHING) { return value === 0 ? "0" : "< 0.1 nm"; }
  const [factor, unit] = LENGTHS.find(([factor]) => value >= 0.9995 * factor) ?? LENGTHS[LENGTHS.length - 1];
  return `${Number((value / factor).toPrecision(value / factor < 100 ? 2 : 3))} ${unit}`;
}

function secondsText(value) {
  if (value < 1e-3) { return "< 1 ms"; }
  return value >= 10 ? `${Math.round(value)} s` : `${Number(value.toPrecision(2))} s`;
}

function timesText(ratio) {
  return ratio >= 1000 ? `${Number(ratio.toPrecision(1)).toLocaleString("en")}×` : `${Number(ratio.toPrecision(2))}×`;
}

function colourOf(run) {
  return `var(--${run.kind === "preset" ? run.name : run.kind})`;
}

/* The value of a colour that the style sheet gives a run. */
function hexOf(run) {
  return getComputedStyle(document.documentElement).getPropertyValue(colourOf(run).slice(4, -1)).trim();
}

function make(kind, className = "", text = "") {
  const element = document.createElement(kind);
  if (className) { element.className = className; }
  element.textContent = text;
  return element;
}

function makeSvg(kind, attributes = {}, text = "") {
  const element = document.createElementNS("http://www.w3.org/2000/svg", kind);
  for (const [name, value] of Object.entries(attributes)) { element.setAttribute(name, value); }
  element.textContent = text;
  return element;
}

/* Text with its lengths and times in bold. */
function emphasize(element, text) {
  element.replaceChildren(...text.split(/((?<![\d./])\d[\d.]* (?:nm|µm|mm|m|s)\b)/).map((part, k) => (k % 2 ? make("b", "", part) : part)));
}
