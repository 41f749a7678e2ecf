// SPDX-License-Identifier: Apache-2.0
// The points of a disparity in WebGL: seen from the left camera at first, turned by dragging, with one of them marked.

const CLOUD_VERTEX = `
attribute vec4 point;  // metres right, down and forward; brightness 0..1
uniform mat4 view;
uniform float size;
varying float brightness;
void main() {
  gl_Position = view * vec4(point.xyz, 1.0);
  gl_PointSize = size;
  brightness = point.w;
}`;
const CLOUD_FRAGMENT = `
precision mediump float;
uniform vec3 tint;
varying float brightness;
void main() { gl_FragColor = vec4(tint * (0.25 + 0.75 * brightness), 1.0); }`;
const TINTS = { measured: [1.0, 0.78, 0.55], simulated: [0.6, 0.8, 1.0], pointer: [1.0, 0.25, 0.1] };
const NEAR_SHARE = 0.02;  // the nearest plane, of the distance

class Cloud {
  constructor(canvas) {
    this.canvas = canvas;
    this.clouds = {};  // name -> {buffer, count}
    this.gl = canvas.getContext("webgl", { preserveDrawingBuffer: true });
    if (this.gl) this._prepare();
    this._listen();
    this.centre = [0, 0, 1];
    this.reset();
  }

  // Float32Array of x, y, z in metres, in the left camera's axes, and brightness; none where there is no disparity.
  static points(image, disparity, facts, high) {
    const points = new Float32Array(4 * disparity.length);
    let size = 0;
    for (let i = 0; i < disparity.length; ++i) {
      if (Number.isNaN(disparity[i])) continue;
      points.set(Cloud.place(i, disparity[i], facts), size);
      points[size + 3] = Math.sqrt(Math.min(image[i] / high, 1));
      size += 4;
    }
    return points.subarray(0, size);
  }

  // Metres of the pixel number i.
  static place(i, disparity, { width, k, focal_baseline_px_m }) {
    const z = focal_baseline_px_m / disparity;
    const y = (Math.floor(i / width) - k[5]) / k[4];
    return [z * (((i % width) - k[2] - k[1] * y) / k[0]), z * y, z];
  }

  // Shows these points under a name; none for an empty array.
  put(name, points) {
    if (!this.gl) return;
    this.clouds[name] = this.clouds[name] || { buffer: this.gl.createBuffer(), count: 0 };
    this.gl.bindBuffer(this.gl.ARRAY_BUFFER, this.clouds[name].buffer);
    this.gl.bufferData(this.gl.ARRAY_BUFFER, points, this.gl.DYNAMIC_DRAW);
    this.clouds[name].count = points.length / 4;
    this.canvas.dataset[name] = String(points.length / 4);
  }

  // Looks at the middle of these points from the left camera's position.
  aimAt(points) {
    const depths = points.filter((value, i) => i % 4 === 2).sort();
    this.centre = [0, 0, depths.length ? depths[depths.length >> 1] : 1];
    this.reset();
  }

  reset() {
    [this.yaw, this.pitch, this.distance] = [0, 0, this.centre[2]];
    this.draw();
  }

  turn(yaw, pitch) {
    this.yaw += yaw;
    this.pitch = Math.min(Math.max(this.pitch + pitch, -1.55), 1.55);
    this.draw();
  }

  come(factor) {
    this.distance = Math.min(Math.max(this.distance * factor, 0.05 * this.centre[2]), 20 * this.centre[2]);
    this.draw();
  }

  // The 4x4 matrix, column by column, to the clip space: turned about the centre, then as a camera at `distance` sees it.
  matrix() {
    const [cy, sy, cp, sp] = [Math.cos(this.yaw), Math.sin(this.yaw), Math.cos(this.pitch), Math.sin(this.pitch)];
    const rows = [[cy, 0, sy], [sp * sy, cp, -sp * cy], [-cp * sy, sp, cp * cy]];
    const moved = rows.map((row) => -row.reduce((sum, value, i) => sum + value * this.centre[i], 0));
    moved[2] += this.distance;
    const [near, far] = [NEAR_SHARE * this.distance, 50 * this.distance];
    const zoom = 1.9;  // the clip space's height over the distance
    const wide = (zoom * this.canvas.height) / Math.max(this.canvas.width, 1);
    const scale = (far + near) / (far - near);
    const column = ([x, y, z], w) => [wide * x, -zoom * y, scale * z - (w ? (2 * far * near) / (far - near) : 0), z];
    return new Float32Array([...[0, 1, 2].flatMap((i) => column(rows.map((row) => row[i]), false)), ...column(moved, true)]);
  }

  draw() {
    const { gl, canvas } = this;
    if (!gl) return;
    canvas.width = Math.max(1, Math.round(canvas.clientWidth * window.devicePixelRatio));
    canvas.height = Math.max(1, Math.round(canvas.clientHeight * window.devicePixelRatio));
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.uniformMatrix4fv(this.places.view, false, this.matrix());
    for (const [name, { buffer, count }] of Object.entries(this.clouds).sort(([a], [b]) => (a === "pointer") - (b === "pointer"))) {
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.vertexAttribPointer(0, 4, gl.FLOAT, false, 0, 0);
      gl.uniform3fv(this.places.tint, TINTS[name]);
      gl.uniform1f(this.places.size, (name === "pointer" ? 9 : 2) * window.devicePixelRatio);
      if (name === "pointer") gl.clear(gl.DEPTH_BUFFER_BIT);  // nothing hides it
      gl.drawArrays(gl.POINTS, 0, count);
    }
    canvas.dataset.shown = [this.yaw, this.pitch, this.distance].map((value) => value.toFixed(4)).join(" ");
  }

  _prepare() {
    const { gl } = this;
    const program = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, CLOUD_VERTEX], [gl.FRAGMENT_SHADER, CLOUD_FRAGMENT]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.bindAttribLocation(program, 0, "point");
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(`WebGL: ${gl.getProgramInfoLog(program)}`);
    gl.useProgram(program);
    gl.enableVertexAttribArray(0);
    gl.enable(gl.DEPTH_TEST);
    this.places = Object.fromEntries(["view", "tint", "size"].map((name) => [name, gl.getUniformLocation(program, name)]));
  }

  _listen() {
    const { canvas } = this;
    let held = null;
    canvas.addEventListener("pointerdown", (event) => { held = [event.clientX, event.clientY]; canvas.setPointerCapture(event.pointerId); });
    canvas.addEventListener("pointerup", () => { held = null; });
    canvas.addEventListener("pointermove", (event) => {
      if (!held) return;
      this.turn((event.clientX - held[0]) / 150, (event.clientY - held[1]) / 150);
      held = [event.clientX, event.clientY];
    });
    canvas.addEventListener("wheel", (event) => { event.preventDefault(); this.come(Math.pow(2, event.deltaY / 480)); }, { passive: false });
    canvas.addEventListener("dblclick", () => this.reset());
    const turns = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1] };
    canvas.addEventListener("keydown", (event) => {
      if (event.key in turns) this.turn(...turns[event.key]);
      else if (event.key === "+" || event.key === "=") this.come(0.8);
      else if (event.key === "-") this.come(1.25);
      else if (event.key === "0") this.reset();
      else return;
      event.preventDefault();
    });
  }
}
