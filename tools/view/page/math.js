// Vectors are arrays of 3, quaternions (w, x, y, z), matrices 16 numbers by columns, as WebGL takes them.
export const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
export const sub = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const scale = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
export const norm = (a) => Math.hypot(a[0], a[1], a[2]);
export const unit = (a) => { const n = norm(a); return n > 0 ? scale(a, 1 / n) : [0, 1, 0]; };

export function rotate(q, v) {
  const u = [q[1], q[2], q[3]];
  return add(v, scale(cross(u, add(cross(u, v), scale(v, q[0]))), 2));
}

/** The rotation that takes +y to the unit vector `d`. */
export function turnY(d) {
  if (d[1] < -0.999999) return [0, 1, 0, 0];
  const q = [1 + d[1], d[2], 0, -d[0]];
  const n = Math.hypot(...q);
  return q.map((x) => x / n);
}

export function perspective(angleY, aspect, near, far) {
  const f = 1 / Math.tan(angleY / 2), d = 1 / (near - far);
  return [f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) * d, -1, 0, 0, 2 * far * near * d, 0];
}

export function lookAt(eye, target) {
  const back = unit(sub(eye, target)), right = unit(cross([0, 1, 0], back)), up = cross(back, right);
  return [right[0], up[0], back[0], 0, right[1], up[1], back[1], 0, right[2], up[2], back[2], 0,
    -dot(right, eye), -dot(up, eye), -dot(back, eye), 1];
}

export function multiply(a, b) {
  const out = new Array(16).fill(0);
  for (let c = 0; c < 4; ++c) {
    for (let r = 0; r < 4; ++r) for (let k = 0; k < 4; ++k) out[4 * c + r] += a[4 * k + r] * b[4 * c + k];
  }
  return out;
}

/** Clip coordinates of a point. */
export const transform = (m, p) => [0, 1, 2, 3].map((r) => m[r] * p[0] + m[4 + r] * p[1] + m[8 + r] * p[2] + m[12 + r]);

/** 1, 2 or 5 times a power of ten, not below `value` > 0. */
export function niceAbove(value) {
  const decade = 10 ** Math.floor(Math.log10(value));
  for (const step of [1, 2, 5]) if (step * decade >= value * (1 - 1e-9)) return step * decade;
  return 10 * decade;
}
