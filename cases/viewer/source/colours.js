// Colour maps, positions on them, and the ticks of their legends.

import { DataTexture, LinearFilter, RGBAFormat } from "three";

const STEPS = 256;

// The colours of a map at 256 steps, red, green, blue and opacity as bytes.
export function tableOf(colours) {
  const knots = colours.map((colour) => [0, 2, 4].map((at) => parseInt(colour.slice(at, at + 2), 16)));
  const table = new Uint8Array(4 * STEPS);
  for (let step = 0; step < STEPS; step += 1) {
    const at = (step / (STEPS - 1)) * (knots.length - 1);
    const low = Math.min(Math.floor(at), knots.length - 2);
    for (let k = 0; k < 3; k += 1) {
      table[4 * step + k] = Math.round(knots[low][k] + (at - low) * (knots[low + 1][k] - knots[low][k]));
    }
    table[4 * step + 3] = 255;
  }
  return table;
}

export function textureOf(table) {
  const texture = new DataTexture(table, STEPS, 1, RGBAFormat);
  texture.magFilter = LinearFilter;
  texture.minFilter = LinearFilter;
  texture.needsUpdate = true;
  return texture;
}

function superscript(number) {
  return String(number).replace(/[-0-9]/g, (letter) => "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"["-0123456789".indexOf(letter)]);
}

// A number to some digits, with a power of ten where it is far from 1.
export function label(value, digits = 4) {
  if (!Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const power = Math.floor(Math.log10(Math.abs(value)) + 1e-12);
  if (power >= -3 && power <= 3) return String(Number(value.toPrecision(digits)));
  return `${Number((value / 10 ** power).toPrecision(digits))}×10${superscript(power)}`;
}

// The largest of 1, 2 and 5 times a power of ten that is not above `longest`.
export function roundLength(longest) {
  const power = 10 ** Math.floor(Math.log10(longest));
  return [5, 2, 1].map((step) => step * power).find((length) => length <= longest) ?? power;
}

function evenTicks(bottom, top) {
  const step = roundLength((top - bottom) / 3);
  const ticks = [];
  for (let n = Math.ceil(bottom / step - 1e-9); n <= top / step + 1e-9; n += 1) ticks.push(n * step);
  return ticks.map((value) => [value, label(Math.abs(value) < 1e-9 * step ? 0 : value)]);
}

// Values and labels: decades, or finer steps on a short bar.
export function ticksOf(bottom, top, logarithmic) {
  if (!logarithmic) return evenTicks(bottom, top);
  const low = Math.ceil(Math.log10(bottom) - 1e-9);
  const high = Math.floor(Math.log10(top) + 1e-9);
  const powers = [];
  for (let n = low - 1; n <= high; n += 1) powers.push(n);
  if (high - low >= 2) return powers.slice(1).map((n) => [10 ** n, `10${superscript(n)}`]);
  if (top / bottom <= 5) return evenTicks(bottom, top);
  const steps = powers.flatMap((n) => [1, 2, 5].map((step) => step * 10 ** n));
  return steps.filter((s) => s >= bottom * (1 - 1e-9) && s <= top * (1 + 1e-9)).map((s) => [s, label(s)]);
}

// The position of a value on a map, 0 to 1.
export function shareOf(value, bottom, top, logarithmic) {
  const share = logarithmic
    ? Math.log(Math.max(value, bottom) / bottom) / Math.log(top / bottom)
    : (value - bottom) / (top - bottom);
  return Math.min(Math.max(share, 0), 1);
}
