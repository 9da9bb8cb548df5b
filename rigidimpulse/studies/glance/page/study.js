/* The page: sentence, runs that play, chart, the run that is chosen; and what a study that goes on hands over. */

const HOLD = 1.2; // s that the last frame stays before all begins again
const ASK = 1000; // ms between questions for news
const SLOWEST = 4; // s that a motion takes to play at least: short ones are slowed down
const STAGES = {detect: "#3d76b5", respond: "#d1692a", forces: "#7d5fb3", constrain: "#b73a4d", sweep: "#3d9061", integrate: "#a98530", observe: "#76828c"};
const STAGE_WORDS = {detect: "find contacts", respond: "impacts", forces: "forces", constrain: "hold contact", sweep: "impact times",
  integrate: "move", observe: "watch"};

const at = (name) => document.getElementById(name);
const state = {time: 0, playing: true, hold: 0, mode: "tiles", chosen: null, hidden: new Set(), index: null};
const pictures = new Pictures(at("pictures"));
const timeline = new Timeline(document.querySelector("#timeline svg"), at("scrubber"));
const chart = new Chart(at("chart"), (name) => choose(name));
let worst = new Map(); // of each run, largest error until each frame
let cells = []; // {picture, runs, tell}

function runOf(name) { return state.index.runs.find((run) => run.name === name); }

function shownRuns() {
  return state.index.runs.filter(({motion}) => motion).sort((a, b) => a.seconds - b.seconds);
}

/* Largest error of a run until a time; null where nothing is known yet. */
function errorAt(run, time) {
  const times = state.index.times, all = worst.get(run.name);
  if (!all?.length) { return null; }
  const frame = Math.floor(((times.length - 1) * time) / times[times.length - 1] + 1e-9);
  return all[Math.min(frame, all.length - 1)];
}

function countUp(run) {
  let most = null;
  return run.curve.map((value) => (value === null ? most : (most = Math.max(most ?? 0, value))));
}

/* Takes what a study knows by now. */
async function take(index, packed) {
  const buffer = await readBlock(packed);
  state.index = index;
  worst = new Map(index.runs.map((run) => [run.name, countUp(run)]));
  if (!runOf(state.chosen)?.motion) { state.chosen = (runOf(index.verdict?.recommended) ?? shownRuns()[0])?.name ?? null; }
  pictures.load(index, buffer);
  tellVerdict();
  chart.show(index, state.chosen);
  timeline.show(index);
  arrange();
  tellCard();
}

function tellVerdict() {
  const {scene, verdict, progress} = state.index;
  at("about").replaceChildren(make("b", "", "What accuracy costs"), ` · ${scene.name} · ${scene.summary}`);
  emphasize(at("headline"), verdict ? verdict.headline : progress.finished ? "Nothing could be measured." : "Measuring: the first numbers come in a few seconds.");
  emphasize(at("details"), verdict ? verdict.details.join(" ") : "");
  at("trust").textContent = verdict ? verdict.trust : "";
  at("choice").hidden = !verdict?.recommended;
  if (verdict?.recommended) {
    document.querySelector("#choice code").textContent = `accuracy="${verdict.recommended}"`;
    at("reason").textContent = `${verdict.reason[0].toUpperCase()}${verdict.reason.slice(1)}.`;
  }
  const measured = state.index.runs.length, all = measured + progress.waiting.length;
  const done = progress.finished || progress.waiting.length === 0;
  document.querySelector("#progress span").textContent = progress.finished ? `${measured} settings in ${Math.round(progress.spent)} s` :
    done ? "the reference is made finer" : `${measured} of ${all} settings measured, next: ${progress.waiting[0]}`;
  document.querySelector("#progress i b").style.width = `${(100 * measured) / Math.max(all, 1)}%`;
  at("progress").classList.toggle("done", progress.finished);
}

function isOff(run, time) { return run.left !== null && time >= run.left; }

function tellError(run, element, time) {
  const error = errorAt(run, time), {scene} = state.index;
  const below = scene.measure === "place" && error !== null && error < (scene.uncertainty ?? 0);
  element.textContent = below ? `< ${lengthText(scene.uncertainty)}` : lengthText(error);
  element.classList.toggle("off", isOff(run, time));
}

function tellChip(run, chip, time) {
  const {scene} = state.index, off = isOff(run, time);
  chip.classList.toggle("off", off);
  const beyond = scene.measure === "place" && time > scene.until + 1e-9;
  chip.textContent = run.left === null && run.bound === null ? "not compared yet" : off ?
    (scene.measure === "depth" ? `too deep since ${timeText(run.left)}` : `off since ${timeText(run.left)}`) :
    beyond ? "the truth is not known" : scene.measure === "depth" ? "bodies apart" : "on the truth";
}

function makePicture(className = "picture") {
  const picture = make("div", className);
  pictures.bindDrag(picture);
  return picture;
}

function makeTile(run) {
  const tile = make("button", `tile ${run.kind}`), picture = makePicture(), chip = make("span", "chip"), told = make("div", "told");
  const line = make("div"), error = make("span", "error");
  tile.style.setProperty("--own", colourOf(run));
  tile.setAttribute("aria-pressed", run.name === state.chosen);
  tile.dataset.name = run.name;
  picture.append(chip);
  line.append(make("span", "name", run.name), error);
  told.append(line, make("small", "", `${secondsText(run.seconds)} to compute`));
  tile.append(picture, told);
  tile.onclick = () => { if (!pictures.dragged) { select(run.name); } };
  tile.ondblclick = () => choose(run.name);
  const outlines = () => (pictures.truth && !isBeyond() ? [[pictures.truth, theme() === "dark" ? "#ffffff" : "#111111"]] : []);
  return {element: tile, picture, draw: (time) => pictures.draw(picture, pictures.figures.get(run.name), outlines(), time),
    tell: (time) => { tellError(run, error, time); tellChip(run, chip, time); }};
}

function isBeyond() { return state.index.scene.measure === "depth" || state.time > state.index.scene.until + 1e-9; }

function makeOverlaid() {
  const tile = make("div", "tile"), picture = makePicture(), keys = make("div", "keys");
  keys.append(make("span", "chip-less", "solid: the truth"));
  const tells = shownRuns().map((run) => {
    const key = make("button", `key ${run.kind}`), error = make("span", "error");
    key.style.setProperty("--own", colourOf(run));
    key.append(run.name, error);
    key.setAttribute("aria-pressed", !state.hidden.has(run.name));
    key.onclick = () => {
      state.hidden[state.hidden.has(run.name) ? "delete" : "add"](run.name);
      key.setAttribute("aria-pressed", !state.hidden.has(run.name));
    };
    keys.append(key);
    return (time) => tellError(run, error, time);
  });
  picture.append(keys);
  tile.append(picture);
  const solid = () => pictures.truth ?? pictures.figures.get(state.chosen);
  const outlines = () => shownRuns().filter(({name}) => !state.hidden.has(name)).map((run) => [pictures.figures.get(run.name), hexOf(run)]);
  return {element: tile, picture, draw: (time) => pictures.draw(picture, solid(), outlines(), time),
    tell: (time) => { for (const tell of tells) { tell(time); } }};
}

function makePlayer() {
  const run = runOf(state.chosen), cell = makeTile(run), big = make("div", "big"), error = make("div", "error");
  const what = state.index.scene.measure === "depth" ? "deepest overlap so far" : "largest error so far";
  big.append(error, make("p", "", what), make("p", "", `${run.name}: ${secondsText(run.seconds)} to compute`));
  cell.picture.append(big);
  cell.element.onclick = null;
  const tell = cell.tell;
  cell.tell = (time) => { tell(time); tellError(run, error, time); };
  return cell;
}

/* Lays out the pictures of the chosen mode. */
function arrange() {
  const {mode} = state, runs = shownRuns();
  at("stage").className = mode;
  at("stage").style.setProperty("--columns", runs.length);
  at("count").textContent = mode === "one" ? state.chosen ?? "" : runs.length === 1 ? "The first run" : `The same scene, ${runs.length} times`;
  at("hint").textContent = {tiles: "cheap to expensive. Outlines show where the bodies truly are. Drag to turn.",
    overlaid: "the truth is solid, each run is an outline in its own colour.",
    one: "the outline shows where the bodies truly are. Click another point of the chart to load that run."}[mode];
  for (const button of document.querySelectorAll(".modes button")) { button.setAttribute("aria-pressed", button.dataset.mode === mode); }
  cells = runs.length === 0 ? [] : mode === "tiles" ? runs.map(makeTile) : mode === "overlaid" ? [makeOverlaid()] : [makePlayer()];
  at("stage").replaceChildren(...cells.map(({element}) => element));
}

function row(list, term, value, className = "") {
  const definition = make("dd", className, value);
  list.append(make("dt", "", term), definition);
}

function tellCard() {
  const run = runOf(state.chosen), card = at("card");
  card.hidden = !run;
  if (!run) { return; }
  const {scene} = state.index, depth = scene.measure === "depth", standard = runOf("standard"), list = make("dl");
  const title = make("h3", `name ${run.kind}`, run.name);
  title.style.setProperty("--own", colourOf(run));
  row(list, "Seconds to compute", run.seconds === null ? "–" : secondsText(run.seconds) + (run.spread ? ` ± ${run.spread.toPrecision(1)}` : ""));
  row(list, depth ? "Deepest overlap" : `Not further off until ${timeText(scene.until)}`, lengthText(run.bound));
  if (run.bound !== null) {
    row(list, depth ? "Overlap that is seen" : "Leaves the truth", run.left === null ? (depth ? "none" : `not before ${timeText(scene.until)}`) : `at ${timeText(run.left)}`,
      run.left === null ? "good" : "off");
  }
  if (standard && run !== standard && run.bound !== null && standard.bound !== null) {
    const error = standard.bound > 0 ? `, ${timesText(run.bound / standard.bound)} the ${depth ? "depth" : "error"}` : "";
    row(list, "Against standard", `${timesText(run.seconds / standard.seconds)} the time${error}`);
  }
  card.replaceChildren(title, make("p", "", run.setting), list);
  const whole = Object.values(run.stages).reduce((sum, spent) => sum + spent, 0);
  if (whole > 0) { card.append(...stageBar(run, whole)); }
  if (run.whyNot) { card.append(make("p", "", run.whyNot)); }
}

function stageBar(run, whole) {
  const bar = make("div", "stages"), names = make("div", "stage-names");
  const entries = Object.entries(run.stages).filter(([, spent]) => spent > 0.005 * whole).sort((a, b) => b[1] - a[1]);
  for (const [stage, spent] of entries) {
    const part = make("i"), line = make("span"), key = make("span", "key", STAGE_WORDS[stage]);
    part.style.cssText = `background: ${STAGES[stage]}; flex: ${(100 * spent) / whole}`;
    key.style.setProperty("--own", STAGES[stage]);
    key.style.display = "inline";
    line.append(key, make("b", "", `${Math.round((100 * spent) / whole)} %`));
    bar.append(part);
    names.append(line);
  }
  return [make("p", "", "Where the time of the loop goes"), bar, names];
}

/* Marks a run, in the mode that is shown. */
function select(name) {
  state.chosen = name;
  chart.show(state.index, name);
  arrange();
  tellCard();
}

/* Loads a run into the player and plays it from the start. */
function choose(name) {
  state.mode = "one";
  state.time = state.hold = 0;
  select(name);
  play(true);
  at("stage").scrollIntoView({block: "nearest", behavior: "smooth"});
}

function setMode(mode) {
  state.mode = mode;
  arrange();
}

function play(playing) {
  state.playing = playing;
  at("play").classList.toggle("playing", playing);
}

function theme() { return document.documentElement.dataset.theme; }

function setTheme(name) {
  document.documentElement.dataset.theme = name;
  if (state.index) {
    pictures.paintGrounds();
    chart.show(state.index, state.chosen);
  }
}

function wire() {
  setTheme(window.matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");
  at("theme").onclick = () => setTheme(theme() === "dark" ? "light" : "dark");
  for (const button of document.querySelectorAll(".modes button")) { button.onclick = () => setMode(button.dataset.mode); }
  play(!window.matchMedia("(prefers-reduced-motion: reduce)").matches);
  at("play").onclick = () => play(!state.playing);
  at("scrubber").oninput = () => { play(false); state.time = Number(at("scrubber").value); };
  at("copy").onclick = async () => {
    await navigator.clipboard?.writeText(document.querySelector("#choice code").textContent).catch(() => {});
    at("copy").textContent = "Copied";
    setTimeout(() => { at("copy").textContent = "Copy"; }, 1500);
  };
  document.addEventListener("keydown", (event) => {
    if (event.key === " " && !event.target.closest("button, [role=button]")) { event.preventDefault(); play(!state.playing); }
    if (event.key === "Escape") { setMode("tiles"); }
  });
}

function draw(time) {
  const {scene} = state.index;
  pictures.begin();
  for (const cell of cells) {
    cell.draw(time);
    cell.tell(time);
  }
  timeline.move(time);
  const slow = Math.max(1, SLOWEST / scene.duration);
  const trust = scene.measure === "place" && state.index.verdict ? `trusted to ${timeText(scene.until)}` : `of ${timeText(scene.duration)}`;
  at("clock").replaceChildren(make("b", "", `${time.toFixed(3)} s`), slow > 1.05 ? `${trust}, ${Number(slow.toPrecision(2))}× slower` : trust);
}

function turnOver() {
  let before = performance.now();
  const step = (now) => {
    const passed = Math.min((now - before) / 1000, 0.1);
    before = now;
    if (state.index) {
      const {duration} = state.index.scene;
      if (state.playing && state.time >= duration) {
        state.hold += passed;
        if (state.hold > HOLD) { state.time = state.hold = 0; }
      } else if (state.playing) {
        state.time = Math.min(state.time + passed / Math.max(1, SLOWEST / duration), duration);
      }
      draw(state.time);
    }
    requestAnimationFrame(step);
  };
  requestAnimationFrame(step);
}

/* Asks for news of a study that goes on: a script beside the page. Where it is gone the study has ended, and the page is written. */
function askForNews(version) {
  const script = document.createElement("script");
  script.src = `study.js?${version}`;
  script.onload = () => { script.remove(); if (!state.index.progress.finished) { setTimeout(() => askForNews(version + 1), ASK); } };
  script.onerror = () => { if (version > 0) { location.reload(); } };
  document.head.append(script);
}

window.rigidimpulseStudy = (index, packed) => {
  if (index.progress.spent > state.index.progress.spent) { take(index, packed).catch(fail); }
};

function fail(error) {
  at("failure").hidden = false;
  at("failure").textContent = `This page cannot be shown: ${error.message}`;
  throw error;
}

wire();
take(JSON.parse(at("index").textContent), at("block").textContent.trim()).then(() => {
  turnOver();
  if (!state.index.progress.finished) { askForNews(0); }
  window.rigidimpulse = {state, pictures, draw, choose, errorAt: (name, time) => errorAt(runOf(name), time)};
}).catch(fail);
