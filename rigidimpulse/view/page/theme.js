/* Light and dark. The colours that canvases and the scene use are those of the style sheet; who draws with them is told when they change. */

const reducedMotion = window.matchMedia("(prefers-reduced-motion: reduce)").matches;

const theme = {
  listeners: [],
  values: {},

  get dark() { return document.documentElement.dataset.theme === "dark"; },

  /* A colour of the style sheet, by its name there. */
  colour(name) {
    this.values[name] ??= getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
    return this.values[name];
  },

  /* Ink of a strength from 0 to 1. */
  ink(strength) { return `rgba(${this.colour("ink-rgb")}, ${strength})`; },

  set(dark) {
    document.documentElement.dataset.theme = dark ? "dark" : "light";
    this.values = {};
    this.listeners.forEach((listener) => listener());
  },

  /* Follows the system until somebody chooses. */
  follow() {
    const system = window.matchMedia("(prefers-color-scheme: dark)");
    this.set(system.matches);
    system.addEventListener("change", () => this.set(system.matches));
  },
};
theme.follow();
