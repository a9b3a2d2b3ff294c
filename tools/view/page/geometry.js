// Unit geometries as { vertices, indices }. A vertex: x y z w, normal. The point drawn is xyz·scale + (0, w·straight, 0),
// so that capsules of every proportion share one geometry.

function gather(rows, faces) {
  return { vertices: new Float32Array(rows.flat()), indices: new Uint32Array(faces.flat()) };
}

export function box() {
  const rows = [], faces = [];
  for (let axis = 0; axis < 3; ++axis) {
    for (const side of [-1, 1]) {
      const first = rows.length;
      for (const [u, v] of [[-1, -1], [1, -1], [1, 1], [-1, 1]]) {
        const p = [0, 0, 0], n = [0, 0, 0];
        p[axis] = n[axis] = side;
        p[(axis + 1) % 3] = u;
        p[(axis + 2) % 3] = v;
        rows.push([...p, 0, ...n]);
      }
      const order = side > 0 ? [0, 1, 2, 0, 2, 3] : [0, 2, 1, 0, 3, 2];
      faces.push(order.map((i) => first + i));
    }
  }
  return gather(rows, faces);
}

/** Rings of points around y, from the lowest: [radius, y, w, normal's radius, normal's y]. */
function turned(rings, around) {
  const rows = [], faces = [];
  for (const [r, y, w, nr, ny] of rings) {
    for (let i = 0; i <= around; ++i) {
      const a = 2 * Math.PI * i / around, c = Math.cos(a), s = Math.sin(a);
      rows.push([r * c, y, r * s, w, nr * c, ny, nr * s]);
    }
  }
  for (let ring = 0; ring + 1 < rings.length; ++ring) {
    for (let i = 0; i < around; ++i) {
      const a = ring * (around + 1) + i, b = a + around + 1;
      faces.push([a, b, a + 1, a + 1, b, b + 1]);
    }
  }
  return gather(rows, faces);
}

/** With caps apart: w = ±1 moves the halves. */
export function capsule(around = 20, steps = 8) {
  const rings = [];
  for (const half of [-1, 1]) {
    for (let i = 0; i <= steps; ++i) {
      const a = (half < 0 ? -Math.PI / 2 : 0) + Math.PI / 2 * i / steps;
      rings.push([Math.cos(a), Math.sin(a), half, Math.cos(a), Math.sin(a)]);
    }
  }
  return turned(rings, around);
}
export const sphere = () => capsule(20, 7);
export const cylinder = () => turned([[0, -1, 0, 0, -1], [1, -1, 0, 0, -1], [1, -1, 0, 1, 0], [1, 1, 0, 1, 0],
  [1, 1, 0, 0, 1], [0, 1, 0, 0, 1]], 24);
/** Base at y = 0, tip at y = 1. */
export const cone = () => turned([[0, 0, 0, 0, -1], [1, 0, 0, 0, -1], [1, 0, 0, 0.9, 0.4], [0, 1, 0, 0.9, 0.4]], 20);
export const plane = () => gather([[-1, 0, -1, 0, 0, 1, 0], [-1, 0, 1, 0, 0, 1, 0], [1, 0, 1, 0, 0, 1, 0],
  [1, 0, -1, 0, 0, 1, 0]], [[0, 1, 2, 0, 2, 3]]);

/** Of a mesh message: normals come from the picture (flat). */
export function mesh({ vertices, triangles }) {
  const rows = new Float32Array(vertices.length / 3 * 7);
  for (let i = 0; i < vertices.length / 3; ++i) rows.set(vertices.subarray(3 * i, 3 * i + 3), 7 * i);
  return { vertices: rows, indices: triangles };
}
