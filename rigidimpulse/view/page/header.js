/* The head of the page: the scene's sentence, its checks and warnings, and the menus at its right. */

/* The checks of a gallery scene. */
function showChecks(checks) {
  if (checks.length === 0) { return; }
  const passed = checks.filter((check) => check.passed).length, box = element("checks"), head = box.querySelector("summary");
  head.textContent = `${passed === checks.length ? "\u2713" : "\u26a0"} ${passed} of ${checks.length} checks hold`;
  box.classList.toggle("bad", passed < checks.length);
  box.querySelector("div").append(make("ul", {children: checks.map(({what, value, bound, relation, law, passed: holds}) => make("li", {
    className: holds ? "" : "bad", children: [
      make("b", {textContent: `${holds ? "\u2713" : "\u2717"} ${what}`}), make("span", {textContent: `${value}, ${relation} ${bound}`}), make("p", {textContent: law})]}))}));
  box.hidden = false;
}

/* The problems of the run; a click on one goes to its time. */
function showWarnings(warnings, transport) {
  if (warnings.length === 0) { return; }
  const box = element("warnings"), list = make("ol");
  for (const {time, kind, bodies, message} of warnings) {
    const parts = [["b", kind], ["span", bodies], ["p", message]].filter(([, text]) => text);
    const go = make("button", {type: "button", textContent: time === null ? "" : `${Number(time.toPrecision(4))} s`, hidden: time === null, title: "go there"});
    go.addEventListener("click", () => { transport.pause(); transport.seek(Math.min(Math.max(time, transport.start), transport.end)); });
    list.append(make("li", {children: [go, ...parts.map(([tag, text]) => make(tag, {textContent: text}))]}));
  }
  box.querySelector("summary").textContent = `\u26a0 ${warnings.length} ${warnings.length === 1 ? "warning" : "warnings"}: look before you use this run`;
  box.querySelector("div").append(list);
  box.open = window.innerWidth > NARROW && window.innerHeight > 500;
  box.hidden = false;
}

/* `checks` and `warnings` stand below the title; opening them makes the picture smaller. */
function showHeader(manifest, transport, onLayout) {
  element("summary").textContent = `${manifest.summary}  \u00b7  ${manifest.status.ok ? manifest.status.message : "see the warnings"}`;
  showWarnings(manifest.warnings, transport);
  showChecks(manifest.checks);
  document.querySelectorAll("header details").forEach((box) => box.addEventListener("toggle", onLayout));
  makeMenu(element("layers-button"), element("layers"));
  const help = makeMenu(element("help-button"), element("help"));
  element("theme-button").addEventListener("click", () => theme.set(!theme.dark));
  return {help: () => help(element("help").hidden)};
}
