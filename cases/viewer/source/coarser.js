// Fewer triangles of a surface, for pictures in motion: vertices of a cell of a grid become one of them.

function area(points, triangles) {
  let sum = 0;
  for (let i = 0; i < triangles.length; i += 3) {
    const [a, b, c] = [3 * triangles[i], 3 * triangles[i + 1], 3 * triangles[i + 2]];
    const [ux, uy, uz] = [points[b] - points[a], points[b + 1] - points[a + 1], points[b + 2] - points[a + 2]];
    const [vx, vy, vz] = [points[c] - points[a], points[c + 1] - points[a + 1], points[c + 2] - points[a + 2]];
    sum += Math.hypot(uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx) / 2;
  }
  return sum;
}

// For each corner, the first one in its cell.
function firstInCell(points, size) {
  const low = [Infinity, Infinity, Infinity];
  const high = [-Infinity, -Infinity, -Infinity];
  for (let i = 0; i < points.length; i += 1) {
    low[i % 3] = Math.min(low[i % 3], points[i]);
    high[i % 3] = Math.max(high[i % 3], points[i]);
  }
  const cell = (i) => Math.floor((points[i] - low[i % 3]) / size);
  const [, rows, layers] = high.map((end, k) => Math.floor((end - low[k]) / size) + 1);
  const firsts = new Map();
  const found = new Uint32Array(points.length / 3);
  for (let corner = 0; corner < found.length; corner += 1) {
    const key = (cell(3 * corner) * rows + cell(3 * corner + 1)) * layers + cell(3 * corner + 2);
    const first = firsts.get(key);
    if (first === undefined) firsts.set(key, corner);
    found[corner] = first ?? corner;
  }
  return found;
}

// The index of fewer triangles, from that of all, (3 m,), into corners as weld() of body.js finds them: `vertices` says
// whose corner each is, and about `kept` of these remain. Of the corners of such a vertex, the one is taken whose normal is most alike.
export function coarser(points, normals, vertices, index, kept) {
  // A surface meets a grid in 1.5 cells for each square of a cell's size, in the mean over its directions.
  const first = firstInCell(points, Math.sqrt((1.5 * area(points, index)) / kept));
  const next = new Int32Array(first.length).fill(-1);
  const last = first.slice();
  for (let corner = 0; corner < first.length; corner += 1) {
    const own = first[corner];
    if (corner === own || vertices[corner] !== vertices[own]) continue;
    next[last[own]] = corner;
    last[own] = corner;
  }
  const cosine = (i, j) => {
    return normals[3 * i] * normals[3 * j] + normals[3 * i + 1] * normals[3 * j + 1] + normals[3 * i + 2] * normals[3 * j + 2];
  };
  const instead = first.map((own, corner) => {
    let best = own;
    if (next[own] < 0) return best;
    for (let other = own; other >= 0; other = next[other]) if (cosine(corner, other) > cosine(corner, best)) best = other;
    return best;
  });
  const fewer = new Uint32Array(index.length);
  let count = 0;
  for (let i = 0; i < index.length; i += 3) {
    const a = first[index[i]];
    const b = first[index[i + 1]];
    const c = first[index[i + 2]];
    if (a === b || b === c || c === a) continue;
    for (let k = 0; k < 3; k += 1) fewer[count + k] = instead[index[i + k]];
    count += 3;
  }
  return fewer.slice(0, count);
}
