// A surface of triangles that share no corners, in the colours of a field.

import { BufferAttribute, BufferGeometry, Mesh } from "three";
import { UNKNOWN, colourMaterial } from "./shaders.js";

function spread(values, width, triangles) {
  const found = new values.constructor(width * triangles.length);
  for (let i = 0; i < triangles.length; i += 1) {
    for (let k = 0; k < width; k += 1) found[width * i + k] = values[width * triangles[i] + k];
  }
  return found;
}

function cornerMarks(triangles) {
  const marks = new Uint8Array(3 * triangles.length);
  for (let i = 0; i < triangles.length; i += 1) marks[3 * i + (i % 3)] = 255;
  return marks;
}

// The smallest value that is drawn: others are unknown.
const known = (value) => (Number.isNaN(value) ? UNKNOWN : value);

export function makeBody(points, triangles, normals) {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(spread(points, 3, triangles), 3));
  geometry.setAttribute("normal", new BufferAttribute(normals, 3));
  geometry.setAttribute("corner", new BufferAttribute(cornerMarks(triangles), 3, true));
  geometry.setAttribute("value", new BufferAttribute(new Float32Array(triangles.length), 1));
  const mesh = new Mesh(geometry, colourMaterial(false));
  mesh.frustumCulled = false;
  return mesh;
}

export function setValues(mesh, values, triangles) {
  const attribute = mesh.geometry.getAttribute("value");
  for (let i = 0; i < triangles.length; i += 1) attribute.array[i] = known(values[triangles[i]]);
  attribute.needsUpdate = true;
}

export function setColours(mesh, colours, triangles) {
  mesh.geometry.setAttribute("colour", new BufferAttribute(spread(colours, 3, triangles), 3, true));
}
