/* Numbers as people read them. */

const DIGITS = 4, VECTOR_DIGITS = 3;

/* A number with four digits. */
function digits(value, count = DIGITS) {
  const size = Math.abs(value);
  if (!(size > 0)) { return value === 0 ? "0" : "\u2013"; }
  let text = value.toPrecision(count);
  if (size >= 1e7 || size < 1e-4) {
    const [figure, power] = value.toExponential(count - 1).split("e");
    text = `${figure}e${Number(power)}`;
  } else if (text.includes("e")) {
    text = String(Number(text));
  }
  return text.replaceAll("-", "\u2212");
}

/* A vector whose components have the decimals of three digits of the largest one. */
function vectorText(vector, least = 0) {
  const largest = Math.max(...vector.map(Math.abs));
  if (!(largest > least)) { return "(0, 0, 0)"; }
  if (largest >= 1e7 || largest < 1e-4) { return `(${vector.map((part) => digits(part, 3)).join(", ")})`; }
  const decimals = Math.min(Math.max(VECTOR_DIGITS - 1 - Math.floor(Math.log10(largest)), 0), 8);
  const texts = vector.map((part) => part.toFixed(decimals)).map((text) => (Number(text) === 0 ? "0" : text.replace("-", "\u2212")));
  return `(${texts.join(", ")})`;
}
