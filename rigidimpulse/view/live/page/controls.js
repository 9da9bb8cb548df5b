/* What can be changed: a row for each control. A value that was changed here counts until it is taken back, whatever the file says. */

class Controls {
  constructor(send) {
    Object.assign(this, {send, rows: new Map()});
    element("reset").addEventListener("click", (event) => {
      event.preventDefault(); // it stands in the summary, which would close the panel
      send({do: "reset"});
    });
    element("controls").open = window.innerWidth > 820;
    this.asked = new URLSearchParams(location.search); // values in the address of the page, which are chosen once
  }

  /* Chooses the values that the address of the page names; it follows what is chosen from then on. */
  followAddress(controls, chosen) {
    for (const control of controls) {
      const text = this.asked?.get(control.name);
      if (text === null || text === undefined) { continue; }
      const value = control.kind === "range" ? Number(text) : control.kind === "switch" ? text === "true" : text;
      if (control.kind === "range" ? text !== "" && Number.isFinite(value) : control.kind === "switch" || control.choices.includes(value)) {
        this.send({do: "set", name: control.name, value});
        chosen = {...chosen, [control.name]: value};
      }
    }
    this.asked = null;
    const query = new URLSearchParams(Object.entries(chosen)).toString();
    history.replaceState(null, "", location.pathname + (query ? `?${query}` : ""));
  }

  /* The controls of a run, with the values of the scene itself; what was chosen (by name), and how many throws there were. */
  show(controls, chosen, throws) {
    const key = JSON.stringify(controls.map(({value, ...rest}) => rest));
    if (key !== this.key) {
      this.key = key;
      this.rows.clear();
      element("rows").replaceChildren(...controls.map((control, k) => this.makeRow(control, k > 0 && controls[k - 1].declared && !control.declared)));
    }
    for (const control of controls) {
      const row = this.rows.get(control.name), isChosen = control.name in chosen;
      row.classList.toggle("changed", isChosen);
      if (!row.contains(document.activeElement) || !row.classList.contains("busy")) {
        row.show(isChosen ? chosen[control.name] : control.value);
      }
    }
    element("reset").hidden = Object.keys(chosen).length + throws === 0;
    element("controls").hidden = false;
    this.followAddress(controls, chosen);
  }

  makeRow(control, first) {
    const row = document.createElement("label"), name = document.createElement("span"), output = document.createElement("output");
    row.dataset.name = control.name;
    row.classList.toggle("first", first);
    name.textContent = control.label;
    const input = {range: makeSlider, switch: makeSwitch, choice: makeChoice}[control.kind](control);
    output.addEventListener("click", (event) => {
      if (!row.classList.contains("changed")) { return; }
      event.preventDefault();
      this.send({do: "set", name: control.name, value: null});
    });
    input.element.addEventListener("input", () => {
      row.classList.add("busy");
      output.textContent = input.text();
      this.send({do: "set", name: control.name, value: input.value()});
    });
    input.element.addEventListener("change", () => row.classList.remove("busy"));
    row.show = (value) => {
      input.show(value);
      output.textContent = value === null ? "as written" : input.text();
      output.title = row.classList.contains("changed") ? "click: as written" : "";
    };
    row.append(name, input.element, output);
    this.rows.set(control.name, row);
    return row;
  }
}

function makeSlider({low, high, step, logarithmic, unit}) {
  const input = document.createElement("input"), up = (x) => (logarithmic ? Math.log(x) : x), down = (x) => (logarithmic ? Math.exp(x) : x);
  Object.assign(input, {type: "range", min: up(low), max: up(high), step: logarithmic ? "any" : step});
  const value = () => Number(down(Number(input.value)).toPrecision(logarithmic ? 3 : 9));
  return {element: input, value, text: () => `${Number(value().toPrecision(4))}${unit ? "\u2009" + unit : ""}`,
    show: (given) => { input.value = up(given ?? (low + high) / 2); }};
}

function makeSwitch() {
  const input = document.createElement("input");
  input.type = "checkbox";
  return {element: input, value: () => input.checked, text: () => (input.checked ? "yes" : "no"), show: (given) => { input.checked = given; }};
}

function makeChoice({choices}) {
  const select = document.createElement("select");
  for (const choice of choices) { select.add(new Option(choice, choice)); }
  return {element: select, value: () => choices[select.selectedIndex], text: () => "", show: (given) => { select.selectedIndex = choices.indexOf(given); }};
}
