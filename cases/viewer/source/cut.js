// The cut of a plane through tetrahedra, or through triangles.

import { BufferAttribute, BufferGeometry, LineBasicMaterial, LineSegments, Mesh } from "three";
import { withCorners } from "./body.js";
import { colourMaterial } from "./shaders.js";

export function makeCut() {
  const mesh = new Mesh(new BufferGeometry(), colourMaterial());
  mesh.frustumCulled = false;
  return mesh;
}

export function makeRings() {
  const material = new LineBasicMaterial({ color: 0xffffff, depthTest: false, transparent: true });
  const lines = new LineSegments(new BufferGeometry(), material);
  lines.frustumCulled = false;
  lines.renderOrder = 3;
  return lines;
}

// Heights of points (n, 3) above the plane of points p with normal · p = offset.
function heightsAbove(points, [x, y, z], offset) {
  const heights = new Float32Array(points.length / 3);
  for (let i = 0; i < heights.length; i += 1) {
    heights[i] = points[3 * i] * x + points[3 * i + 1] * y + points[3 * i + 2] * z - offset;
  }
  return heights;
}

// Where edges (pairs of vertices) cross the plane: positions, and values interpolated linearly.
class Crossings {
  constructor(points, values, heights) {
    Object.assign(this, { points, values, heights, places: [], found: [] });
  }

  add(a, b) {
    const share = this.heights[a] / (this.heights[a] - this.heights[b]);
    for (let k = 0; k < 3; k += 1) {
      const start = this.points[3 * a + k];
      this.places.push(start + share * (this.points[3 * b + k] - start));
    }
    if (this.values) this.found.push(this.values[a] + share * (this.values[b] - this.values[a]));
  }
}

// Triangles of a cut through tetrahedra: `places` (n, 3) and `found` (n,), three for each triangle.
export function cutTetrahedra(points, tetrahedra, values, normal, offset) {
  const heights = heightsAbove(points, normal, offset);
  const crossings = new Crossings(points, values, heights);
  const above = [];
  const below = [];
  for (let t = 0; t < tetrahedra.length; t += 4) {
    above.length = 0;
    below.length = 0;
    for (let k = 0; k < 4; k += 1) (heights[tetrahedra[t + k]] > 0 ? above : below).push(tetrahedra[t + k]);
    if (above.length === 2) {
      const [a, b] = above;
      const [c, d] = below;
      for (const [from, to] of [[a, c], [a, d], [b, d], [a, c], [b, d], [b, c]]) crossings.add(from, to);
    } else if (above.length === 1) {
      for (const to of below) crossings.add(above[0], to);
    } else if (above.length === 3) {
      for (const from of above) crossings.add(from, below[0]);
    }
  }
  return crossings;
}

// Pieces of line along which the plane meets triangles: `places` (n, 3), two for each piece.
export function cutTriangles(points, triangles, normal, offset) {
  const heights = heightsAbove(points, normal, offset);
  const crossings = new Crossings(points, null, heights);
  for (let t = 0; t < triangles.length; t += 3) {
    for (let k = 0; k < 3; k += 1) {
      const [a, b] = [triangles[t + k], triangles[t + ((k + 1) % 3)]];
      if (heights[a] > 0 !== heights[b] > 0) crossings.add(a, b);
    }
  }
  return crossings;
}

// Show triangles or lines where something was cut; values are divided by `factor` when they are stored.
export function showCrossings(object, crossings) {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(new Float32Array(crossings.places), 3));
  if (crossings.values) {
    geometry.setAttribute("value", new BufferAttribute(new Float32Array(crossings.found), 1));
    withCorners(geometry);
  }
  object.geometry.dispose();
  object.geometry = geometry;
}
