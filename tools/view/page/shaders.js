// One program for all solids, one for lines. Kinds of surface: 0 smooth, 1 box with edges, 2 flat, 3 ground with a grid.
const kTurn = `
vec3 turn(vec4 q, vec3 v) { return v + 2.0 * cross(q.yzw, cross(q.yzw, v) + q.x * v); }`;

export const solidVertex = `#version 300 es
layout(location = 0) in vec4 vertex;      // xyz, w: which end of a capsule
layout(location = 1) in vec3 normal;
layout(location = 2) in vec4 size;        // scale of xyz, half the straight part
layout(location = 3) in vec4 start;       // where the body began, 1: colour by how far it moved
layout(location = 4) in vec4 colour;
layout(location = 5) in vec3 middle;
layout(location = 6) in vec3 p0;
layout(location = 7) in vec4 q0;          // w x y z
layout(location = 8) in vec3 p1;
layout(location = 9) in vec4 q1;
uniform mat4 camera;
uniform float between, movedMost;         // 0…1 from the pose before to the newest; [m], 0: no colours
uniform int firstId;
out vec3 world, turned, local;
out vec4 paint;
flat out int id;
${kTurn}
vec3 ramp(float x) {                      // grey, yellow, red
  return x < 0.5 ? mix(vec3(0.62, 0.66, 0.70), vec3(0.95, 0.74, 0.22), 2.0 * x)
                 : mix(vec3(0.95, 0.74, 0.22), vec3(0.80, 0.12, 0.16), 2.0 * x - 1.0);
}
void main() {
  vec4 to = dot(q0, q1) < 0.0 ? -q1 : q1;
  vec4 q = normalize(mix(q0, to, between));
  vec3 p = mix(p0, p1, between);
  vec3 at = vertex.xyz * size.xyz + vec3(0.0, vertex.w * size.w, 0.0) + middle;
  world = turn(q, at) + p;
  turned = turn(q, normal / size.xyz);
  local = vertex.xyz;
  float moved = movedMost > 0.0 ? clamp(distance(p, start.xyz) / movedMost, 0.0, 1.0) : 0.0;
  paint = start.w > 0.5 && movedMost > 0.0 ? vec4(ramp(moved), colour.a) : colour;
  id = firstId + gl_InstanceID;
  gl_Position = camera * vec4(world, 1.0);
}`;

export const solidFragment = `#version 300 es
precision highp float;
in vec3 world, turned, local;
in vec4 paint;
flat in int id;
uniform int surface, picking;
uniform float opacity, grid, reach;       // grid: squares of the ground [m]; reach: where it fades [m]
uniform vec3 eye, ground, floor_, line, centre;
out vec4 pixel;
void main() {
  if (picking == 1) {
    pixel = vec4(vec3(ivec3(id, id >> 8, id >> 16) & 255) / 255.0, 1.0);
    return;
  }
  vec3 base = paint.rgb;
  vec3 flatNormal = cross(dFdx(world), dFdy(world));
  vec3 n = normalize(surface == 2 ? flatNormal : turned);
  if (surface == 2 && dot(n, eye - world) < 0.0) n = -n;
  if (surface == 3) {
    vec2 at = local.xz;
    vec2 width = fwidth(at) / grid;
    vec2 near = abs(fract(at / grid + 0.5) - 0.5) / max(width, vec2(1e-6));
    float ink = (1.0 - clamp(min(near.x, near.y) - 0.3, 0.0, 1.0)) * (1.0 - smoothstep(0.15, 0.5, max(width.x, width.y)));
    float away = smoothstep(0.35, 1.0, length(world - centre) / reach);
    pixel = vec4(mix(mix(floor_, line, ink), ground, away), 1.0);
    return;
  }
  if (surface == 1) {                     // the second largest coordinate is 1 on an edge
    vec3 a = abs(local);
    float second = max(min(a.x, a.y), min(max(a.x, a.y), a.z));
    float edge = 1.0 - clamp((1.0 - second) / fwidth(second), 0.0, 1.0);
    base *= 1.0 - 0.45 * edge;
  }
  float sky = 0.5 + 0.5 * n.y, sun = max(0.0, dot(n, normalize(vec3(0.35, 0.8, 0.5))));
  pixel = vec4(base * (0.42 + 0.28 * sky + 0.38 * sun), paint.a * opacity);
}`;

export const lineVertex = `#version 300 es
layout(location = 0) in vec3 vertex;
layout(location = 1) in vec4 colour;
uniform mat4 camera;
out vec4 paint;
void main() { paint = colour; gl_Position = camera * vec4(vertex, 1.0); }`;

export const lineFragment = `#version 300 es
precision highp float;
in vec4 paint;
out vec4 pixel;
void main() { pixel = paint; }`;

export function makeProgram(gl, vertex, fragment) {
  const program = gl.createProgram();
  for (const [type, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(type);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
  const uniforms = {};
  for (let i = 0; i < gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); ++i) {
    const name = gl.getActiveUniform(program, i).name;
    uniforms[name] = gl.getUniformLocation(program, name);
  }
  return { program, uniforms };
}
