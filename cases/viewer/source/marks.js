// Lights, detectors and regions drawn in the scene, and their names over it.

import {
  BufferAttribute,
  BufferGeometry,
  ConeGeometry,
  CylinderGeometry,
  EdgesGeometry,
  Group,
  LineBasicMaterial,
  LineSegments,
  Mesh,
  MeshBasicMaterial,
  Vector3,
} from "three";
import { cornerNormals } from "./normals.js";
import { unpack, unpackPoints } from "./arrays.js";
import { rimMaterial } from "./shaders.js";

const LIGHT = 0x009eb8;
const ARROW_RADIUS = 0.0042;
// Cosine of the angle, 20 degrees, below which an arrow is seen end-on.
const END_ON = 0.94;
// Edges of regions at which faces meet at a larger angle, degrees.
const EDGE = 30;
// Places of the name of a region, of which the nearest is taken that covers no other mark: at its top, below or above,
// and aside of these, pixels.
const SHIFTS = [0, 17, -17, 34, -34];
// Half the size of the ring of a detector or light, and of the squares that cover the shaft of an arrow, pixels.
const RING = 8;
const SHAFT = 4;
// Squares along a shaft.
const ALONG = 40;

function arrow([tail, tip], radius, material) {
  const [start, end] = [new Vector3(...tail), new Vector3(...tip)];
  const along = end.clone().sub(start);
  const length = along.length();
  const head = Math.min(7 * radius, 0.5 * length);
  const shaft = new Mesh(new CylinderGeometry(radius, radius, length - head, 16), material);
  shaft.position.y = (length - head) / 2;
  const cone = new Mesh(new ConeGeometry(2.6 * radius, head, 24), material);
  cone.position.y = length - head / 2;
  const whole = new Group();
  whole.add(shaft, cone);
  whole.position.copy(start);
  whole.quaternion.setFromUnitVectors(new Vector3(0, 1, 0), along.normalize());
  return whole;
}

export function makeArrows(arrows, diagonal) {
  const group = new Group();
  // Strong where nothing is in front of it, faint where the body hides it.
  const seen = new MeshBasicMaterial({ color: LIGHT, transparent: true, opacity: 0.75 });
  const hidden = new MeshBasicMaterial({ color: LIGHT, transparent: true, opacity: 0.2, depthTest: false, depthWrite: false });
  for (const ends of arrows) {
    const one = new Group();
    one.add(arrow(ends, ARROW_RADIUS * diagonal, hidden), arrow(ends, ARROW_RADIUS * diagonal, seen));
    one.userData.along = new Vector3(...ends[1]).sub(new Vector3(...ends[0])).normalize();
    group.add(one);
  }
  return group;
}

// Hide arrows along which the camera looks, since they would hide what they light: rings with a cross stand for them.
export function hideEndOn(arrows, rings, toward) {
  for (const [i, one] of arrows.children.entries()) {
    const across = one.userData.along.dot(toward);
    one.visible = Math.abs(across) < END_ON;
    rings[i].classList.toggle("end-on", across <= -END_ON);
  }
}

export async function makeRegion(region, up) {
  const points = await unpackPoints(region.points);
  const triangles = await unpack(region.triangles);
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(points, 3));
  geometry.setIndex(new BufferAttribute(triangles, 1));
  const soup = geometry.toNonIndexed();
  soup.setAttribute("normal", new BufferAttribute(cornerNormals(points, triangles), 3));
  const group = new Group();
  const rim = new Mesh(soup, rimMaterial());
  rim.renderOrder = 1;
  const line = new LineBasicMaterial({ color: 0x14181f, transparent: true, opacity: 0.7, depthTest: false });
  const edges = new LineSegments(new EdgesGeometry(geometry, EDGE), line);
  edges.renderOrder = 2;
  group.add(rim, edges);
  return { name: region.name, points, triangles, group, top: highest(points, up) };
}

// The highest vertex, where the name of a region stands.
function highest(points, [x, y, z]) {
  let [best, most] = [0, -Infinity];
  for (let i = 0; i < points.length; i += 3) {
    const height = points[i] * x + points[i + 1] * y + points[i + 2] * z;
    if (height > most) [best, most] = [i, height];
  }
  return points.slice(best, best + 3);
}

// Marks and names that stand over the canvas, in the page.
export class Labels {
  constructor(parent) {
    this.parent = parent;
    this.labels = [];
  }

  // A beam comes from another place.
  add(kind, place, text, from) {
    const element = document.createElement("div");
    element.className = `mark ${kind}`;
    element.append(document.createElement("i"));
    if (text) {
      const name = document.createElement("span");
      name.textContent = text;
      element.append(name);
    }
    this.parent.append(element);
    this.labels.push({ kind, place: new Vector3(...place), element, from: from ? new Vector3(...from) : null });
    return element;
  }

  // Put them where the camera sees them; names that would cover an earlier one are left out, or moved.
  place(camera, width, height, shown) {
    const taken = [];
    const rings = [];
    const seen = (place) => {
      const { x, y } = place.clone().project(camera);
      return [((x + 1) / 2) * width, ((1 - y) / 2) * height];
    };
    for (const { kind, place, element, from } of this.labels) {
      element.hidden = !shown[kind === "beams" ? "lights" : kind];
      if (element.hidden) continue;
      const [left, top] = seen(place);
      element.style.transform = `translate(${left}px, ${top}px)`;
      if (kind !== "regions") rings.push([left - RING, top - RING, left + RING, top + RING]);
      for (let i = 0; from && i < ALONG; i += 1) {
        const [x, y] = seen(from.clone().lerp(place, i / ALONG));
        rings.push([x - SHAFT, y - SHAFT, x + SHAFT, y + SHAFT]);
      }
      const name = element.querySelector("span");
      if (!name) continue;
      name.hidden = false;
      const wide = 7 * name.textContent.length;
      const start = kind === "regions" ? left - wide / 2 : left + 10;
      const boxAt = ([across, down]) => [start + across, top + down - 8, start + across + wide, top + down + 8];
      // Regions are the last, and keep off the rings and shafts of all others too.
      const others = kind === "regions" ? [...taken, ...rings] : taken;
      const free = (box) => !others.some((b) => box[0] < b[2] && b[0] < box[2] && box[1] < b[3] && b[1] < box[3]);
      const aside = [0, wide / 2 + 2 * SHAFT, -wide / 2 - 2 * SHAFT];
      const shifts = kind === "regions" ? aside.flatMap((across) => SHIFTS.map((down) => [across, down])) : [[0, 0]];
      shifts.sort((one, other) => Math.hypot(...one) - Math.hypot(...other));
      const shift = shifts.find((each) => free(boxAt(each)));
      name.hidden = shift === undefined;
      if (name.hidden) continue;
      [name.style.marginLeft, name.style.marginTop] = shift.map((each) => `${each}px`);
      taken.push(boxAt(shift));
    }
  }
}
