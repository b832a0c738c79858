// The built-in head, drawn with WebGL 2: one colour for each part, shaded by the slope of its faces.

const VERTEX = `#version 300 es
in vec3 place; in vec3 tint; out vec3 colour; out vec3 point;
void main() {
  point = place; colour = tint;
  vec3 seen = (place - vec3(0.0, -30.0, 40.0)) / 150.0;
  gl_Position = vec4(seen.x, seen.y, -seen.z * 0.4, 1.0 - seen.z * 0.12);
}`;
const FRAGMENT = `#version 300 es
precision highp float;
in vec3 colour; in vec3 point; out vec4 shade;
void main() {
  vec3 normal = normalize(cross(dFdx(point), dFdy(point)));
  float light = 0.35 + 0.65 * max(dot(normal, normalize(vec3(0.35, 0.45, 0.85))), 0.0);
  shade = vec4(colour * light, 1.0);
}`;

export class Head {
  constructor(canvas, { rest, triangles, tints }) {
    this.rest = rest;
    this.count = triangles.length;
    const gl = (this.gl = canvas.getContext("webgl2", { preserveDrawingBuffer: true, antialias: true }));
    if (!gl) throw new Error("this browser has no WebGL 2");
    const program = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    gl.useProgram(program);
    this.places = this.attribute(program, "place", rest, gl.DYNAMIC_DRAW);
    this.attribute(program, "tint", tints, gl.STATIC_DRAW);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, triangles, gl.STATIC_DRAW);
    gl.enable(gl.DEPTH_TEST);
    gl.clearColor(0.11, 0.13, 0.15, 1);
  }

  attribute(program, name, values, use) {
    const { gl } = this;
    const buffer = gl.createBuffer();
    const slot = gl.getAttribLocation(program, name);
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ARRAY_BUFFER, values, use);
    gl.enableVertexAttribArray(slot);
    gl.vertexAttribPointer(slot, 3, gl.FLOAT, false, 0, 0);
    return buffer;
  }

  // Displacements [V * 3] in mm.
  draw(displacements) {
    const { gl } = this;
    gl.bindBuffer(gl.ARRAY_BUFFER, this.places);
    gl.bufferSubData(gl.ARRAY_BUFFER, 0, this.rest.map((value, k) => value + displacements[k]));
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.drawElements(gl.TRIANGLES, this.count, gl.UNSIGNED_SHORT, 0);
  }
}
