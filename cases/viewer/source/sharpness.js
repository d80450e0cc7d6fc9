// `Sharpness`: how many pixels are drawn for each one of the page, and whether all triangles are. At rest pixels are
// averaged, which smooths edges; while something moves, fewer triangles and then fewer pixels are drawn if that is slow.

// Most of a frame's seconds times 1000: to be drawn as finely in motion as at rest, and in motion before it is coarser.
const QUICK = 25;
const SLOW = 60;
const COARSEST = 0.5;

export class Sharpness {
  constructor(renderer) {
    this.renderer = renderer;
    const own = window.devicePixelRatio || 1;
    this.fine = Math.min(own < 2 ? 2 * own : own, 3);
    this.moving = Math.min(own, 2);
    // Until it is known to be quick, so that the first frame comes soon.
    this.slow = true;
    this.resting = false;
  }

  get fewer() {
    return this.slow && !this.resting;
  }

  set(resting) {
    this.resting = resting;
    const ratio = resting ? this.fine : this.moving;
    if (this.renderer.getPixelRatio() !== ratio) this.renderer.setPixelRatio(ratio);
  }

  // Learn from how long the frame takes that was just asked for, which fewer triangles may make quicker or not.
  async learn(helps) {
    if (this.waiting) return;
    this.waiting = true;
    const { resting, fewer } = this;
    const gl = this.renderer.getContext();
    const started = performance.now();
    const fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
    do await new Promise(requestAnimationFrame);
    while (!gl.isContextLost() && gl.getSyncParameter(fence, gl.SYNC_STATUS) !== gl.SIGNALED);
    gl.deleteSync(fence);
    const taken = performance.now() - started;
    if (resting && taken < QUICK) [this.moving, this.slow] = [this.fine, false];
    if (!resting && taken > SLOW) {
      if (helps && !fewer) this.slow = true;
      else this.moving = Math.max(this.moving / 2, COARSEST);
    }
    this.waiting = false;
  }
}
