/* What is around the picture: the menu of layers, the bar, and the keys. */

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4];

/* The menu of layers, a check box each; returns what flips them, by key. */
function makeLayers(layers) {
  const keys = {};
  for (const {label, key, set, on} of layers) {
    const box = make("input", {type: "checkbox", checked: on}), flip = () => { box.checked = !box.checked; set(box.checked); };
    box.addEventListener("change", () => set(box.checked));
    element("layers").append(make("label", {children: [box, make("span", {textContent: label}), make("kbd", {textContent: key.toUpperCase(), "aria-hidden": "true"})]}));
    keys[key] = flip;
  }
  return keys;
}

/* The table of keys. */
function showKeys(keys) {
  element("help").append(make("h2", {textContent: "Keys"}), make("dl", {children: keys.map(([key, what]) => make("div", {children: [
    make("dt", {children: key.split(" ").map((one) => make("kbd", {textContent: one}))}), make("dd", {textContent: what})]}))}));
}

/* Decimals such that neighbouring frames read differently. */
function clockDecimals(times) {
  const step = (times[times.length - 1] - times[0]) / Math.max(times.length - 1, 1);
  return step > 0 ? Math.min(Math.max(2, Math.ceil(-Math.log10(step)) + 1), 9) : 2;
}

function makeBar(transport, timeline) {
  const scrubber = element("scrubber");
  scrubber.addEventListener("input", () => transport.seek(Number(scrubber.value)));
  for (const speed of SPEEDS) {
    element("speed").add(new Option(`${speed}\u00d7`, speed, speed === 1, speed === 1));
  }
  element("speed").addEventListener("change", (event) => { transport.speed = Number(event.target.value); });
  element("play").addEventListener("click", () => { if (transport.playing) { transport.pause(); } else { transport.play(); } });
  const flipLoop = makeSwitch(element("loop"), (on) => { transport.loop = on; }, true);
  const update = () => {
    const clock = `${transport.time.toFixed(clockDecimals(transport.times))} s`, frame = `frame ${transport.frame} / ${transport.times.length - 1}`;
    Object.assign(scrubber, {min: transport.start, max: transport.end, value: transport.time});
    scrubber.setAttribute("aria-valuetext", `${clock}, ${frame}`);
    element("play").classList.toggle("playing", transport.playing);
    element("clock").innerHTML = `${clock} <small>${frame}</small>`;
    timeline.draw(transport.time);
  };
  window.addEventListener("resize", update);
  const changeSpeed = (steps) => {
    const chosen = SPEEDS.indexOf(transport.speed) + steps;
    if (chosen in SPEEDS) { transport.speed = element("speed").value = SPEEDS[chosen]; }
  };
  return {update, flipLoop, changeSpeed};
}

/* Whether a key belongs to what has the focus: text, a slider, a choice, or a button that was reached by the keyboard. */
function isTaken(event) {
  const {target} = event, presses = event.key === " " || event.key === "Enter";
  const moves = event.key.startsWith("Arrow") || ["Home", "End"].includes(event.key);
  if (target.type === "range" && target.id !== "scrubber" && moves) { return true; }
  if (target.tagName === "INPUT" && !["range", "checkbox"].includes(target.type)) { return true; }
  if (target.tagName === "SELECT" && (moves || presses)) { return true; }
  return presses && target.matches("button, summary, input[type=checkbox]") && target.matches(":focus-visible");
}

function bindKeys(transport, keys) {
  window.addEventListener("keydown", (event) => {
    if (isTaken(event) || event.ctrlKey || event.metaKey || event.altKey) { return; }
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
