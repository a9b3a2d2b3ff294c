// Things made anew for every picture: the parts of hands and contacts, and lines.
import * as geometry from './geometry.js';
import { bindGeometry, instanced } from './bodies.js';
import { add, norm, scale, sub, turnY, unit } from './math.js';

const kFloats = 22;  // size 4, start 4, colour 4, middle 3, pose 7

export class Pieces {
  constructor(gl, bodies) {
    this.gl = gl;
    this.kinds = ['sphere', 'cylinder', 'cone'].map((kind) => {
      const shared = bodies.geometryOf(`piece ${kind}`, geometry[kind]());
      const vao = gl.createVertexArray(), buffer = gl.createBuffer();
      gl.bindVertexArray(vao);
      bindGeometry(gl, shared);
      instanced(gl, buffer, 4 * kFloats, [[2, 4, 0], [3, 4, 16], [4, 4, 32], [5, 3, 48], [6, 3, 60], [7, 4, 72],
        [8, 3, 60], [9, 4, 72]]);
      gl.bindVertexArray(null);
      return { kind, vao, buffer, indices: shared.count, rows: [] };
    });
    this.lineVao = gl.createVertexArray();
    this.lineBuffer = gl.createBuffer();
    gl.bindVertexArray(this.lineVao);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.lineBuffer);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 28, 0);
    gl.enableVertexAttribArray(1);
    gl.vertexAttribPointer(1, 4, gl.FLOAT, false, 28, 12);
    gl.bindVertexArray(null);
    this.clear();
  }

  clear() {
    for (const kind of this.kinds) kind.rows = [];
    this.lines = [];
  }

  put(kind, p, q, size, colour) {  // size: 3; no straight part, no start, no middle
    this.kinds.find((k) => k.kind === kind).rows.push(...size, 0, 0, 0, 0, 0, ...colour, 0, 0, 0, ...p, ...q);
  }
  sphere(p, radius, colour) { this.put('sphere', p, [1, 0, 0, 0], [radius, radius, radius], colour); }
  rod(a, b, radius, colour) {
    const along = sub(b, a), length = norm(along);
    if (length > 0) this.put('cylinder', scale(add(a, b), 0.5), turnY(unit(along)), [radius, length / 2, radius], colour);
  }
  /** From `a` to exactly `b`. */
  arrow(a, b, radius, colour) {
    const along = sub(b, a), length = norm(along), head = Math.min(5 * radius, 0.6 * length);
    if (length <= 0) return;
    const neck = sub(b, scale(along, head / length));
    this.rod(a, neck, Math.min(radius, 0.3 * head), colour);
    this.put('cone', neck, turnY(unit(along)), [Math.min(2.4 * radius, 0.5 * head), head, Math.min(2.4 * radius, 0.5 * head)], colour);
  }
  line(a, b, colourA, colourB = colourA) { this.lines.push(...a, ...colourA, ...b, ...colourB); }

  drawSolids(uniforms) {
    const gl = this.gl;
    gl.uniform1f(uniforms.between, 1);
    gl.uniform1i(uniforms.surface, 0);
    for (const { vao, buffer, indices, rows } of this.kinds) {
      if (rows.length === 0) continue;
      gl.bindVertexArray(vao);
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(rows), gl.STREAM_DRAW);
      gl.drawElementsInstanced(gl.TRIANGLES, indices, gl.UNSIGNED_INT, 0, rows.length / kFloats);
    }
    gl.bindVertexArray(null);
  }

  drawLines() {
    const gl = this.gl;
    if (this.lines.length === 0) return;
    gl.bindVertexArray(this.lineVao);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.lineBuffer);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(this.lines), gl.STREAM_DRAW);
    gl.drawArrays(gl.LINES, 0, this.lines.length / 7);
    gl.bindVertexArray(null);
  }
}
