// Unit normals at the corners of triangles, smooth except across sharp edges, as in cases/picture/stage.py.

const SHARP = Math.cos((40 * Math.PI) / 180);
const MOST_NEIGHBOURS = 100;

// Twice the area of each triangle times its normal, and the normal alone.
function flatNormals(points, triangles) {
  const count = triangles.length / 3;
  const weighted = new Float32Array(3 * count);
  const flat = new Float32Array(3 * count);
  for (let t = 0; t < count; t += 1) {
    const a = 3 * triangles[3 * t];
    const b = 3 * triangles[3 * t + 1];
    const c = 3 * triangles[3 * t + 2];
    const ux = points[b] - points[a];
    const uy = points[b + 1] - points[a + 1];
    const uz = points[b + 2] - points[a + 2];
    const vx = points[c] - points[a];
    const vy = points[c + 1] - points[a + 1];
    const vz = points[c + 2] - points[a + 2];
    weighted[3 * t] = uy * vz - uz * vy;
    weighted[3 * t + 1] = uz * vx - ux * vz;
    weighted[3 * t + 2] = ux * vy - uy * vx;
    const length = Math.sqrt(weighted[3 * t] ** 2 + weighted[3 * t + 1] ** 2 + weighted[3 * t + 2] ** 2) || 1;
    for (let k = 3 * t; k < 3 * t + 3; k += 1) flat[k] = weighted[k] / length;
  }
  return { weighted, flat };
}

// The triangles at each vertex: those from start[v] to start[v + 1] in `around`.
function neighbours(triangles, vertices) {
  const start = new Uint32Array(vertices + 1);
  for (const v of triangles) start[v + 1] += 1;
  for (let v = 0; v < vertices; v += 1) start[v + 1] += start[v];
  const next = start.slice();
  const around = new Uint32Array(triangles.length);
  for (let i = 0; i < triangles.length; i += 1) {
    around[next[triangles[i]]] = Math.floor(i / 3);
    next[triangles[i]] += 1;
  }
  return { start, around };
}

export function cornerNormals(points, triangles) {
  const { weighted, flat } = flatNormals(points, triangles);
  const { start, around } = neighbours(triangles, points.length / 3);
  const normals = new Float32Array(3 * triangles.length);
  for (let i = 0; i < triangles.length; i += 1) {
    const own = 3 * Math.floor(i / 3);
    const first = start[triangles[i]];
    const last = start[triangles[i] + 1];
    const end = last - first <= MOST_NEIGHBOURS ? last : first;
    let x = 0;
    let y = 0;
    let z = 0;
    for (let n = first; n < end; n += 1) {
      const other = 3 * around[n];
      const cosine = flat[own] * flat[other] + flat[own + 1] * flat[other + 1] + flat[own + 2] * flat[other + 2];
      if (cosine > SHARP) {
        x += weighted[other];
        y += weighted[other + 1];
        z += weighted[other + 2];
      }
    }
    const length = Math.sqrt(x * x + y * y + z * z);
    normals[3 * i] = length ? x / length : flat[own];
    normals[3 * i + 1] = length ? y / length : flat[own + 1];
    normals[3 * i + 2] = length ? z / length : flat[own + 2];
  }
  return normals;
}
