/* What lies over the picture: title, layers, the bar, and the keys. */

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4];

function element(id) { return document.getElementById(id); }

/* A button that stays down; `set(on)` is told about every change. Returns a function that flips it. */
function makeSwitch(button, set, on) {
  const flip = () => {
    on = !on;
    button.setAttribute("aria-pressed", String(on));
    set(on);
  };
  button.setAttribute("aria-pressed", String(on));
  button.addEventListener("click", () => {
    flip();
    button.blur(); // so that the space bar plays instead of pressing it again
  });
  return flip;
}

/* The problems of the run, below its title; a click on one goes to its time. */
function showWarnings(warnings, transport) {
  if (warnings.length === 0) { return; }
  const box = element("warnings"), head = document.createElement("summary"), list = document.createElement("ol");
  head.textContent = `${warnings.length} ${warnings.length === 1 ? "warning" : "warnings"}: look before you use this run`;
  for (const {time, kind, bodies, message} of warnings) {
    const item = document.createElement("li"), go = document.createElement("button");
    const parts = [["b", kind], ["span", bodies], ["p", message]].filter(([, text]) => text);
    go.textContent = time === null ? "" : `${Number(time.toPrecision(4))} s`;
    go.hidden = time === null;
    go.title = "go there";
    go.addEventListener("click", () => { transport.pause(); transport.seek(Math.min(Math.max(time, transport.start), transport.end)); go.blur(); });
    item.append(go, ...parts.map(([tag, text]) => Object.assign(document.createElement(tag), {textContent: text})));
    list.append(item);
  }
  box.append(head, list);
  box.open = window.innerWidth > 820 && window.innerHeight > 500;
  box.hidden = false;
}

function makeLayers(layers) {
  const keys = {};
  for (const {label, key, set, on} of layers) {
    const button = document.createElement("button");
    button.textContent = label;
    button.title = `${label.toLowerCase()} (${key.toUpperCase()})`;
    element("layers").append(button);
    keys[key] = makeSwitch(button, set, on);
  }
  return keys;
}

/* Decimals such that neighbouring frames read differently. */
function clockDecimals(times) {
  const step = (times[times.length - 1] - times[0]) / Math.max(times.length - 1, 1);
  return step > 0 ? Math.min(Math.max(2, Math.ceil(-Math.log10(step)) + 1), 9) : 2;
}

function makeBar(transport, marks) {
  const timeline = new Timeline(element("marks"), transport.times, marks), scrubber = element("scrubber"), decimals = clockDecimals(transport.times);
  scrubber.min = transport.start;
  scrubber.max = transport.end;
  scrubber.addEventListener("input", () => transport.seek(Number(scrubber.value)));
  for (const speed of SPEEDS) {
    element("speed").add(new Option(`${speed}\u00d7`, speed, speed === 1, speed === 1));
  }
  element("speed").addEventListener("change", (event) => {
    transport.speed = Number(event.target.value);
    event.target.blur();
  });
  element("play").addEventListener("click", () => {
    if (transport.playing) { transport.pause(); } else { transport.play(); }
    element("play").blur();
  });
  const flipLoop = makeSwitch(element("loop"), (on) => { transport.loop = on; }, true);
  const update = () => {
    scrubber.value = transport.time;
    element("play").classList.toggle("playing", transport.playing);
    element("clock").innerHTML = `${transport.time.toFixed(decimals)} s` +
      `<small>frame ${transport.frame} / ${transport.times.length - 1}</small>`;
    timeline.draw(transport.time);
  };
  window.addEventListener("resize", update);
  const changeSpeed = (steps) => {
    const chosen = SPEEDS.indexOf(transport.speed) + steps;
    if (chosen in SPEEDS) { transport.speed = element("speed").value = SPEEDS[chosen]; }
  };
  return {update, flipLoop, changeSpeed};
}

function bindKeys(transport, keys) {
  window.addEventListener("keydown", (event) => {
    const typing = event.target.tagName === "INPUT" && event.target.type !== "range";
    if (typing || event.ctrlKey || event.metaKey || event.altKey) { return; }
    const actions = {
      " ": () => (transport.playing ? transport.pause() : transport.play()),
      ArrowLeft: () => transport.step(event.shiftKey ? -10 : -1),
      ArrowRight: () => transport.step(event.shiftKey ? 10 : 1),
      Home: () => transport.seek(transport.start),
      End: () => transport.seek(transport.end),
      ...keys,
    };
    const action = actions[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (action) {
      event.preventDefault();
      action();
    }
  });
}
