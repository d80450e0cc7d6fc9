// What is drawn over the scene in two dimensions: legends, scale bar, directions of the axes.

import { Vector3 } from "three";
import { label, roundLength, shareOf, ticksOf } from "./colours.js";

const BAR = 16;
const POINTER = 12;

export function pen(canvas, width, height) {
  const ratio = window.devicePixelRatio || 1;
  canvas.width = Math.round(width * ratio);
  canvas.height = Math.round(height * ratio);
  canvas.style.width = `${width}px`;
  canvas.style.height = `${height}px`;
  const context = canvas.getContext("2d");
  context.scale(ratio, ratio);
  context.clearRect(0, 0, width, height);
  context.font = "13px system-ui, sans-serif";
  return context;
}

// A colour bar with its quantity, unit and ticks, `x` from the left of the context.
export function drawBar(context, x, { quantity, unit, bottom, top, logarithmic, table, below }, [high, low], ink) {
  context.fillStyle = ink;
  context.textAlign = "left";
  context.textBaseline = "bottom";
  // Above the tick of the largest value.
  context.fillText(quantity, x, high - 26);
  context.fillText(unit, x, high - 10);
  const end = low - (below ? POINTER : 0);
  const steps = table.length / 4;
  const colour = (step) => `rgb(${table.slice(4 * step, 4 * step + 3).join(",")})`;
  for (let y = high; y < end; y += 1) {
    context.fillStyle = colour(Math.min(steps - 1, Math.floor((steps * (end - y - 0.5)) / (end - high))));
    context.fillRect(x, y, BAR, 1.5);
  }
  if (below) {
    context.fillStyle = colour(0);
    context.beginPath();
    context.moveTo(x, end);
    context.lineTo(x + BAR, end);
    context.lineTo(x + BAR / 2, low);
    context.fill();
  }
  context.fillStyle = ink;
  context.textBaseline = "middle";
  for (const [value, text] of ticksOf(bottom, top, logarithmic)) {
    const y = end - (end - high) * shareOf(value, bottom, top, logarithmic);
    context.fillRect(x + BAR, y - 0.5, 4, 1);
    context.fillText(text, x + BAR + 7, y);
  }
}

// White and its meaning, for colours that are not those of a map.
export function drawWhite(context, x, y, white, unit, ink) {
  context.fillStyle = "white";
  context.fillRect(x, y, 40, 40);
  context.fillStyle = ink;
  context.textAlign = "left";
  context.textBaseline = "top";
  ["white is", "exitance", `of ${label(white, 3)}`, unit].forEach((line, i) => context.fillText(line, x, y + 48 + 17 * i));
}

// In place of a bar where no light leaves the body.
export function drawNothing(context, x, y, ink) {
  context.fillStyle = ink;
  context.textAlign = "left";
  context.textBaseline = "top";
  ["no light", "leaves", "the body"].forEach((line, i) => context.fillText(line, x, y + 17 * i));
}

export function drawScale(context, view, unit, [x, y], ink) {
  const pixel = view.pixel / view.camera.zoom;
  const length = roundLength(120 * pixel);
  const width = length / pixel;
  context.fillStyle = ink;
  context.fillRect(x, y - 1.5, width, 3);
  for (const end of [x, x + width]) context.fillRect(end - 0.75, y - 6, 1.5, 12);
  context.textAlign = "center";
  context.textBaseline = "bottom";
  context.fillText(`${label(length)} ${unit}`, x + width / 2, y - 7);
}

export function drawAxes(context, camera, [x0, y0], ink) {
  const toCamera = camera.matrixWorldInverse;
  context.strokeStyle = ink;
  context.fillStyle = ink;
  context.lineWidth = 1.5;
  context.textAlign = "center";
  context.textBaseline = "middle";
  for (const [i, name] of ["x", "y", "z"].entries()) {
    const axis = new Vector3().setComponent(i, 1).transformDirection(toCamera);
    const [dx, dy] = [26 * axis.x, -26 * axis.y];
    const length = Math.hypot(dx, dy);
    if (length < 3) continue;
    context.beginPath();
    context.moveTo(x0, y0);
    context.lineTo(x0 + dx, y0 + dy);
    context.stroke();
    context.fillText(name, x0 + dx * (1 + 9 / length), y0 + dy * (1 + 9 / length));
  }
}
