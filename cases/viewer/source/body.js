// `Body`: a surface of triangles in the colours of a field.

import { BufferAttribute, BufferGeometry, Mesh } from "three";
import { cornerNormals } from "./normals.js";
import { coarser } from "./coarser.js";
import { UNKNOWN, colourMaterial, compileWith } from "./shaders.js";

// Cosine of the angle, .8 degrees, between normals that count as one.
const ALIKE = 1 - 1e-4;
// More triangles are not drawn in motion by what is slow, but those between about so many vertices.
const MOST = 20_000;
const KEPT = 8000;

// Corners of triangles whose vertex and normal are the same become one: `corners` has one of each, `index` (3 m,) says
// which it is.
export function weld(triangles, normals) {
  const first = new Int32Array(triangles.reduce((most, v) => Math.max(most, v), 0) + 1).fill(-1);
  const next = new Int32Array(triangles.length).fill(-1);
  const corners = [];
  const index = new Uint32Array(triangles.length);
  const alike = (i, j) =>
    normals[3 * i] * normals[3 * j] + normals[3 * i + 1] * normals[3 * j + 1] + normals[3 * i + 2] * normals[3 * j + 2] >
    ALIKE;
  for (let i = 0; i < triangles.length; i += 1) {
    let found = first[triangles[i]];
    while (found >= 0 && !alike(i, corners[found])) found = next[found];
    if (found < 0) {
      found = corners.length;
      next[found] = first[triangles[i]];
      first[triangles[i]] = found;
      corners.push(i);
    }
    index[i] = found;
  }
  return { corners, index };
}

// Rows of `values`, `width` wide.
function rowsOf(values, width, rows) {
  const found = new values.constructor(width * rows.length);
  for (let i = 0; i < rows.length; i += 1) {
    for (let k = 0; k < width; k += 1) found[width * i + k] = values[width * rows[i] + k];
  }
  return found;
}

export class Body {
  constructor(points, triangles) {
    const normals = cornerNormals(points, triangles);
    const { corners, index } = weld(triangles, normals);
    this.vertices = Uint32Array.from(corners, (corner) => triangles[corner]);
    this.shared = new BufferGeometry();
    this.all = new BufferAttribute(index, 1);
    this.shared.setIndex(this.all);
    this.most = MOST;
    this.kept = KEPT;
    this.set("position", rowsOf(points, 3, this.vertices), 3);
    this.set("normal", rowsOf(normals, 3, corners), 3);
    this.mesh = new Mesh(this.shared, colourMaterial());
    this.mesh.frustumCulled = false;
  }

  set(name, numbers, width, normalized = false) {
    this.shared.setAttribute(name, new BufferAttribute(numbers, width, normalized));
    this.stale = true;
  }

  setValues(values) {
    this.set("value", rowsOf(Float32Array.from(values, (value) => (Number.isNaN(value) ? UNKNOWN : value)), 1, this.vertices), 1);
  }

  setColours(colours) {
    this.set("colour", rowsOf(colours, 3, this.vertices), 3, true);
  }

  // Draw what is asked for, parts of the shaders by name, or what is quicker: no edges, and fewer of many triangles.
  show(parts, coarsely) {
    const edges = parts.EDGES && !coarsely;
    this.shared.setIndex(coarsely && this.isLarge ? this.few : this.all);
    this.mesh.geometry = edges ? this.apart : this.shared;
    compileWith(this.mesh.material, { ...parts, EDGES: edges });
  }

  get isLarge() {
    return this.all.count > 3 * this.most;
  }

  get few() {
    const [points, normals] = ["position", "normal"].map((name) => this.shared.getAttribute(name).array);
    const index = () => coarser(points, normals, this.vertices, this.all.array, this.kept);
    return (this.fewer ??= new BufferAttribute(index(), 1));
  }

  // Edges are found by marks at the corners of each triangle, so that triangles share none.
  get apart() {
    if (this.stale) {
      this.separate?.dispose();
      this.separate = withCorners(this.shared.toNonIndexed());
      this.stale = false;
    }
    return this.separate;
  }
}

// Mark the three corners of each triangle by red, green and blue.
export function withCorners(geometry) {
  const marks = new Uint8Array(3 * geometry.getAttribute("position").count);
  for (let i = 0; 3 * i < marks.length; i += 1) marks[3 * i + (i % 3)] = 255;
  return geometry.setAttribute("corner", new BufferAttribute(marks, 3, true));
}
