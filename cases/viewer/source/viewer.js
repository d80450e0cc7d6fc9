// `Viewer`: the scene, its state, and what is drawn of it.

import { Color, ColorManagement, LinearSRGBColorSpace, Scene, Vector3, WebGLRenderer } from "three";
import { unpack, unpackPoints } from "./arrays.js";
import { Body } from "./body.js";
import { View } from "./camera.js";
import { label, tableOf, textureOf } from "./colours.js";
import { Fields, rangeOf, ALL } from "./fields.js";
import { Sharpness } from "./sharpness.js";
import { drawAxes, drawBar, drawNothing, drawScale, drawWhite, pen } from "./legend.js";
import { listenToKeys, listenToPicks } from "./listen.js";
import { Labels, hideEndOn, makeArrows, makeRegion } from "./marks.js";
import { Panel, element } from "./panel.js";
import { firstHit } from "./pick.js";
import { readPoint } from "./reading.js";
import { Section } from "./section.js";

const PAPER = { light: "#f3f4f6", dark: "#1c1f24" };
const INK = { light: "#20242b", dark: "#e8eaee" };
// Room for the title above and for the legends on the right of the body, pixels.
const ROOM = { top: 52, right: 84, bottom: 44, left: 4 };
// Milliseconds without a change after which it is drawn finely, and the width of the crossed axes, pixels.
const REST = 150;
const AXES = 84;

// Colours are those of the pictures, as they are.
ColorManagement.enabled = false;

class Viewer {
  constructor(scene) {
    this.data = scene;
    this.fields = new Fields([...scene.fields, ...(scene.inTime ?? [])]);
    this.scene = new Scene();
    this.renderer = new WebGLRenderer({ canvas: element("view"), antialias: false });
    this.renderer.outputColorSpace = LinearSRGBColorSpace;
    this.sharpness = new Sharpness(this.renderer);
    this.maps = Object.fromEntries(Object.entries(scene.maps).map(([name, colours]) => [name, tableOf(colours)]));
    this.textures = Object.fromEntries(Object.entries(this.maps).map(([name, table]) => [name, textureOf(table)]));
    this.view = new View(scene, element("view"), () => this.draw());
    this.labels = new Labels(element("labels"));
    this.panel = new Panel(scene, (changes) => this.change(changes));
    this.state = {
      quantity: scene.colours ? "preview" : this.fields.quantities[0],
      channel: ALL,
      light: ALL,
      logarithmic: true,
      bottom: null,
      top: null,
      map: Object.keys(scene.maps)[0],
      edges: false,
      lights: true,
      detectors: true,
      regions: true,
      cut: "off",
      position: 0.5,
      moment: 0,
    };
    this.picked = null;
    this.frames = 0;
  }

  async build() {
    const { data } = this;
    this.points = await unpackPoints(data.points);
    this.triangles = await unpack(data.triangles);
    this.body = new Body(this.points, this.triangles);
    if (data.colours) this.body.setColours(await unpack(data.colours.values));
    this.arrows = makeArrows(data.lights.arrows, this.view.diagonal);
    this.regions = await Promise.all(data.regions.map((region) => makeRegion(region, data.up)));
    this.section = new Section(data, this.regions);
    this.scene.add(this.body.mesh, this.arrows, ...this.regions.map((region) => region.group), ...this.section.objects);
    this.rings = data.lights.arrows.map(([tail, tip]) => this.labels.add("beams", tip, "", tail));
    for (const place of data.lights.points) this.labels.add("lights", place);
    for (const { name, place } of data.detectors) this.labels.add("detectors", place, name);
    for (const { name, top } of this.regions) this.labels.add("regions", top, name);
    this.labels.add("picked", [0, 0, 0]);
    this.panel.hideMissing();
  }

  get field() {
    const { quantity, channel, light, moment } = this.state;
    return this.fields.find(quantity === "preview" ? "exitance" : quantity, channel, light, moment);
  }

  get logarithmic() {
    return this.state.logarithmic && this.field.logarithmic;
  }

  // The ends of the colours: those that were typed, where they make sense, else those of the field.
  get range() {
    const [least, most] = rangeOf(this.field, this.logarithmic);
    const { bottom, top } = this.state;
    const high = top !== null && Number.isFinite(top) && (!this.logarithmic || top > 0) ? top : most;
    const low = bottom !== null && Number.isFinite(bottom) && (!this.logarithmic || bottom > 0) ? bottom : least;
    return low < high ? [low, high] : [least, most];
  }

  async change(changes) {
    const fresh = ["quantity", "channel", "light", "logarithmic"].some((key) => key in changes);
    Object.assign(this.state, fresh ? { bottom: null, top: null } : {}, changes);
    // A quantity may be known for fewer channels and lights.
    for (const kind of ["channel", "light"]) {
      const names = this.fields.names(this.field.quantity, kind);
      if (!names.includes(this.state[kind])) this.state[kind] = names[0];
    }
    this.show(await this.fields.values(this.field));
    await this.section.cut(this.state, this.plane);
    this.panel.follow(this.state, this.fields, this.field, this.range);
    await this.read();
    this.draw();
  }

  show(values) {
    const { field, state, range, body, data } = this;
    const { factor } = field.values;
    this.values = values;
    if (this.shown !== field) body.setValues(values);
    this.shown = field;
    const { material } = body.mesh;
    const uniforms = material.uniforms;
    uniforms.low.value = range[0] / factor;
    uniforms.high.value = range[1] / factor;
    uniforms.logarithmic.value = this.logarithmic ? 1 : 0;
    uniforms.map.value = this.textures[state.map];
    this.section.colour(state, this.textures[state.map]);
    this.arrows.visible = state.lights;
    for (const { group } of this.regions) group.visible = state.regions;
    this.tone = state.quantity === "preview" && data.colours ? "dark" : "light";
    document.body.className = this.tone;
    this.scene.background = new Color(PAPER[this.tone]);
    let [least, finite] = [Infinity, 0];
    for (const value of values) if (value < least) least = value;
    for (const value of values) if (Number.isFinite(value)) finite += 1;
    this.below = least * factor < range[0] * (1 - 1e-6);
    this.dark = finite === 0 || (field.logarithmic && field.ends === null);
  }

  // The plane of the cut: unit normal towards the eye, and its distance from the middle; null without a cut.
  get plane() {
    const { cut, position } = this.state;
    if (cut === "off") return null;
    const axis = cut === "view" ? (this.along ??= this.view.toward) : new Vector3().setComponent("xyz".indexOf(cut), 1);
    if (cut !== "view") this.along = null;
    let [low, high] = [Infinity, -Infinity];
    for (let i = 0; i < this.points.length; i += 3) {
      const height = this.points[i] * axis.x + this.points[i + 1] * axis.y + this.points[i + 2] * axis.z;
      low = Math.min(low, height);
      high = Math.max(high, height);
    }
    const offset = low + position * (high - low);
    const side = axis.dot(this.view.toward) < 0 ? -1 : 1;
    return { normal: axis.clone().multiplyScalar(side).toArray(), offset: side * offset };
  }

  // Whether the cut leaves a place.
  get keeps() {
    const { plane } = this;
    return ([x, y, z]) => !plane || x * plane.normal[0] + y * plane.normal[1] + z * plane.normal[2] <= plane.offset;
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = element("stage");
    this.size = [width, height];
    this.renderer.setSize(width, height, false);
    this.view.resize(width, height, ROOM);
    this.draw();
  }

  // Draw before the next frame of the screen, once however often it is asked, and finely when nothing moves any more.
  draw() {
    if (this.asked || !this.shown) return;
    this.asked = requestAnimationFrame(() => this.render(false));
  }

  render(resting) {
    const { view } = this;
    clearTimeout(this.rest);
    cancelAnimationFrame(this.asked);
    this.asked = null;
    this.sharpness.set(resting);
    const { quantity, edges, cut } = this.state;
    this.body.show({ OWN_COLOURS: quantity === "preview", EDGES: edges, CUT: cut !== "off" }, this.sharpness.fewer);
    const plane = this.plane;
    if (plane) this.body.mesh.material.uniforms.plane.value.set(...plane.normal, plane.offset);
    hideEndOn(this.arrows, this.rings, view.toward);
    this.renderer.render(this.scene, view.camera);
    this.sharpness.learn(this.body.isLarge || edges);
    this.labels.place(view.camera, ...this.size, { ...this.state, picked: this.picked !== null });
    this.drawOver();
    this.frames += 1;
    if (resting) this.hideBehind();
    else this.rest = setTimeout(() => this.render(true), REST);
  }

  // What stands over the body: the directions of the axes, and the rest where it changed.
  drawOver() {
    const { data, view } = this;
    const [width, height] = this.size;
    const ink = INK[this.tone];
    drawAxes(pen(element("axes"), AXES, AXES), view.camera, [AXES / 2, AXES / 2], ink);
    const drawn = JSON.stringify([this.size, this.state, this.range, this.tone, view.camera.zoom]);
    if (drawn === this.drawn) return;
    this.drawn = drawn;
    const context = pen(element("over"), width, height);
    drawScale(context, view, data.unit, [20, height - 22], ink);
    const inside = this.section.bar(this.maps[this.state.map]);
    const [high, low] = [Math.max(100, 0.12 * height), height - 90];
    const middle = inside ? (high + low) / 2 : low;
    const x = width - ROOM.right + 8;
    this.drawLegend(context, x, [high, inside ? middle - 14 : low], ink);
    if (inside) drawBar(context, x, inside, [middle + 40, low], ink);
  }

  drawLegend(context, x, ends, ink) {
    const { data, state, range, field } = this;
    if (state.quantity === "preview") drawWhite(context, x, ends[0], data.colours.white, field.unit, ink);
    else if (this.dark) drawNothing(context, x, ends[0], ink);
    else {
      const bar = { quantity: field.quantity, unit: field.unit, bottom: range[0], top: range[1] };
      const rest = { logarithmic: this.logarithmic, table: this.maps[state.map], below: this.below };
      drawBar(context, x, { ...bar, ...rest }, ends, ink);
    }
  }

  // Pale marks of detectors that the body hides, found when the camera rests.
  hideBehind() {
    const along = this.view.toward;
    const { keeps } = this;
    for (const { kind, place, element: mark } of this.labels.labels) {
      if (kind !== "detectors" && kind !== "picked") continue;
      const start = place.clone().addScaledVector(along, 2e-3 * this.view.diagonal).toArray();
      const hit = firstHit(this.points, this.triangles, start, along.toArray(), keeps, 0);
      mark.classList.toggle("behind", hit !== null);
    }
  }

  // Read the point that is seen at a place of the canvas, pixels from its left and top edges.
  async pick(x, y) {
    const [width, height] = this.size;
    const { start, along } = this.view.ray((2 * x) / width - 1, 1 - (2 * y) / height);
    const outside = firstHit(this.points, this.triangles, start, along, this.keeps, -Infinity);
    const inside = this.plane ? this.section.hit(start, along) : null;
    this.picked = inside && (!outside || inside.distance < outside.distance) ? inside : outside;
    return this.read();
  }

  async read() {
    const lines = this.picked ? await readPoint(this, this.picked) : [];
    this.panel.read(lines);
    const mark = this.labels.labels.find(({ kind }) => kind === "picked");
    if (this.picked) mark.place.set(...this.picked.place);
    this.draw();
    return Object.fromEntries(lines);
  }
}

export async function start(data) {
  element("title").textContent = data.title;
  element("size").textContent = `${data.extent.map((length) => label(length, 3)).join(" × ")} ${data.unit}`;
  const viewer = new Viewer(data);
  await viewer.build();
  listenToPicks(viewer, element("view"));
  listenToKeys(viewer);
  element("again").addEventListener("click", () => viewer.view.reset());
  new ResizeObserver(() => viewer.resize()).observe(element("stage"));
  viewer.resize();
  await viewer.change({});
  viewer.render(false);
  document.documentElement.dataset.ready = "yes";
  window.tetlux = viewer;
}
