// `Section`: the cut through the volume with its fluence, and through the regions.

import { unpack, unpackPoints } from "./arrays.js";
import { cutTetrahedra, cutTriangles, makeCut, makeRings, showCrossings } from "./cut.js";
import { Fields, rangeOf } from "./fields.js";
import { firstHit, valueAt } from "./pick.js";
import { compileWith } from "./shaders.js";

export class Section {
  constructor(data, regions) {
    this.volume = data.volume;
    this.regions = regions;
    this.fields = new Fields(data.volume?.fields ?? []);
    this.face = makeCut();
    this.rings = makeRings();
    this.objects = [this.face, this.rings];
    this.active = false;
  }

  async cut(state, plane) {
    this.active = plane !== null && this.volume !== undefined;
    this.face.visible = this.active;
    this.rings.visible = plane !== null && state.regions;
    if (!plane) return;
    for (const { group } of this.regions) group.visible = false;
    const rings = this.regions.map(({ points, triangles }) =>
      cutTriangles(points, triangles, plane.normal, plane.offset),
    );
    showCrossings(this.rings, { places: rings.flatMap(({ places }) => places) });
    if (!this.active) return;
    this.points ??= await unpackPoints(this.volume.points);
    this.tetrahedra ??= await unpack(this.volume.tetrahedra);
    this.field = this.fields.find("fluence", state.channel, state.light);
    const values = await this.fields.values(this.field);
    this.crossings = cutTetrahedra(this.points, this.tetrahedra, values, plane.normal, plane.offset);
    showCrossings(this.face, this.crossings);
    this.colour(state);
  }

  colour(state, texture) {
    const uniforms = this.face.material.uniforms;
    if (texture) uniforms.map.value = texture;
    compileWith(this.face.material, { BY_VALUE: true, EDGES: state.edges });
    uniforms.logarithmic.value = state.logarithmic ? 1 : 0;
    this.logarithmic = state.logarithmic;
    if (!this.field) return;
    const [low, high] = rangeOf(this.field, state.logarithmic);
    uniforms.low.value = low / this.field.values.factor;
    uniforms.high.value = high / this.field.values.factor;
  }

  // The legend of the cut, if there is one.
  bar(table) {
    if (!this.active || !this.field) return null;
    const [bottom, top] = rangeOf(this.field, this.logarithmic);
    const { quantity, unit, channel } = this.field;
    return { quantity, unit, channel, bottom, top, logarithmic: this.logarithmic, table, below: false };
  }

  // Where a ray meets the cut, with the fluence there; null if it does not.
  hit(start, along) {
    if (!this.active) return null;
    const places = new Float32Array(this.crossings.places);
    const corners = Uint32Array.from({ length: places.length / 3 }, (_, i) => i);
    const hit = firstHit(places, corners, start, along, () => true, -Infinity);
    return hit && { ...hit, fluence: valueAt(hit, this.crossings.found, corners) * this.field.values.factor };
  }
}
