// The controls beside the scene: they follow the state, and the state follows them.

import { ALL } from "./fields.js";
import { label } from "./colours.js";

export const element = (id) => document.getElementById(id);

function fill(select, names, chosen, text = (name) => name) {
  select.replaceChildren(...names.map((name) => new Option(text(name), name, false, name === chosen)));
  select.closest("label").hidden = names.length < 2;
}

const TITLES = { preview: "colours", pulse: "after a pulse" };

// Names of all switches, and the keys that turn them.
export const SWITCHES = { edges: "e", lights: "g", detectors: "d", regions: "r" };

export class Panel {
  constructor(scene, change) {
    this.scene = scene;
    for (const id of ["quantity", "channel", "light", "map", "cut"]) {
      element(id).addEventListener("change", () => change({ [id]: element(id).value }));
    }
    for (const name of ["log", "linear"]) {
      element(name).addEventListener("change", () => change({ logarithmic: name === "log" }));
    }
    for (const id of ["position", "moment"]) {
      element(id).addEventListener("input", () => change({ [id]: Number(element(id).value) }));
    }
    for (const id of Object.keys(SWITCHES)) {
      element(id).addEventListener("change", () => change({ [id]: element(id).checked }));
    }
    for (const end of ["bottom", "top"]) {
      element(end).addEventListener("change", () => change({ [end]: Number(element(end).value) }));
    }
    element("whole").addEventListener("click", () => change({ bottom: null, top: null }));
  }

  follow(state, fields, field, range) {
    const { scene } = this;
    const quantities = [...(scene.colours ? ["preview"] : []), ...fields.quantities];
    fill(element("quantity"), quantities, state.quantity, (name) => TITLES[name] ?? name);
    for (const kind of ["channel", "light"]) {
      fill(element(kind), fields.names(state.quantity, kind), state[kind], (name) => (name === ALL ? "sum of all" : name));
    }
    const times = fields.times(state.quantity);
    element("times").hidden = times.length < 2;
    element("moment").max = Math.max(times.length - 1, 0);
    element("moment").value = state.moment;
    element("time").textContent = times.length ? timeText(times[Math.min(state.moment, times.length - 1)]) : "";
    fill(element("map"), Object.keys(scene.maps), state.map);
    const preview = state.quantity === "preview";
    if (preview && state.cut === "off") element("map").closest("label").hidden = true;
    element("log").checked = state.logarithmic;
    element("linear").checked = !state.logarithmic;
    element("ranges").hidden = preview;
    element("scales").hidden = preview || !field.logarithmic;
    for (const [i, end] of ["bottom", "top"].entries()) {
      const input = element(end);
      input.value = shortText(range[i]);
    }
    for (const id of Object.keys(SWITCHES)) element(id).checked = state[id];
    element("cut").value = state.cut;
    element("position").value = state.position;
    element("position").disabled = state.cut === "off";
  }

  // Leave out switches of what the run has none of.
  hideMissing() {
    const { lights, detectors, regions, volume } = this.scene;
    element("lights").closest("label").hidden = !(lights.arrows.length + lights.points.length);
    element("detectors").closest("label").hidden = !detectors.length;
    element("regions").closest("label").hidden = !regions.length;
    element("no-volume").hidden = Boolean(volume);
  }

  // Lines of name and value.
  read(lines) {
    const rows = lines.map(([name, value]) => {
      const row = document.createElement("tr");
      for (const [tag, text] of [["th", name], ["td", value]]) {
        const cell = document.createElement(tag);
        cell.textContent = text;
        row.append(cell);
      }
      return row;
    });
    element("reading").replaceChildren(...rows);
    element("hint").hidden = lines.length > 0;
  }
}

export function describe(value, unit) {
  return Number.isFinite(value) ? `${label(value, 5)} ${unit}`.trim() : "not known";
}

// A number as it fits into a field of the page.
function shortText(value) {
  const size = Math.abs(value);
  return size > 0 && (size < 1e-3 || size >= 1e5) ? value.toExponential(3) : String(Number(value.toPrecision(4)));
}

// A time, s, as people write it.
export function timeText(seconds) {
  const [factor, unit] = seconds < 1e-9 ? [1e12, "ps"] : seconds < 1e-6 ? [1e9, "ns"] : [1e6, "µs"];
  return `${Number((factor * seconds).toPrecision(4))} ${unit}`;
}

export const percent = (share) => `${Number((100 * share).toPrecision(2))} %`;
