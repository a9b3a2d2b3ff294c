// The bodies of a scene on the graphics card: rows of a frame go there as they came. One draw call per kind of shape.
import * as geometry from './geometry.js';
import { add, norm, rotate, sub } from './math.js';

const kPoseBytes = 28, kLookFloats = 15;
const kColours = { static: [0.72, 0.75, 0.78, 1], kinematic: [0.36, 0.55, 0.52, 1], dynamic: [0.62, 0.66, 0.70, 1] };
const kSoft = [0.78, 0.55, 0.42, 1];
const kSurface = { box: 1, bounds: 1, plane: 3, mesh: 2, hull: 2 };

/** Scale of the unit geometry, and half the straight part of a capsule. */
function sizeOf(shape, groundSize) {
  switch (shape.kind) {
    case 'sphere': return [shape.radius, shape.radius, shape.radius, 0];
    case 'box': case 'bounds': return [...shape.half, 0];
    case 'capsule': return [shape.radius, shape.radius, shape.radius, shape.length / 2 - shape.radius];
    case 'cylinder': return [shape.radius, shape.length / 2, shape.radius, 0];
    case 'plane': return [groundSize, 1, groundSize, 0];
    default: return [1, 1, 1, 0];
  }
}

function halfSize(shape, meshes) {
  if (shape.kind === 'plane') return [0, 0, 0];
  if (shape.kind === 'mesh' || shape.kind === 'hull') return meshes[shape.mesh]?.most ?? [0, 0, 0];
  const s = sizeOf(shape, 0), m = shape.middle ?? [0, 0, 0];
  return [s[0] + Math.abs(m[0]), s[1] + s[3] + Math.abs(m[1]), s[2] + Math.abs(m[2])];
}

export class Bodies {
  constructor(gl) {
    this.gl = gl;
    this.unit = { box: geometry.box(), bounds: geometry.box(), sphere: geometry.sphere(), capsule: geometry.capsule(),
      cylinder: geometry.cylinder(), plane: geometry.plane() };
    this.uploaded = new Map();
    this.scene = null;
    this.meshes = [];
    this.groups = [];
    this.soft = [];
    this.poses = [gl.createBuffer(), gl.createBuffer()];
    this.newest = 0;
  }

  setScene(scene) {
    this.scene = scene;
    this.meshes = [];
    this.uploaded.clear();
    this.first = new Float32Array(7 * scene.bodies.length);
    scene.bodies.forEach((body, i) => this.first.set([...body.p, ...body.q], 7 * i));
    this.now = this.first;
    this.arrived = 0;
    this.interval = 1;
    for (const buffer of this.poses) this.fill(buffer, this.first);
    this.measure();
    this.build();
  }

  addMesh(message) {
    const most = [0, 0, 0];
    message.vertices.forEach((x, i) => { most[i % 3] = Math.max(most[i % 3], Math.abs(x)); });
    this.meshes[message.index] = { ...geometry.mesh(message), vertices3: message.vertices, most };
    this.measure();
    this.build();
  }

  fill(buffer, data) {
    this.gl.bindBuffer(this.gl.ARRAY_BUFFER, buffer);
    this.gl.bufferData(this.gl.ARRAY_BUFFER, data, this.gl.DYNAMIC_DRAW);
  }

  /** A ball around what moves, or around all of it; the ground and far walls do not count. */
  measure() {
    const { bodies, shapes, soft } = this.scene;
    const anyMoves = soft.length > 0 || bodies.some((body) => body.type !== 'static');
    let low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    const take = (p) => { low = low.map((x, k) => Math.min(x, p[k])); high = high.map((x, k) => Math.max(x, p[k])); };
    for (const body of bodies) {
      const half = halfSize(shapes[body.shape], this.meshes);
      if (shapes[body.shape].kind === 'plane' || (anyMoves && body.type === 'static' && norm(half) > 0.5)) continue;
      for (let c = 0; c < 8; ++c) {
        take(add(body.p, rotate(body.q, half.map((h, k) => ((c >> k) & 1 ? h : -h)))));
      }
    }
    for (const body of soft) {
      const mesh = this.meshes[body.mesh];
      for (let i = 0; mesh && i < mesh.vertices3.length; i += 3) {
        take(add(body.p, rotate(body.q, mesh.vertices3.subarray(i, i + 3))));
      }
    }
    if (low[0] > high[0]) low = [-0.03, -0.01, -0.03], high = [0.03, 0.03, 0.03];
    this.centre = low.map((x, k) => 0.5 * (x + high[k]));
    this.radius = Math.max(0.03, 0.5 * norm(sub(high, low)));
  }

  geometryOf(key, source) {
    if (this.uploaded.has(key)) return this.uploaded.get(key);
    const gl = this.gl, made = { vertices: gl.createBuffer(), indices: gl.createBuffer(), count: source.indices.length };
    gl.bindVertexArray(null);
    gl.bindBuffer(gl.ARRAY_BUFFER, made.vertices);
    gl.bufferData(gl.ARRAY_BUFFER, source.vertices, gl.STATIC_DRAW);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, made.indices);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, source.indices, gl.STATIC_DRAW);
    this.uploaded.set(key, made);
    return made;
  }

  build() {
    const gl = this.gl, { bodies, shapes } = this.scene;
    for (const group of this.groups) group.vaos.forEach((vao) => gl.deleteVertexArray(vao));
    this.groups = [];
    for (let first = 0; first < bodies.length;) {
      const key = (i) => { const s = shapes[bodies[i].shape]; return s.kind + (s.mesh ?? ''); };
      let end = first + 1;
      while (end < bodies.length && key(end) === key(first)) ++end;
      const shape = shapes[bodies[first].shape];
      const source = shape.mesh === undefined ? this.unit[shape.kind] : this.meshes[shape.mesh];
      if (source) this.groups.push(this.makeGroup(first, end - first, shape.kind, this.geometryOf(key(first), source)));
      first = end;
    }
    this.soft = this.scene.soft.filter((body) => this.meshes[body.mesh]).map((body) => this.makeSoft(body));
  }

  makeGroup(first, count, kind, shared) {
    const gl = this.gl, looks = new Float32Array(kLookFloats * count);
    for (let i = 0; i < count; ++i) {
      const body = this.scene.bodies[first + i], shape = this.scene.shapes[body.shape];
      const moves = body.type === 'dynamic' ? 1 : 0;
      looks.set([...sizeOf(shape, 30 * this.radius), ...body.p, moves, ...kColours[body.type], ...(shape.middle ?? [0, 0, 0])],
        kLookFloats * i);
    }
    const look = gl.createBuffer();
    this.fill(look, looks);
    // Two: the newest poses are now in the one buffer, now in the other.
    const vaos = [0, 1].map((newest) => {
      const vao = gl.createVertexArray();
      gl.bindVertexArray(vao);
      bindGeometry(gl, shared);
      instanced(gl, look, 4 * kLookFloats, [[2, 4, 0], [3, 4, 16], [4, 4, 32], [5, 3, 48]]);
      instanced(gl, this.poses[1 - newest], kPoseBytes, [[6, 3, kPoseBytes * first], [7, 4, kPoseBytes * first + 12]]);
      instanced(gl, this.poses[newest], kPoseBytes, [[8, 3, kPoseBytes * first], [9, 4, kPoseBytes * first + 12]]);
      gl.bindVertexArray(null);
      return vao;
    });
    return { vaos, first, count, indices: shared.count, surface: kSurface[kind] ?? 0 };
  }

  makeSoft(body) {
    const gl = this.gl, mesh = this.meshes[body.mesh], vao = gl.createVertexArray(), nodes = gl.createBuffer();
    const start = new Int32Array(3 * body.nodes);
    for (let i = 0; i < body.nodes; ++i) {
      start.set(add(body.p, rotate(body.q, mesh.vertices3.subarray(3 * i, 3 * i + 3))).map((x) => Math.round(1e6 * x)), 3 * i);
    }
    const indices = gl.createBuffer();
    gl.bindVertexArray(vao);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, indices);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, mesh.indices, gl.STATIC_DRAW);
    this.fill(nodes, start);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 3, gl.INT, false, 12, 0);  // micrometres: the shader's scale makes metres of them
    gl.bindVertexArray(null);
    return { vao, nodes, first: body.first, count: body.nodes, indices: mesh.indices.length, name: body.name };
  }

  /** Poses and nodes of a frame. */
  take(frame, now_ms) {
    if (frame.poses === null && frame.nodes === null) return;
    if (this.posesAt) this.interval = Math.min(500, Math.max(5, 1000 * (frame.posesAt - this.posesAt)));
    this.posesAt = frame.posesAt;
    this.arrived = now_ms;
    if (frame.poses && frame.poses.length === this.first.length) {
      this.newest = 1 - this.newest;
      this.fill(this.poses[this.newest], frame.poses);
      this.before = this.now;
      this.now = frame.poses;
    }
    for (const body of this.soft) {
      if (frame.nodes) this.fill(body.nodes, frame.nodes.subarray(3 * body.first, 3 * (body.first + body.count)));
    }
  }

  between(now_ms) { return this.interval > 0 ? Math.min(1, Math.max(0, (now_ms - this.arrived) / this.interval)) : 1; }

  /** Where body `i` is drawn. */
  position(i, now_ms) {
    const t = this.between(now_ms), a = this.before ?? this.now, b = this.now;
    return [0, 1, 2].map((k) => a[7 * i + k] + t * (b[7 * i + k] - a[7 * i + k]));
  }

  /** Nine tenths of the moving bodies have moved less [m]. */
  movedMost() {
    const moved = [];
    this.scene.bodies.forEach((body, i) => {
      if (body.type === 'dynamic') {
        moved.push(Math.hypot(...[0, 1, 2].map((k) => this.now[7 * i + k] - body.p[k])));
      }
    });
    moved.sort((a, b) => a - b);
    return moved.length > 0 ? moved[Math.floor(0.9 * (moved.length - 1))] : 0;
  }

  draw(uniforms, now_ms) {
    const gl = this.gl;
    gl.uniform1f(uniforms.between, this.between(now_ms));
    for (const group of this.groups) {
      gl.uniform1i(uniforms.surface, group.surface);
      gl.uniform1i(uniforms.firstId, group.first + 1);
      gl.bindVertexArray(group.vaos[this.newest]);
      gl.drawElementsInstanced(gl.TRIANGLES, group.indices, gl.UNSIGNED_INT, 0, group.count);
    }
    gl.uniform1i(uniforms.surface, 2);
    this.soft.forEach((body, i) => {
      gl.uniform1i(uniforms.firstId, this.scene.bodies.length + i + 1);
      gl.bindVertexArray(body.vao);
      constants(gl, { 1: [0, 1, 0, 0], 2: [1e-6, 1e-6, 1e-6, 0], 3: [0, 0, 0, 0], 4: kSoft, 5: [0, 0, 0, 0],
        6: [0, 0, 0, 0], 7: [1, 0, 0, 0], 8: [0, 0, 0, 0], 9: [1, 0, 0, 0] });
      gl.drawElements(gl.TRIANGLES, body.indices, gl.UNSIGNED_INT, 0);
    });
    gl.bindVertexArray(null);
    return this.groups.length + this.soft.length;
  }

  nameOf(id) {
    const { bodies, soft } = this.scene;
    return id > bodies.length ? soft[id - bodies.length - 1]?.name : bodies[id - 1]?.name;
  }
}

export function bindGeometry(gl, shared) {
  gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, shared.indices);
  gl.bindBuffer(gl.ARRAY_BUFFER, shared.vertices);
  gl.enableVertexAttribArray(0);
  gl.vertexAttribPointer(0, 4, gl.FLOAT, false, 28, 0);
  gl.enableVertexAttribArray(1);
  gl.vertexAttribPointer(1, 3, gl.FLOAT, false, 28, 16);
}

/** Attributes [location, floats, first byte] of which every instance has its own. */
export function instanced(gl, buffer, stride, attributes) {
  gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
  for (const [location, floats, first] of attributes) {
    gl.enableVertexAttribArray(location);
    gl.vertexAttribPointer(location, floats, gl.FLOAT, false, stride, first);
    gl.vertexAttribDivisor(location, 1);
  }
}

function constants(gl, values) {
  for (const [location, value] of Object.entries(values)) gl.vertexAttrib4fv(Number(location), value);
}
