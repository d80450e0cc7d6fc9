// What is known at a point that was picked, as lines of name and value.

import { ALL } from "./fields.js";
import { label } from "./colours.js";
import { describe, percent, timeText } from "./panel.js";
import { valueAt } from "./pick.js";

export async function readPoint({ data, fields, state, section, triangles }, hit) {
  // What is rounded off is not taken for a length.
  const noise = 1e-6 * Math.max(...data.extent);
  const coordinates = hit.place.map((value, i) => value + data.origin[i]);
  const place = coordinates.map((value) => label(Math.abs(value) < noise ? 0 : value, 5)).join(", ");
  const lines = [["place", `${place} ${data.unit}`]];
  if ("fluence" in hit) return [...lines, ["fluence", describe(hit.fluence, section.field.unit)]];
  for (const quantity of fields.quantities) {
    const field = fields.find(quantity, state.channel, state.light, state.moment);
    const value = valueAt(hit, await fields.values(field), triangles) * field.values.factor;
    lines.push([nameOf(field), describe(value, field.unit)]);
    if (quantity === "valid" && Number.isFinite(value)) lines.push(["diffusion itself", `± ${percent(1 - value)}`]);
  }
  return [...lines, ...errorsOf(data, state), ...nearestDetector(data, fields, state, hit.place)];
}

function nameOf({ quantity, channel, light, time }) {
  if (time !== undefined) return `exitance at ${timeText(time)}`;
  const parts = [channel, light].filter((name) => name !== ALL);
  return parts.length ? `${quantity}, ${parts.join(", ")}` : quantity;
}

// Numerical errors of the exitance; that of the model is what `valid` says.
function errorsOf(data, state) {
  const chosen = data.errors.filter(({ channel }) => state.channel === ALL || channel === state.channel);
  const worst = (key) => Math.max(...chosen.map((error) => error[key] ?? NaN));
  const lines = [["error here", worst("everywhere")], ["error, whole surface", worst("whole")]];
  return lines.filter(([, value]) => Number.isFinite(value)).map(([name, value]) => [name, percent(value)]);
}

// The reading of a detector that was picked.
function nearestDetector(data, fields, state, place) {
  const far = 0.02 * Math.hypot(...data.extent);
  const near = data.detectors
    .map((detector) => ({ detector, away: Math.hypot(...detector.place.map((x, i) => x - place[i])) }))
    .sort((a, b) => a.away - b.away)[0];
  if (!near || near.away > far) return [];
  const rows = near.detector.readings.filter(
    ({ channel, light }) => (state.channel === ALL || channel === state.channel) && light === state.light,
  );
  const inTime = fields.quantities.find((quantity) => fields.times(quantity).length);
  const { readings, unit, time } = inTime ? fields.find(inTime, state.channel, state.light, state.moment) : {};
  const { name } = near.detector;
  const then = readings ? [[`${name} at ${timeText(time)}`, describe(readings[name] ?? NaN, unit)]] : [];
  const steady = rows.map(({ channel, exitance, error }) => {
    const text = describe(exitance, `W/${data.unit}²`);
    const title = rows.length > 1 ? `${name}, ${channel}` : name;
    return [title, error === null ? text : `${text} ± ${percent(error)}`];
  });
  return [...then, ...steady];
}
