// Where a ray first meets triangles that share vertices.

// The nearest place that is kept, at least `least` away: { distance, place, triangle, weights } or null.
export function firstHit(points, triangles, start, along, keeps, least) {
  let best = null;
  const [ox, oy, oz] = start;
  const [dx, dy, dz] = along;
  for (let t = 0; t < triangles.length; t += 3) {
    const a = 3 * triangles[t];
    const b = 3 * triangles[t + 1];
    const c = 3 * triangles[t + 2];
    const e1x = points[b] - points[a];
    const e1y = points[b + 1] - points[a + 1];
    const e1z = points[b + 2] - points[a + 2];
    const e2x = points[c] - points[a];
    const e2y = points[c + 1] - points[a + 1];
    const e2z = points[c + 2] - points[a + 2];
    const px = dy * e2z - dz * e2y;
    const py = dz * e2x - dx * e2z;
    const pz = dx * e2y - dy * e2x;
    const volume = e1x * px + e1y * py + e1z * pz;
    if (volume === 0) continue;
    const sx = ox - points[a];
    const sy = oy - points[a + 1];
    const sz = oz - points[a + 2];
    const u = (sx * px + sy * py + sz * pz) / volume;
    if (u < -1e-7 || u > 1 + 1e-7) continue;
    const qx = sy * e1z - sz * e1y;
    const qy = sz * e1x - sx * e1z;
    const qz = sx * e1y - sy * e1x;
    const v = (dx * qx + dy * qy + dz * qz) / volume;
    if (v < -1e-7 || u + v > 1 + 1e-7) continue;
    const distance = (e2x * qx + e2y * qy + e2z * qz) / volume;
    if (distance < least || (best && distance >= best.distance)) continue;
    const place = [ox + distance * dx, oy + distance * dy, oz + distance * dz];
    if (keeps(place)) best = { distance, place, triangle: t / 3, weights: [1 - u - v, u, v] };
  }
  return best;
}

// The value at a hit, interpolated linearly between three vertices.
export function valueAt(hit, values, triangles) {
  const corners = [0, 1, 2].map((k) => values[triangles[3 * hit.triangle + k]]);
  return corners.reduce((sum, value, k) => sum + hit.weights[k] * value, 0);
}
