// The page: a scene from the data in it, and what changes it.

import { start } from "./viewer.js";
import { element } from "./panel.js";

function refuse(sentence) {
  element("trouble").textContent = sentence;
  element("trouble").hidden = false;
}

if (!window.DecompressionStream) {
  refuse("This browser is too old for this page; use one of 2023 or later.");
} else {
  start(JSON.parse(element("data").textContent)).catch((error) => {
    const drawn = document.createElement("canvas").getContext("webgl2");
    refuse(drawn ? `The page cannot be shown: ${error.message}` : "This browser shows no WebGL 2; switch it on, or use another one.");
  });
}
