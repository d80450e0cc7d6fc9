// A parallel projection that begins as that of picture.png, turned by mouse, touch and keys.

import { OrthographicCamera, Spherical, Quaternion, Vector3 } from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";

const STEP = Math.PI / 36;
const ZOOM = 1.15;

export class View {
  constructor(scene, canvas, onChange) {
    this.scene = scene;
    this.diagonal = Math.hypot(...scene.extent);
    this.camera = new OrthographicCamera();
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.addEventListener("change", onChange);
    this.reset();
  }

  // Back to the view of the picture.
  reset() {
    const { camera, controls, scene } = this;
    controls.target.set(...scene.camera.center);
    camera.up.set(...scene.up).normalize();
    camera.position.copy(controls.target).addScaledVector(new Vector3(...scene.camera.toward), 4 * this.diagonal);
    camera.zoom = 1;
    camera.near = -20 * this.diagonal;
    camera.far = 20 * this.diagonal;
    controls.minZoom = 0.2;
    controls.maxZoom = 1000;
    camera.updateProjectionMatrix();
    controls.update();
  }

  // What the picture shows fits into a canvas, pixels, without its edges of the widths `room`.
  resize(width, height, { top, right, bottom, left }) {
    const { camera, scene } = this;
    const free = [Math.max(width - left - right, 60), Math.max(height - top - bottom, 60)];
    const pixel = Math.max(scene.camera.width / free[0], scene.camera.height / free[1]);
    this.pixel = pixel;
    camera.left = (-pixel * width) / 2;
    camera.right = (pixel * width) / 2;
    camera.top = (pixel * height) / 2;
    camera.bottom = (-pixel * height) / 2;
    camera.setViewOffset(width, height, (right - left) / 2, (bottom - top) / 2, width, height);
  }

  // Turn by angles, radians: to the right about the vertical, and upwards.
  turn(right, upward) {
    const { camera, controls } = this;
    const upright = new Quaternion().setFromUnitVectors(camera.up, new Vector3(0, 1, 0));
    const offset = camera.position.clone().sub(controls.target).applyQuaternion(upright);
    const angles = new Spherical().setFromVector3(offset);
    angles.theta += right;
    angles.phi = Math.min(Math.max(angles.phi - upward, 1e-3), Math.PI - 1e-3);
    offset.setFromSpherical(angles).applyQuaternion(upright.invert());
    camera.position.copy(controls.target).add(offset);
    controls.update();
  }

  zoom(factor) {
    const { camera, controls } = this;
    camera.zoom = Math.min(Math.max(camera.zoom * factor, controls.minZoom), controls.maxZoom);
    camera.updateProjectionMatrix();
    controls.dispatchEvent({ type: "change" });
  }

  // Whether a key turned or zoomed.
  key(name) {
    const turns = {
      ArrowLeft: [-STEP, 0],
      ArrowRight: [STEP, 0],
      ArrowUp: [0, STEP],
      ArrowDown: [0, -STEP],
    };
    if (turns[name]) this.turn(...turns[name]);
    else if (name === "+" || name === "=") this.zoom(ZOOM);
    else if (name === "-") this.zoom(1 / ZOOM);
    else if (name === "0" || name === "Home") this.reset();
    else return false;
    return true;
  }

  get toward() {
    return this.camera.position.clone().sub(this.controls.target).normalize();
  }

  // Start and direction of the ray through a place of the canvas, -1 to 1 to the right and upwards.
  ray(x, y) {
    const along = this.toward.negate();
    const start = new Vector3(x, y, 0).unproject(this.camera).addScaledVector(along, -10 * this.diagonal);
    return { start: start.toArray(), along: along.toArray() };
  }
}
