/* Elements of the page: found, made, and what buttons do with them. */

function element(id) { return document.getElementById(id); }

/* An element with text or children; nothing that comes from a recording is ever read as markup. */
function make(tag, {children = [], ...properties} = {}) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (name.includes("-") || name === "role") { made.setAttribute(name, value); } else { made[name] = value; }
  }
  made.append(...[children].flat().filter((child) => child !== null && child !== undefined));
  return made;
}

/* A button that stays down; `set(on)` is told about every change. Returns a function that flips it. */
function makeSwitch(button, set, on) {
  const flip = () => {
    on = !on;
    button.setAttribute("aria-pressed", String(on));
    set(on);
  };
  button.setAttribute("aria-pressed", String(on));
  button.addEventListener("click", flip);
  return flip;
}

/* A button that opens what it controls; escape and a click elsewhere close it. */
function makeMenu(button, menu) {
  const turn = (on) => {
    menu.hidden = !on;
    button.setAttribute("aria-expanded", String(on));
  };
  button.addEventListener("click", () => turn(menu.hidden));
  window.addEventListener("pointerdown", (event) => {
    if (!menu.hidden && !menu.contains(event.target) && !button.contains(event.target)) { turn(false); }
  }, true);
  menu.addEventListener("keydown", (event) => {
    if (event.key === "Escape") {
      turn(false);
      button.focus();
      event.stopPropagation();
    }
  });
  return turn;
}
