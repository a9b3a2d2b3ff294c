// One picture: bodies, hands, lines, and which body is under the mouse.
import { Bodies } from './bodies.js';
import { Pieces } from './pieces.js';
import { lineFragment, lineVertex, makeProgram, solidFragment, solidVertex } from './shaders.js';
import { niceAbove } from './math.js';

const kThemes = {
  light: { ground: [0.933, 0.945, 0.957], floor: [0.90, 0.915, 0.93], line: [0.74, 0.78, 0.81] },
  dark: { ground: [0.078, 0.094, 0.110], floor: [0.13, 0.15, 0.17], line: [0.27, 0.31, 0.34] },
};

export class Renderer {
  /** @param low Without smoothed edges, for software rendering. */
  constructor(canvas, low) {
    this.canvas = canvas;
    this.low = low;
    this.gl = canvas.getContext('webgl2', { antialias: !low, alpha: false, powerPreference: 'high-performance' });
    if (!this.gl) throw new Error('this browser has no WebGL 2');
    this.solid = makeProgram(this.gl, solidVertex, solidFragment);
    this.lines = makeProgram(this.gl, lineVertex, lineFragment);
    this.bodies = new Bodies(this.gl);
    this.pieces = new Pieces(this.gl, this.bodies);
    this.theme = 'light';
    this.movedMost = 0;
    this.calls = 0;
  }

  resize() {
    const ratio = this.low ? 1 : Math.min(2, window.devicePixelRatio);
    const width = Math.round(this.canvas.clientWidth * ratio), height = Math.round(this.canvas.clientHeight * ratio);
    if (width === this.canvas.width && height === this.canvas.height) return;
    this.canvas.width = width;
    this.canvas.height = height;
  }

  /** Nothing but the background: there is no scene yet. */
  clear() {
    this.gl.clearColor(...kThemes[this.theme].ground, 1);
    this.gl.clear(this.gl.COLOR_BUFFER_BIT);
  }

  begin(camera, picking) {
    const gl = this.gl, u = this.solid.uniforms, theme = kThemes[this.theme];
    gl.viewport(0, 0, this.canvas.width, this.canvas.height);
    gl.clearColor(...(picking ? [0, 0, 0] : theme.ground), 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.disable(gl.BLEND);
    gl.depthMask(true);
    gl.depthFunc(gl.LESS);
    gl.useProgram(this.solid.program);
    gl.uniformMatrix4fv(u.camera, false, camera.matrix());
    gl.uniform3fv(u.eye, camera.eye());
    gl.uniform3fv(u.ground, theme.ground);
    gl.uniform3fv(u.floor_, theme.floor);
    gl.uniform3fv(u.line, theme.line);
    gl.uniform3fv(u.centre, this.bodies.centre);
    gl.uniform1f(u.reach, 12 * this.bodies.radius);
    // The ground's own coordinates go from −1 to 1.
    gl.uniform1f(u.grid, niceAbove(this.bodies.radius / 8) / (30 * this.bodies.radius));
    gl.uniform1f(u.opacity, 1);
    gl.uniform1f(u.movedMost, this.movedMost);
    gl.uniform1i(u.picking, picking ? 1 : 0);
  }

  draw(camera, hands, show, now_ms) {
    const gl = this.gl, u = this.solid.uniforms;
    this.begin(camera, false);
    this.calls = this.bodies.draw(u, now_ms);
    this.pieces.clear();
    hands.draw(this.pieces, show);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    // What is behind or inside a body shines through.
    gl.depthMask(false);
    gl.depthFunc(gl.GREATER);
    gl.uniform1f(u.opacity, 0.28);
    this.pieces.drawSolids(u);
    gl.depthMask(true);
    gl.depthFunc(gl.LESS);
    gl.uniform1f(u.opacity, 1);
    this.pieces.drawSolids(u);
    gl.useProgram(this.lines.program);
    gl.uniformMatrix4fv(this.lines.uniforms.camera, false, camera.matrix());
    this.pieces.drawLines();
  }

  /** Name of the body at CSS pixel (x, y). Draws over the picture: a draw() has to follow. */
  pick(camera, x, y, now_ms) {
    const gl = this.gl, ratio = this.canvas.width / this.canvas.clientWidth, pixel = new Uint8Array(4);
    const px = Math.round(x * ratio), py = this.canvas.height - 1 - Math.round(y * ratio);
    gl.enable(gl.SCISSOR_TEST);
    gl.scissor(px, py, 1, 1);
    this.begin(camera, true);
    this.bodies.draw(this.solid.uniforms, now_ms);
    gl.readPixels(px, py, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
    gl.disable(gl.SCISSOR_TEST);
    const id = pixel[0] + 256 * pixel[1] + 65536 * pixel[2];
    return id > 0 ? this.bodies.nameOf(id) : undefined;
  }

  /** Colours [r, g, b] 0…255 at CSS pixels, of the picture just drawn. */
  colours(points) {
    const gl = this.gl, ratio = this.canvas.width / this.canvas.clientWidth, pixel = new Uint8Array(4);
    return points.map(([x, y]) => {
      gl.readPixels(Math.round(x * ratio), this.canvas.height - 1 - Math.round(y * ratio), 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
      return [...pixel.subarray(0, 3)];
    });
  }
}
