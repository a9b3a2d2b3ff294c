import { add, cross, lookAt, multiply, perspective, scale, sub, transform, unit } from './math.js';

const kAngle = 32 * Math.PI / 180;
const kAzimuth = 38 * Math.PI / 180, kElevation = 24 * Math.PI / 180;

/** Orbits a point of W: drag turns, shift or the right button moves, the wheel comes nearer. */
export class Camera {
  constructor(canvas) {
    this.canvas = canvas;
    this.home = { centre: [0, 0, 0], radius: 0.1 };
    this.reset();
    canvas.addEventListener('pointerdown', (e) => canvas.setPointerCapture(e.pointerId));
    canvas.addEventListener('pointermove', (e) => this.drag(e));
    canvas.addEventListener('contextmenu', (e) => e.preventDefault());
    canvas.addEventListener('wheel', (e) => {
      e.preventDefault();
      this.distance *= Math.exp(0.001 * e.deltaY);
    }, { passive: false });
  }

  setHome(centre, radius) {
    this.home = { centre, radius };
    this.reset();
  }

  reset() {
    this.azimuth = kAzimuth;
    this.elevation = kElevation;
    this.target = [...this.home.centre];
    this.distance = 1.25 * this.home.radius / Math.sin(kAngle / 2);
  }

  drag(e) {
    if (e.buttons === 0) return;
    const move = e.shiftKey || (e.buttons & 6) !== 0;
    if (!move) {
      this.azimuth -= 0.008 * e.movementX;
      this.elevation = Math.min(1.55, Math.max(-1.55, this.elevation + 0.008 * e.movementY));
      return;
    }
    const back = unit(sub(this.eye(), this.target)), right = unit(cross([0, 1, 0], back)), up = cross(back, right);
    const metres = 2 * this.distance * Math.tan(kAngle / 2) / this.canvas.clientHeight;
    this.target = add(this.target, add(scale(right, -metres * e.movementX), scale(up, metres * e.movementY)));
  }

  eye() {
    const c = Math.cos(this.elevation);
    return add(this.target, scale([c * Math.sin(this.azimuth), Math.sin(this.elevation), c * Math.cos(this.azimuth)],
      this.distance));
  }

  matrix() {
    const aspect = this.canvas.width / this.canvas.height;
    // A narrow picture sees as much from side to side as a square one.
    const angle = aspect < 1 ? 2 * Math.atan(Math.tan(kAngle / 2) / aspect) : kAngle;
    return multiply(perspective(angle, aspect, 0.02 * this.distance, 60 * this.distance + 20 * this.home.radius),
      lookAt(this.eye(), this.target));
  }

  /** CSS pixels from the left and the top; null: behind the eye. */
  project(p) {
    const c = transform(this.matrix(), p);
    if (c[3] <= 0) return null;
    return [(0.5 + 0.5 * c[0] / c[3]) * this.canvas.clientWidth, (0.5 - 0.5 * c[1] / c[3]) * this.canvas.clientHeight];
  }
}
