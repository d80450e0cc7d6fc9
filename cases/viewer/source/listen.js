// What clicks, taps and keys ask of the viewer.

import { SWITCHES } from "./panel.js";

// A click or a tap, not the end of a turn.
export function listenToPicks(viewer, canvas) {
  let down = null;
  canvas.addEventListener("pointerdown", (event) => {
    down = [event.clientX, event.clientY];
    canvas.focus();
    canvas.classList.add("by-pointer");
  });
  window.addEventListener("keydown", () => canvas.classList.remove("by-pointer"));
  canvas.addEventListener("pointerup", (event) => {
    const { left, top } = canvas.getBoundingClientRect();
    const near = down && Math.hypot(event.clientX - down[0], event.clientY - down[1]) < 5;
    if (near) viewer.pick(event.clientX - left, event.clientY - top);
  });
}

export function listenToKeys(viewer) {
  const switches = Object.fromEntries(Object.entries(SWITCHES).map(([name, key]) => [key, name]));
  window.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || /^(INPUT|SELECT)$/.test(event.target.tagName)) return;
    const { state, size } = viewer;
    const name = switches[event.key];
    if (name) viewer.change({ [name]: !state[name] });
    else if (event.key === "l") viewer.change({ logarithmic: !state.logarithmic });
    else if (event.key === "c") {
      const kinds = ["off", "x", "y", "z", "view"];
      viewer.change({ cut: kinds[(kinds.indexOf(state.cut) + 1) % kinds.length] });
    } else if (event.key === "Enter" && event.target.tagName !== "BUTTON") viewer.pick(size[0] / 2, size[1] / 2);
    else if (!viewer.view.key(event.key)) return;
    event.preventDefault();
  });
}
