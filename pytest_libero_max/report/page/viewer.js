// Shows the arms of a pair in three dimensions, at the step of the scrubber: plain WebGL over the shapes and poses
// that the page holds. A scene is unpacked when its case is opened, and drawn when something changes.

const POSITION_M = 1e-4;
const TURN = 1 / 32767;
const MOST_PIXELS_EACH_WAY = 2;
const NARROWEST_PX = 300; // two arms are beside each other only where each has so much
const VIEW_ANGLE = Math.PI / 4;

// Vectors, and matrices of four columns.

const add = (a, b, share = 1) => a.map((value, place) => value + share * b[place]);
const dot = (a, b) => a.reduce((sum, value, place) => sum + value * b[place], 0);
const cross = ([a, b, c], [x, y, z]) => [b * z - c * y, c * x - a * z, a * y - b * x];
const unit = (a) => a.map((value) => value / (Math.hypot(...a) || 1));

function product(a, b) {
  const made = new Float32Array(16);
  for (let column = 0; column < 4; column++)
    for (let row = 0; row < 4; row++)
      for (let part = 0; part < 4; part++) made[4 * column + row] += a[4 * part + row] * b[4 * column + part];
  return made;
}

// The matrix of a pose: position, then w, x, y, z.
function placed([x, y, z, w, i, j, k], [sx, sy, sz] = [1, 1, 1]) {
  return new Float32Array([
    sx * (1 - 2 * (j * j + k * k)), sx * 2 * (i * j + k * w), sx * 2 * (i * k - j * w), 0,
    sy * 2 * (i * j - k * w), sy * (1 - 2 * (i * i + k * k)), sy * 2 * (j * k + i * w), 0,
    sz * 2 * (i * k + j * w), sz * 2 * (j * k - i * w), sz * (1 - 2 * (i * i + j * j)), 0,
    x, y, z, 1,
  ]);
}

// What turns normals: each column of the upper matrix by its squared length.
function turning(m) {
  const columns = [0, 4, 8].map((at) => [m[at], m[at + 1], m[at + 2]]);
  return new Float32Array(columns.flatMap((column) => column.map((value) => value / (dot(column, column) || 1))));
}

function seenFrom(eye, target, angle, aspect) {
  const back = unit(add(eye, target, -1));
  const right = unit(cross([0, 0, 1], back));
  const up = cross(back, right);
  const [near, far, f] = [0.02, 30, 1 / Math.tan(angle / 2)];
  const view = [
    right[0], up[0], back[0], 0, right[1], up[1], back[1], 0, right[2], up[2], back[2], 0,
    -dot(right, eye), -dot(up, eye), -dot(back, eye), 1,
  ];
  const lens = [f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) / (near - far), -1, 0, 0, (2 * far * near) / (near - far), 0];
  return product(lens, view);
}

// Shapes: eight numbers a corner (place, normal, place in the texture), and the corners of the triangles.

function meshOf(buffer) {
  const [corners, triangles, textured] = new Uint32Array(buffer, 0, 3);
  const scales = new Float32Array(buffer, 12, 10);
  let at = 52;
  const taken = (kind, number) => {
    const values = new kind(buffer, at, number);
    at += number * kind.BYTES_PER_ELEMENT;
    return values;
  };
  const [places, flat] = [taken(Uint16Array, 3 * corners), taken(Uint16Array, 2 * corners)];
  const indices = taken(Uint16Array, 3 * triangles);
  const normals = taken(Int8Array, 3 * corners);
  const values = new Float32Array(8 * corners);
  for (let corner = 0; corner < corners; corner++) {
    for (let axis = 0; axis < 3; axis++) {
      values[8 * corner + axis] = scales[axis] + (scales[3 + axis] * places[3 * corner + axis]) / 65535;
      values[8 * corner + 3 + axis] = normals[3 * corner + axis] / 127;
    }
    for (let axis = 0; axis < 2; axis++) {
      const own = scales[6 + axis] + (scales[8 + axis] * flat[2 * corner + axis]) / 65535;
      values[8 * corner + 6 + axis] = textured ? own : 0.5;
    }
  }
  return { values, indices };
}

// A surface over a grid of two parameters, 0 to 1; `at` gives place and normal.
function gridOf(columns, rows, at) {
  const [values, indices] = [[], []];
  for (let row = 0; row <= rows; row++)
    for (let column = 0; column <= columns; column++) values.push(...at(column / columns, row / rows).flat(), column / columns, row / rows);
  for (let row = 0; row < rows; row++)
    for (let column = 0; column < columns; column++) {
      const first = row * (columns + 1) + column;
      const next = first + columns + 1;
      indices.push(first, first + 1, next + 1, first, next + 1, next);
    }
  return { values, indices };
}

function joined(...shapes) {
  const made = { values: [], indices: [] };
  for (const { values, indices } of shapes) {
    const before = made.values.length / 8;
    for (const index of indices) made.indices.push(index + before);
    made.values.push(...values);
  }
  return made;
}

const around = (share) => [Math.cos(2 * Math.PI * share), Math.sin(2 * Math.PI * share)];

function side(normal, across, up) {
  return gridOf(1, 1, (s, t) => [add(add(normal, across, 2 * s - 1), up, 2 * t - 1), normal]);
}

// Shapes of half size 1; a capsule is shown as a cylinder.
const SHAPES = {
  plane: () => gridOf(1, 1, (s, t) => [[2 * s - 1, 2 * t - 1, 0], [0, 0, 1]]),
  box: () =>
    joined(
      ...[[1, 0, 0], [0, 1, 0], [0, 0, 1]].flatMap((axis) => {
        const next = [axis[2], axis[0], axis[1]];
        const turned = axis.map((value) => -value);
        return [side(axis, next, cross(axis, next)), side(turned, next, cross(turned, next))];
      }),
    ),
  sphere: () =>
    gridOf(24, 12, (s, t) => {
      const [x, y] = around(s);
      const [height, width] = [-Math.cos(Math.PI * t), Math.sin(Math.PI * t)];
      const place = [width * x, width * y, height];
      return [place, place];
    }),
  cylinder: () =>
    joined(
      gridOf(32, 1, (s, t) => [[...around(s), 2 * t - 1], [...around(s), 0]]),
      gridOf(32, 1, (s, t) => [[...around(s).map((value) => value * (1 - t)), 1], [0, 0, 1]]),
      gridOf(32, 1, (s, t) => [[...around(s).map((value) => value * t), -1], [0, 0, -1]]),
    ),
};
SHAPES.capsule = SHAPES.cylinder;

// The poses and shapes of a pair, from what the page holds.
class Scene {
  static async load(name) {
    if (document.readyState === "loading") await new Promise((done) => document.addEventListener("DOMContentLoaded", done));
    const held = (key) => unpack(document.querySelector(`.scene-data[data-name="${CSS.escape(key)}"]`), "arrayBuffer");
    const bytes = await held(name);
    const length = new DataView(bytes).getUint32(0, true);
    const header = JSON.parse(new TextDecoder().decode(new Uint8Array(bytes, 4, length)));
    const shapes = header.geoms.map(([, shape]) => shape).filter((shape) => !SHAPES[shape]);
    const names = [...new Set([...shapes, ...Object.values(header.textures)])];
    const parts = new Map(await Promise.all(names.map(async (key) => [key, await held(key)])));
    const pictures = await Promise.all(
      Object.entries(header.textures).map(async ([number, key]) => [number, await createImageBitmap(new Blob([parts.get(key)], { type: "image/webp" }))]),
    );
    return new Scene(header, new Uint8Array(bytes, 4 + length), parts, new Map(pictures));
  }

  constructor(header, moves, parts, pictures) {
    Object.assign(this, header, { parts, pictures });
    this.row = new Map(this.moving.map((body, place) => [body, place]));
    let at = 0;
    for (const arm of this.arms) {
      const [columns, rows] = [7 * this.moving.length, arm.steps - arm.from + 1];
      const size = columns * rows;
      arm.poses = new Int16Array(size); // a column after another, as they are packed
      for (let column = 0; column < columns; column++) {
        let value = 0;
        for (let row = 0; row < rows; row++) {
          const place = column * rows + row;
          value += moves[at + place] | (moves[at + size + place] << 8);
          arm.poses[place] = value;
          value = arm.poses[place];
        }
      }
      at += 2 * size;
    }
  }

  // The pose of a body after a step of an arm: m, and w, x, y, z.
  pose(arm, body, step) {
    const fixed = this.bodies[body][1];
    if (fixed) return fixed;
    const last = Math.min(step, arm.steps);
    if (last < arm.from) return this.pose(this.arms[0], body, last);
    const rows = arm.steps - arm.from + 1;
    return Array.from({ length: 7 }, (_, part) => {
      const value = arm.poses[(7 * this.row.get(body) + part) * rows + last - arm.from];
      return value * (part < 3 ? POSITION_M : TURN);
    });
  }

  // The value of a list of changes that holds after a step.
  at(changes, step) {
    return changes.findLast(([from]) => from <= step)[1];
  }
}

const VERTEX = `#version 300 es
in vec3 place; in vec3 normal; in vec2 spot;
uniform mat4 seen, model; uniform mat3 turn; uniform vec2 repeat; uniform float dots;
out vec3 towards, where; out vec2 at;
void main() {
  vec4 world = model * vec4(place, 1.0);
  where = world.xyz; towards = turn * normal; at = spot * repeat;
  gl_Position = seen * world; gl_PointSize = dots;
}`;
const FRAGMENT = `#version 300 es
precision mediump float;
in vec3 towards, where; in vec2 at;
uniform vec4 colour; uniform vec3 eye; uniform float light; uniform int kind; uniform sampler2D picture;
out vec4 drawn;
void main() {
  vec3 n = normalize(towards), v = normalize(eye - where);
  if (kind == 2) { drawn = colour; return; }
  if (kind == 1) { drawn = vec4(colour.rgb, colour.a * (0.3 + 0.7 * pow(1.0 - abs(dot(n, v)), 2.0))); return; }
  vec4 own = colour * texture(picture, at);
  float lamps = 0.46 + 0.34 * max(dot(n, normalize(vec3(0.42, 0.34, 0.84))), 0.0) + 0.26 * max(dot(n, v), 0.0);
  drawn = vec4(own.rgb * lamps * light, own.a);
}`;
const SOLID = 0;
const GHOST = 1;
const FLAT = 2;

// What draws a scene into a canvas.
class Painter {
  constructor(canvas, scene) {
    this.canvas = canvas;
    this.scene = scene;
    const gl = canvas.getContext("webgl2", { antialias: true });
    if (!gl) throw new Error("This browser draws no WebGL 2, which poses in three dimensions need.");
    this.gl = gl;
    const program = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    ["place", "normal", "spot"].forEach((name, index) => gl.bindAttribLocation(program, index, name));
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(`WebGL: ${gl.getProgramInfoLog(program)}`);
    gl.useProgram(program);
    this.uniform = new Proxy({}, { get: (known, name) => (known[name] ??= gl.getUniformLocation(program, name)) });
    gl.enable(gl.DEPTH_TEST);
    gl.enable(gl.CULL_FACE);
    gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    const shapes = new Map();
    const shape = (name) => {
      if (!shapes.has(name)) shapes.set(name, this.stored(SHAPES[name] ? SHAPES[name]() : meshOf(scene.parts.get(name))));
      return shapes.get(name);
    };
    this.geoms = scene.geoms.map(([body, name, size, pose]) => ({
      body,
      shape: shape(name),
      own: placed(pose, SHAPES[name] ? size : [1, 1, 1]),
    }));
    this.textures = new Map([...scene.pictures].map(([number, picture]) => [Number(number), this.texture(picture)]));
    this.white = this.texture(null);
    this.lines = gl.createVertexArray();
    this.lineBuffer = gl.createBuffer();
    gl.bindVertexArray(this.lines);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.lineBuffer);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
    gl.vertexAttrib3f(1, 0, 0, 1);
  }

  stored({ values, indices }) {
    const gl = this.gl;
    const array = gl.createVertexArray();
    gl.bindVertexArray(array);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(values), gl.STATIC_DRAW);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, new Uint16Array(indices), gl.STATIC_DRAW);
    for (const [index, size, offset] of [[0, 3, 0], [1, 3, 12], [2, 2, 24]]) {
      gl.enableVertexAttribArray(index);
      gl.vertexAttribPointer(index, size, gl.FLOAT, false, 32, offset);
    }
    return { array, count: indices.length };
  }

  texture(picture) {
    const gl = this.gl;
    const made = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, made);
    if (picture) gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, picture);
    else gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, 1, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array([255, 255, 255, 255]));
    gl.generateMipmap(gl.TEXTURE_2D);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR_MIPMAP_LINEAR);
    return made;
  }

  // Draws into a part of the canvas: x, y from below, width and height in pixels.
  begin([x, y, width, height], { eye, target }) {
    const gl = this.gl;
    gl.viewport(x, y, width, height);
    const aspect = width / height;
    const angle = 2 * Math.atan(Math.tan(VIEW_ANGLE / 2) / Math.min(aspect, 1));
    gl.uniformMatrix4fv(this.uniform.seen, false, seenFrom(eye, target, angle, aspect));
    gl.uniform3fv(this.uniform.eye, eye);
  }

  // Geoms of an arm at a step. `tint`: draws those that `which` accepts as a coloured shell; otherwise all as they are.
  bodies(arm, step, tint = null, which = null, poses = null) {
    const { gl, scene, uniform } = this;
    const looks = scene.at(arm.looks, step);
    gl.uniform1f(uniform.light, scene.at(arm.lights, step));
    gl.uniform1i(uniform.kind, tint ? GHOST : SOLID);
    const known = new Map();
    const matrix = (body) => {
      if (!known.has(body)) known.set(body, placed(poses?.get(body) ?? scene.pose(arm, body, step)));
      return known.get(body);
    };
    const see = tint ? [true] : [false, true]; // what is seen through comes last
    for (const through of see) {
      if (through) gl.enable(gl.BLEND);
      else gl.disable(gl.BLEND);
      gl.depthMask(!through);
      this.geoms.forEach(({ body, shape, own }, place) => {
        const surface = scene.surfaces[looks[place]];
        if (tint ? !which(body) || (looks[place] < 0 && !poses) : !surface || surface[3] < 1 !== through) return;
        const model = product(matrix(body), own);
        gl.uniformMatrix4fv(uniform.model, false, model);
        gl.uniformMatrix3fv(uniform.turn, false, turning(model));
        gl.uniform4fv(uniform.colour, tint ?? surface.slice(0, 4));
        gl.uniform2fv(uniform.repeat, surface ? surface.slice(5) : [1, 1]);
        gl.bindTexture(gl.TEXTURE_2D, (surface && this.textures.get(surface[4])) || this.white);
        gl.bindVertexArray(shape.array);
        gl.drawElements(gl.TRIANGLES, shape.count, gl.UNSIGNED_SHORT, 0);
      });
    }
    gl.depthMask(true);
    gl.disable(gl.BLEND);
  }

  // Lines or points in one colour.
  flat(mode, places, colour, dots = 1) {
    const { gl, uniform } = this;
    gl.uniform1i(uniform.kind, FLAT);
    gl.uniform1f(uniform.dots, dots);
    gl.uniform4fv(uniform.colour, colour);
    gl.uniformMatrix4fv(uniform.model, false, placed([0, 0, 0, 1, 0, 0, 0]));
    gl.bindVertexArray(this.lines);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.lineBuffer);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(places), gl.DYNAMIC_DRAW);
    gl.drawArrays(mode, 0, places.length / 3);
  }

  // The picture of a camera, 15 cm before it, as a pyramid.
  pyramid([x, y, z, ...rest], colour) {
    const turn = rest.slice(0, 9);
    const half = Math.tan(rest[9] / 2);
    const corner = (right, up) => [0, 1, 2].map((axis) => [x, y, z][axis] + 0.15 * (half * (right * turn[3 * axis] + up * turn[3 * axis + 1]) - turn[3 * axis + 2]));
    const corners = [corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1)];
    this.flat(this.gl.LINES, corners.flatMap((one, place) => [x, y, z, ...one, ...one, ...corners[(place + 1) % 4]]), colour);
  }

  close() {
    this.gl.getExtension("WEBGL_lose_context")?.loseContext();
  }
}

let opened = null; // one scene at a time has a context of the browser's, which are few

// The figure of a pair in three dimensions.
class SceneView {
  constructor(name, timeline) {
    this.timeline = timeline;
    this.step = 0;
    this.overlaid = false;
    this.canvas = element("canvas", { tabindex: 0, role: "img", "aria-label": "Both arms in three dimensions" });
    this.labels = element("div", { class: "arms" });
    this.status = element("p", { class: "muted" }, "Unpacking the scene …");
    const overlay = element("button", { type: "button", "aria-pressed": "false" }, "Over each other");
    overlay.addEventListener("click", () => {
      this.overlaid = !this.overlaid;
      overlay.setAttribute("aria-pressed", String(this.overlaid));
      this.fit();
    });
    const back = element("button", { type: "button" }, "View of the camera");
    back.addEventListener("click", () => (this.look(), this.ask()));
    const help = element("span", { class: "muted" }, "Drag to turn, with shift to move; click, then wheel to zoom.");
    this.element = element("figure", { class: "scene" }, element("div", { class: "stage" }, this.canvas, this.labels), this.status, element("div", { class: "transport" }, overlay, back, help));
    this.element.shown = this;
    opened?.close();
    opened = this;
    this.ready = this.open(name);
  }

  async open(name) {
    try {
      this.scene = await Scene.load(name);
      this.painter = new Painter(this.canvas, this.scene);
    } catch (error) {
      this.status.textContent = error.message;
      this.canvas.remove();
      return;
    }
    this.status.remove();
    this.look();
    this.control();
    this.fit();
    this.watcher = new ResizeObserver(() => this.fit());
    this.watcher.observe(this.canvas);
  }

  // The first camera of the scene, and what it looks at.
  look() {
    const [, camera] = this.scene.arms[0].cameras[0];
    const forward = [-camera[5], -camera[8], -camera[11]];
    const hand = this.scene.arms[0].hand.slice(0, 3).map((value) => value / 1000);
    this.distance = Math.max(0.3, dot(add(hand, camera.slice(0, 3), -1), forward));
    this.target = add(camera.slice(0, 3), forward, this.distance);
    this.yaw = Math.atan2(-forward[1], -forward[0]);
    this.pitch = Math.asin(-forward[2]);
  }

  get eye() {
    const flat = Math.cos(this.pitch) * this.distance;
    return add(this.target, [flat * Math.cos(this.yaw), flat * Math.sin(this.yaw), Math.sin(this.pitch) * this.distance]);
  }

  turn(across, up) {
    this.yaw -= across * 0.008;
    this.pitch = Math.min(1.5, Math.max(-0.3, this.pitch + up * 0.008));
    this.ask();
  }

  move(across, up) {
    const right = [-Math.sin(this.yaw), Math.cos(this.yaw), 0];
    const above = unit(cross(add(this.eye, this.target, -1), right));
    const scale = this.distance * 0.002;
    this.target = add(add(this.target, right, -across * scale), above, up * scale);
    this.ask();
  }

  zoom(factor) {
    this.distance = Math.min(6, Math.max(0.15, this.distance * factor));
    this.ask();
  }

  // Mouse, fingers and keys. One finger up and down scrolls the page; two turn and zoom.
  control() {
    const { canvas } = this;
    const fingers = new Map();
    const spread = () => {
      const [one, other] = [...fingers.values()];
      return other ? Math.hypot(one[0] - other[0], one[1] - other[1]) : 0;
    };
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      canvas.focus({ preventScroll: true });
      fingers.set(event.pointerId, [event.clientX, event.clientY]);
    });
    canvas.addEventListener("pointermove", (event) => {
      const before = fingers.get(event.pointerId);
      if (!before) return;
      const wide = spread();
      fingers.set(event.pointerId, [event.clientX, event.clientY]);
      const way = [event.clientX - before[0], event.clientY - before[1]].map((part) => part / fingers.size);
      if (wide && spread()) this.zoom(wide / spread());
      if (event.shiftKey || event.buttons & 2) this.move(...way);
      else this.turn(...way);
    });
    for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, (event) => fingers.delete(event.pointerId));
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener(
      "wheel",
      (event) => {
        if (document.activeElement !== canvas) return; // the page scrolls
        event.preventDefault();
        this.zoom(Math.exp(event.deltaY * 0.001));
      },
      { passive: false },
    );
    const keys = { ArrowLeft: [-20, 0], ArrowRight: [20, 0], ArrowUp: [0, 20], ArrowDown: [0, -20] };
    canvas.addEventListener("keydown", (event) => {
      if (keys[event.key]) this.turn(...keys[event.key]);
      else if (event.key === "+") this.zoom(0.9);
      else if (event.key === "-") this.zoom(1.1);
      else return;
      event.preventDefault();
    });
  }

  show(step) {
    this.step = step;
    this.ask();
  }

  // Draws once before the next picture, however many changes there were.
  ask() {
    if (!this.painter || this.asked) return;
    this.asked = requestAnimationFrame(() => {
      this.asked = 0;
      if (this.canvas.isConnected) this.draw();
      else this.close();
    });
  }

  get arms() {
    return this.overlaid ? this.scene.arms.slice(-1) : this.scene.arms;
  }

  // The places of the arms in the canvas: x, y from above, width, height, as shares of it.
  get parts() {
    const number = this.arms.length;
    const columns = Math.max(1, Math.min(number, Math.floor(this.canvas.clientWidth / NARROWEST_PX)));
    const rows = Math.ceil(number / columns);
    return this.arms.map((_, place) => [(place % columns) / columns, Math.floor(place / columns) / rows, 1 / columns, 1 / rows]);
  }

  fit() {
    const [, , width, height] = this.parts[0];
    const wide = this.canvas.clientWidth;
    this.canvas.style.height = `${Math.round(Math.min(wide * width * 0.8, 420) / height)}px`;
    const scale = Math.min(window.devicePixelRatio || 1, MOST_PIXELS_EACH_WAY);
    this.canvas.width = Math.max(1, Math.round(wide * scale));
    this.canvas.height = Math.max(1, Math.round(this.canvas.clientHeight * scale));
    this.draw();
  }

  colour(name, opacity) {
    const text = getComputedStyle(this.element).getPropertyValue(`--${name}`).trim();
    return [...[1, 3, 5].map((at) => parseInt(text.slice(at, at + 2), 16) / 255), opacity];
  }

  kind(arm) {
    return this.timeline.arms[arm.name]?.kind ?? "arm0";
  }

  draw() {
    const { painter, scene, canvas } = this;
    const gl = painter.gl;
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const places = this.parts;
    this.arms.forEach((arm, place) => {
      const [x, y, width, height] = places[place];
      const box = [x * canvas.width + (x > 0), (1 - y - height) * canvas.height, width * canvas.width - (x > 0), height * canvas.height - (y > 0)];
      gl.enable(gl.SCISSOR_TEST);
      gl.scissor(...box.map(Math.round));
      painter.begin(box.map(Math.round), { eye: this.eye, target: this.target });
      this.drawArm(arm);
      gl.disable(gl.SCISSOR_TEST);
    });
    this.labels.replaceChildren(...this.arms.map((arm, place) => this.label(arm, places[place])));
    canvas.dataset.step = this.step;
  }

  drawArm(arm) {
    const { painter, scene, step } = this;
    const gl = painter.gl;
    painter.bodies(arm, step);
    for (const one of this.overlaid ? scene.arms : [arm]) {
      const way = one.hand.slice(0, 3 * (Math.min(step, one.steps) + 1)).map((value) => value / 1000);
      painter.flat(gl.LINE_STRIP, way, this.colour(this.kind(one), 1));
      for (const event of one.events.filter((event) => event <= step)) painter.flat(gl.POINTS, way.slice(3 * event, 3 * event + 3), this.colour("event", 1), 10);
      const seen = one.cameras.filter(([from]) => from <= step);
      if (one.cameras.length > 1) seen.forEach(([, camera], place) => painter.pyramid(camera, this.colour(place === seen.length - 1 ? this.kind(one) : "event", 1)));
      const left = new Map(one.left.filter(([from]) => from <= step).map(([, body, pose]) => [body, pose]));
      if (left.size) painter.bodies(one, step, this.colour("event", 0.9), (body) => left.has(body), left);
      if (one !== arm) painter.bodies(one, step, this.colour(this.kind(one), 0.9), (body) => scene.row.has(body));
    }
  }

  label(arm, [x, y]) {
    const others = this.overlaid ? this.scene.arms.slice(0, -1) : [];
    const said = (one) => {
      const since = one.events.length && this.step >= one.events[0] ? `, ${Math.min(this.step, one.steps) - one.events[0]} after the event` : "";
      const ended = this.step >= one.steps ? `, ${one.success ? "success" : "failed"} after ${one.steps} steps` : since;
      return element("span", {}, element("i", { class: this.kind(one) }), `${one.name}${ended}`);
    };
    return element("div", { style: `left:${100 * x}%;top:${100 * y}%` }, ...[arm, ...others].map(said));
  }

  close() {
    this.watcher?.disconnect();
    this.painter?.close();
    this.painter = null;
  }
}
