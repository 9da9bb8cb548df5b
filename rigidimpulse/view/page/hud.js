/* What lies over the picture: title, layers, the bar with its impact marks, and the keys. */

const SPEEDS = [0.05, 0.1, 0.25, 0.5, 1, 2, 4];

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

/* Impacts as spikes under the time line, as high as their arrows are long; the part already played is darker. */
function drawMarks(canvas, transport, rows) {
  const width = canvas.clientWidth, height = canvas.clientHeight, scale = window.devicePixelRatio;
  if (canvas.width !== Math.round(width * scale)) {
    canvas.width = Math.round(width * scale);
    canvas.height = Math.round(height * scale);
  }
  const pen = canvas.getContext("2d");
  pen.setTransform(scale, 0, 0, scale, 0, 0);
  pen.clearRect(0, 0, width, height);
  const span = transport.end - transport.start;
  const place = (time) => 8 + (width - 16) * (span > 0 ? (time - transport.start) / span : 0);
  const now = place(transport.time), middle = height / 2 + 5;
  const spikes = new Float32Array(Math.ceil(width) + 1);
  let longest = 0;
  for (let i = 0; i < rows.length; i += ROW) {
    const column = Math.round(place(rows[i]));
    spikes[column] = Math.max(spikes[column], rows[i + 10]);
    longest = Math.max(longest, rows[i + 10]);
  }
  spikes.forEach((length, column) => {
    if (length > 0) {
      pen.fillStyle = column <= now ? "rgba(255, 74, 28, 0.95)" : "rgba(255, 74, 28, 0.4)";
      const tall = 3 + 13 * (length / longest);
      pen.fillRect(column - 0.75, middle - 2 - tall, 1.5, tall);
    }
  });
  pen.lineCap = "round";
  for (const [colour, from, to] of [["rgba(29, 39, 48, 0.18)", 8, width - 8], ["#1d2730", 8, now]]) {
    pen.strokeStyle = colour;
    pen.lineWidth = 3;
    pen.beginPath();
    pen.moveTo(from, middle);
    pen.lineTo(to, middle);
    pen.stroke();
  }
  pen.fillStyle = "#1d2730";
  pen.beginPath();
  pen.arc(now, middle, 6, 0, 2 * Math.PI);
  pen.fill();
}

/* Decimals such that neighbouring frames read differently. */
function clockDecimals(times) {
  const step = (times[times.length - 1] - times[0]) / Math.max(times.length - 1, 1);
  return step > 0 ? Math.min(Math.max(2, Math.ceil(-Math.log10(step)) + 1), 9) : 2;
}

function makeBar(transport, rows) {
  const scrubber = element("scrubber"), decimals = clockDecimals(transport.times);
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
    drawMarks(element("marks"), transport, rows);
  };
  window.addEventListener("resize", update);
  return {update, flipLoop};
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
