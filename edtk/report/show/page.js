"use strict";
// The page of `edtk show`: kinematics, a small WebGL drawing, and the controls around it.
// Everything is in the page: nothing is loaded, and no text is run as a program.
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const $ = id => document.getElementById(id);
  const count = data.q.length;
  const TIP = -2, WORLD = -1;

  // ---- Vectors, and rigid motions [r00 r01 r02 x, r10 ...]: three rows of four numbers.
  const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
  const sub = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
  const times = (s, a) => [s * a[0], s * a[1], s * a[2]];
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const cross = (a, b) => [
    a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const length = a => Math.hypot(a[0], a[1], a[2]);
  const unit = a => times(1 / (length(a) || 1), a);
  const mix = (a, b, t) => a.map((x, i) => x + t * (b[i] - x));
  const IDENTITY = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0];

  function product(A, B) {
    const C = new Array(12);
    for (let i = 0; i < 3; i++) {
      for (let j = 0; j < 4; j++) {
        C[4 * i + j] = A[4 * i] * B[j] + A[4 * i + 1] * B[4 + j] + A[4 * i + 2] * B[8 + j]
          + (j === 3 ? A[4 * i + 3] : 0);
      }
    }
    return C;
  }
  const apply = (T, p) => [0, 4, 8].map(i => T[i] * p[0] + T[i + 1] * p[1] + T[i + 2] * p[2] + T[i + 3]);
  const rotate = (T, p) => [0, 4, 8].map(i => T[i] * p[0] + T[i + 1] * p[1] + T[i + 2] * p[2]);
  const originOf = T => [T[3], T[7], T[11]];
  const shifted = p => [1, 0, 0, p[0], 0, 1, 0, p[1], 0, 0, 1, p[2]];

  // Rodrigues' formula: a turn by an angle about a unit vector.
  function turn(a, angle) {
    const c = Math.cos(angle), s = Math.sin(angle), v = 1 - c;
    const [x, y, z] = a;
    return [
      c + x * x * v, x * y * v - z * s, x * z * v + y * s, 0,
      y * x * v + z * s, c + y * y * v, y * z * v - x * s, 0,
      z * x * v - y * s, z * y * v + x * s, c + z * z * v, 0];
  }

  // A frame whose third axis is along a vector, scaled: the unit solids stand along z.
  function along(start, end, wide) {
    const d = sub(end, start), z = unit(d);
    const aside = Math.abs(z[0]) < 0.8 ? [1, 0, 0] : [0, 1, 0];
    const x = times(wide, unit(cross(aside, z))), y = times(wide, unit(cross(z, x)));
    return [x[0], y[0], d[0], start[0], x[1], y[1], d[1], start[1], x[2], y[2], d[2], start[2]];
  }

  // ---- Kinematics: x = P q + b are all joints of the chain, T_j = base prod (O_i exp(a_i x_i)).
  function place(q) {
    const x = data.ties.map((row, j) => row.reduce((sum, p, i) => sum + p * q[i], data.offset[j]));
    const bodies = [], axes = [], origins = [];
    let T = data.base;
    data.chain.forEach((joint, j) => {
      T = product(T, joint.origin);
      axes.push(rotate(T, joint.axis));
      origins.push(originOf(T));
      T = product(T, joint.slides ? shifted(times(x[j], joint.axis)) : turn(joint.axis, x[j]));
      bodies.push(T);
    });
    return { bodies, axes, origins, tip: product(T, data.tool) };
  }

  // Loads turn the joints by small angles t_j, so that a point p of body c moves by
  // sum_{j <= c} t_j a_j x (p - o_j), which is linear in p: a matrix does it, times 100.
  function bent(frames, turns, factor) {
    let W = [0, 0, 0], v = [0, 0, 0];
    const moved = frames.bodies.map((T, j) => {
      const a = times(factor * turns[j], frames.axes[j]);
      if (data.chain[j].slides) {
        v = add(v, a);
      } else {
        W = add(W, a);
        v = sub(v, cross(a, frames.origins[j]));
      }
      return product([1, -W[2], W[1], v[0], W[2], 1, -W[0], v[1], -W[1], W[0], 1, v[2]], T);
    });
    const last = data.chain.length - 1;
    return { ...frames, bodies: moved, tip: product(moved[last], data.tool) };
  }
  const carrier = (frames, on) =>
    on === WORLD ? IDENTITY : on === TIP ? frames.tip : frames.bodies[on];

  // What hangs keeps the axes of the world.
  const frameOf = (part, frames) => part.hangs
    ? shifted(apply(carrier(frames, part.on), part.hangs)) : carrier(frames, part.on);

  // ---- Solids: triangles with normals, in the frame of their carrier.
  function solid() {
    const points = [], normals = [];
    const triangle = (p, n) => { p.forEach(x => points.push(...x)); n.forEach(x => normals.push(...x)); };
    const quad = (a, b, c, d, na, nb, nc, nd) => {
      triangle([a, b, c], [na, nb, nc]);
      triangle([a, c, d], [na, nc, nd]);
    };
    return { points, normals, triangle, quad };
  }
  const SIDES = 24, RINGS = 5;
  const onCircle = i => [Math.cos(2 * Math.PI * i / SIDES), Math.sin(2 * Math.PI * i / SIDES)];

  // A surface of revolution: [radius, height, slope of the normal] from one end to the other.
  function revolved(out, T, profile) {
    const at = (k, i) => {
      const [c, s] = onCircle(i), [r, z, , ] = profile[k];
      return apply(T, [r * c, r * s, z]);
    };
    const facing = (k, i) => {
      const [c, s] = onCircle(i), [, , nr, nz] = profile[k];
      return unit(rotate(T, [nr * c, nr * s, nz]));
    };
    for (let k = 0; k + 1 < profile.length; k += 1) {
      for (let i = 0; i < SIDES; i++) {
        out.quad(at(k, i), at(k, i + 1), at(k + 1, i + 1), at(k + 1, i),
          facing(k, i), facing(k, i + 1), facing(k + 1, i + 1), facing(k + 1, i));
      }
    }
  }
  function capsule(out, start, end, r) {
    const d = length(sub(end, start));
    const F = along(start, d > 1e-12 ? end : add(start, [0, 0, 1]), 1);
    const T = F.map((x, i) => (i % 4 === 2 && d > 1e-12 ? x / d : x));
    const profile = [];
    for (let k = -RINGS; k <= 0; k++) {
      const a = Math.PI / 2 * k / RINGS;
      profile.push([r * Math.cos(a), r * Math.sin(a), Math.cos(a), Math.sin(a)]);
    }
    for (let k = 0; k <= RINGS; k++) {
      const a = Math.PI / 2 * k / RINGS;
      profile.push([r * Math.cos(a), d + r * Math.sin(a), Math.cos(a), Math.sin(a)]);
    }
    revolved(out, T, profile);
  }
  function cylinder(out, T, r, h) {
    revolved(out, T, [[0, -h, 0, -1], [r, -h, 0, -1]]);
    revolved(out, T, [[r, -h, 1, 0], [r, h, 1, 0]]);
    revolved(out, T, [[r, h, 0, 1], [0, h, 0, 1]]);
  }
  function box(out, T, half) {
    for (let axis = 0; axis < 3; axis++) {
      for (const side of [-1, 1]) {
        const [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
        const corner = (a, b) => {
          const p = [0, 0, 0];
          p[axis] = side * half[axis]; p[u] = a * half[u]; p[v] = b * half[v];
          return apply(T, p);
        };
        const n = [0, 0, 0];
        n[axis] = side;
        const normal = unit(rotate(T, n));
        out.quad(corner(-side, -1), corner(side, -1), corner(side, 1), corner(-side, 1),
          normal, normal, normal, normal);
      }
    }
  }
  function mesh(out, vertices, faces) {
    for (let f = 0; f < faces.length; f += 3) {
      const p = [0, 1, 2].map(k => vertices.slice(3 * faces[f + k], 3 * faces[f + k] + 3));
      const n = unit(cross(sub(p[1], p[0]), sub(p[2], p[0])));
      out.triangle(p, [n, n, n]);
    }
  }
  function plane(out, normal, offset) {
    const wide = 2 * data.size;
    const T = along(times(offset, normal), times(offset + 1, normal), 1);
    const corner = (a, b) => apply(T, [a * wide, b * wide, 0]);
    out.quad(corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1),
      normal, normal, normal, normal);
  }
  function built(shapes) {
    const out = solid();
    for (const one of shapes) {
      if (one.capsule) capsule(out, ...one.capsule);
      if (one.cylinder) cylinder(out, ...one.cylinder);
      if (one.box) box(out, ...one.box);
      if (one.plane) plane(out, ...one.plane);
      if (one.mesh) mesh(out, ...one.mesh);
    }
    return out;
  }

  // ---- Drawing.
  const canvas = $("view");
  const gl = canvas.getContext("webgl", { antialias: true, preserveDrawingBuffer: true });
  const VERTEX = `
    attribute vec3 point, normal; uniform mat4 model, camera; varying vec3 n, p;
    void main() {
      vec4 at = model * vec4(point, 1.0);
      p = at.xyz; n = mat3(model) * normal; gl_Position = camera * at;
    }`;
  const FRAGMENT = `
    precision mediump float; varying vec3 n, p;
    uniform vec4 colour; uniform vec3 eye; uniform float lit;
    void main() {
      vec3 to = normalize(eye - p), m = normalize(n);
      if (dot(m, to) < 0.0) m = -m;
      vec3 lamp = normalize(to + vec3(0.25, -0.1, 0.75));
      float bright = 0.42 + 0.18 * m.z + 0.46 * max(dot(m, lamp), 0.0);
      float shine = 0.14 * pow(max(dot(m, lamp), 0.0), 24.0);
      vec3 shaded = mix(colour.rgb, min(colour.rgb * bright * 1.12 + shine, 1.0), lit);
      gl_FragColor = vec4(shaded * colour.a, colour.a);
    }`;
  const where = {};
  let parts = [], solids = {};

  function compiled(kind, text) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    return shader;
  }
  function buffered(shape) {
    const store = array => {
      const buffer = gl.createBuffer();
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(array), gl.STATIC_DRAW);
      return buffer;
    };
    return { points: store(shape.points), normals: store(shape.normals), count: shape.points.length / 3 };
  }
  function grid() {
    const out = solid();
    const wide = Math.ceil(1.6 * data.size / data.grid);
    const [cx, cy] = [0, 1].map(i => Math.round(data.middle[i] / data.grid));
    for (let k = -wide; k <= wide; k++) {
      for (const line of [[[k, -wide], [k, wide]], [[-wide, k], [wide, k]]]) {
        for (const [x, y] of line) {
          out.points.push(data.grid * (cx + x), data.grid * (cy + y), data.floor);
          out.normals.push(0, 0, 1);
        }
      }
    }
    return out;
  }
  function prepare() {
    const program = gl.createProgram();
    gl.attachShader(program, compiled(gl.VERTEX_SHADER, VERTEX));
    gl.attachShader(program, compiled(gl.FRAGMENT_SHADER, FRAGMENT));
    gl.linkProgram(program);
    gl.useProgram(program);
    for (const name of ["model", "camera", "colour", "eye", "lit"]) {
      where[name] = gl.getUniformLocation(program, name);
    }
    for (const name of ["point", "normal"]) {
      where[name] = gl.getAttribLocation(program, name);
      gl.enableVertexAttribArray(where[name]);
    }
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    parts = data.parts.map(part => ({ ...part, drawn: buffered(built(part.shapes)) }));
    const rod = solid(), ball = solid(), cone = solid();
    revolved(rod, IDENTITY, [[1, 0, 1, 0], [1, 1, 1, 0]]);
    capsule(ball, [0, 0, 0], [0, 0, 0], 1);
    revolved(cone, IDENTITY, [[1, 0, 0.7, 0.7], [0, 1, 0.7, 0.7]]);
    revolved(cone, IDENTITY, [[0, 0, 0, -1], [1, 0, 0, -1]]);
    solids = { rod: buffered(rod), ball: buffered(ball), cone: buffered(cone), grid: buffered(grid()) };
  }

  const matrix = T => new Float32Array([
    T[0], T[4], T[8], 0, T[1], T[5], T[9], 0, T[2], T[6], T[10], 0, T[3], T[7], T[11], 1]);
  function draw(shape, T, colour, lit = 1, mode = gl.TRIANGLES) {
    for (const name of ["point", "normal"]) {
      gl.bindBuffer(gl.ARRAY_BUFFER, shape[`${name}s`]);
      gl.vertexAttribPointer(where[name], 3, gl.FLOAT, false, 0, 0);
    }
    gl.uniformMatrix4fv(where.model, false, matrix(T));
    gl.uniform4fv(where.colour, colour);
    gl.uniform1f(where.lit, lit);
    gl.drawArrays(mode, 0, shape.count);
  }
  const rod = (a, b, r, colour, lit = 1) => draw(solids.rod, along(a, b, r), colour, lit);
  const ball = (p, r, colour) =>
    draw(solids.ball, [r, 0, 0, p[0], 0, r, 0, p[1], 0, 0, r, p[2]], colour);
  function arrow(from, to, r, colour) {
    const neck = add(to, times(-5 * r, unit(sub(to, from))));
    rod(from, neck, r, colour);
    draw(solids.cone, along(neck, to, 2.4 * r), colour);
  }

  // Colours are those of the style sheet, which knows whether the page is dark.
  let palette = {};
  function readPalette() {
    const style = getComputedStyle(document.documentElement);
    palette = {};
    for (const name of ["arm", "joint", "tool", "load", "around", "mark", "beam", "grid", "ink"]) {
      const hex = style.getPropertyValue(`--${name}`).trim().slice(1);
      const part = i => parseInt(hex.slice(i, i + 2), 16) / 255;
      palette[name] = [part(0), part(2), part(4), hex.length > 6 ? part(6) : 1];
    }
  }
  const faded = (colour, alpha) => [colour[0], colour[1], colour[2], alpha];
  const RAMP = ["2f6fb0", "7aa0c4", "b9b9b5", "dca263", "d5731d"].map(
    hex => [0, 2, 4].map(i => parseInt(hex.slice(i, i + 2), 16) / 255));
  function ramp(t) {
    const at = Math.min(Math.max(t, 0), 1) * (RAMP.length - 1), k = Math.min(Math.floor(at), RAMP.length - 2);
    return [...mix(RAMP[k], RAMP[k + 1], at - k), 1];
  }

  // ---- What is shown now.
  const state = {
    at: 0, ghosts: false, bent: false, beams: true, names: true, shade: data.shades.length ? 0 : -1,
    playing: false, azimuth: -0.95, elevation: 0.32, distance: 1, target: data.middle,
  };
  const ENLARGED = 100;
  const VIEWS = { corner: [-0.95, 0.32], front: [0, 0.02], side: [-Math.PI / 2, 0.02], top: [-Math.PI / 2, 1.5] };
  function look(view) {
    const everything = view === "all";
    if (!everything) [state.azimuth, state.elevation] = VIEWS[view];
    state.target = everything ? data.middle_of_all : data.middle;
    const wide = Math.min(1, canvas.clientWidth / (canvas.clientHeight || 1));
    state.distance = (everything ? data.size_of_all : data.size) / Math.sin(FOV / 2) / Math.max(wide, 0.3);
    redraw();
  }
  const FOV = 0.6;
  function camera() {
    const { azimuth: a, elevation: e, distance: d, target } = state;
    const out = [Math.cos(e) * Math.cos(a), Math.cos(e) * Math.sin(a), Math.sin(e)];
    const right = [-Math.sin(a), Math.cos(a), 0], up = cross(out, right);
    const eye = add(target, times(d, out));
    const f = 1 / Math.tan(FOV / 2), near = d / 50, far = 20 * d;
    const aspect = canvas.clientWidth / Math.max(canvas.clientHeight, 1);
    const row = (v, s) => [s * v[0], s * v[1], s * v[2], -s * dot(v, eye)];
    const X = row(right, f / aspect), Y = row(up, f), W = row(out, -1);
    const Z = W.map((w, i) => w * (far + near) / (far - near) - (i === 3 ? 2 * far * near / (far - near) : 0));
    return { rows: [X, Y, Z, W], eye, right, up };
  }
  function project(view, p) {
    const [x, y, , w] = view.rows.map(r => r[0] * p[0] + r[1] * p[1] + r[2] * p[2] + r[3]);
    return w <= 0 ? null : [(x / w + 1) / 2 * canvas.clientWidth, (1 - y / w) / 2 * canvas.clientHeight];
  }

  // Between two poses all joints move in step, as a controller's joint move does.
  // Where it goes by via poses, it is as long on each leg as its joints need.
  const wayAfter = k => [data.q[k], ...(data.ways[k] || []), data.q[k + 1]];
  const travel = (a, b) => Math.max(...a.map((x, j) => Math.abs(b[j] - x)));
  const travelOf = way => way.slice(1).map((q, i) => travel(way[i], q));
  function jointsAt(at) {
    const k = Math.min(Math.floor(at), count - 1), t = at - k;
    if (t <= 0 || k + 1 >= count) return data.q[k];
    const way = wayAfter(k), legs = travelOf(way);
    let left = t * legs.reduce((sum, leg) => sum + leg, 0), i = 0;
    while (i < legs.length - 1 && left > legs[i]) left -= legs[i++];
    return mix(way[i], way[i + 1], legs[i] > 0 ? left / legs[i] : 0);
  }
  const pose = () => Math.round(state.at);
  const isMoving = () => Math.abs(state.at - pose()) > 1e-9;
  const shade = () => data.shades[state.shade];
  function shadeOf(i) {
    const { values, low, high } = shade();
    if (values[i] === null) return [...palette.arm];
    if (shade().alarm !== null && values[i] < shade().alarm) return palette.beam;
    return ramp(high > low ? (values[i] - low) / (high - low) : 0.5);
  }

  // A ghost is drawn where it differs from the arm itself.
  function drawArm(frames, colours, but = null) {
    for (const part of parts) {
      if (part.on === WORLD) continue;
      const T = frameOf(part, frames), other = but && frameOf(part, but);
      if (other && T.every((x, i) => Math.abs(x - other[i]) < 1e-3)) continue;
      draw(part.drawn, T, colours[part.kind]);
    }
  }
  const drawBase = () => parts.filter(part => part.on === WORLD && part.kind !== "around").forEach(
    part => draw(part.drawn, IDENTITY, palette.arm));
  // What stands around is of glass, too; a floor or wall hardly shows.
  const FLAT = 0.13, SOLID = 0.72;
  function drawAround() {
    for (const shown of [false, true]) {
      gl.colorMask(shown, shown, shown, shown);
      for (const part of parts) {
        if (part.kind !== "around") continue;
        const flat = part.shapes.every(shape => shape.plane);
        if (shown || !flat) draw(part.drawn, IDENTITY, faded(palette.around, flat ? FLAT : SOLID));
      }
    }
  }
  function coloursOf(i, alpha = 1) {
    const arm = state.shade >= 0 ? shadeOf(i) : palette.arm;
    const accent = state.shade >= 0 ? palette.arm : palette.joint;
    const chosen = { link: arm, joint: accent, tool: palette.tool, load: palette.load };
    return Object.fromEntries(Object.entries(chosen).map(([kind, c]) => [kind, faded(c, alpha)]));
  }
  // First its depth alone, then its colour once: an arm of glass without its inside.
  function drawGhost(frames, colours, but) {
    gl.colorMask(false, false, false, false);
    drawArm(frames, colours, but);
    gl.colorMask(true, true, true, true);
    drawArm(frames, colours, but);
  }
  const MOST_GHOSTS = 60;
  function ghosts(view) {
    const step = Math.max(1, Math.ceil(count / MOST_GHOSTS));
    const found = [];
    for (let i = 0; i < count; i += step) {
      if (i !== pose() || isMoving()) found.push({ i, frames: place(data.q[i]) });
    }
    const far = one => length(sub(originOf(one.frames.tip), view.eye));
    return found.sort((a, b) => far(b) - far(a));
  }

  // Why a marker is not read in this pose; nothing where it is.
  const why = i => (data.hidden.length ? data.hidden[pose()][i] : "");
  function wiresAndLoads(frames, thin) {
    data.marks.forEach((mark, i) => {
      const T = carrier(frames, mark.on), p = apply(T, mark.at), read = !why(i);
      ball(p, 3.2 * thin, read ? palette.mark : palette.around);
      if (mark.normal) rod(p, add(p, times(22 * thin, rotate(T, mark.normal))), 0.8 * thin, palette.mark);
      const colour = read ? palette.beam : faded(palette.around, 0.5);
      for (const from of mark.anchor ? [mark.anchor] : data.eyes.map(eye => eye.at)) {
        rod(from, p, 0.45 * thin, colour, 0);
      }
      if (mark.anchor) ball(mark.anchor, 3.2 * thin, palette.beam);
    });
    for (const { at } of data.eyes) {
      rod([at[0], at[1], Math.min(data.floor, at[2])], at, 1.6 * thin, palette.ink);
      ball(at, 5 * thin, palette.ink);
    }
    const force = data.forces[pose()], size = length(force);
    if (size > 0) {
      const p = apply(carrier(frames, data.load.on), add(data.load.at, data.levers[pose()]));
      const long = 0.32 * data.size * (0.35 + 0.65 * size / data.largest);
      arrow(p, add(p, times(long / size, force)), 1.4 * thin, palette.load);
    }
  }
  // The axes of the world, which shine through the arm.
  const AXES = [[0.75, 0.22, 0.17], [0.15, 0.57, 0.31], [0.23, 0.44, 0.82]];
  const LONG_AXIS = 0.42;
  function axes(thin) {
    const o = [data.base[3], data.base[7], data.floor];
    for (const alpha of [1, 0.3]) {
      if (alpha < 1) gl.disable(gl.DEPTH_TEST);
      AXES.forEach((colour, i) => {
        const e = [0, 0, 0];
        e[i] = LONG_AXIS * data.size;
        arrow(o, add(o, e), 0.9 * thin, [...colour, alpha]);
      });
    }
    gl.enable(gl.DEPTH_TEST);
  }

  function paint() {
    const view = camera();
    const scale = Math.min(window.devicePixelRatio || 1, 2);
    const [w, h] = [canvas.clientWidth, canvas.clientHeight].map(x => Math.max(1, Math.round(scale * x)));
    if (canvas.width !== w || canvas.height !== h) [canvas.width, canvas.height] = [w, h];
    gl.viewport(0, 0, w, h);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.uniformMatrix4fv(where.camera, false, new Float32Array(
      [0, 1, 2, 3].flatMap(c => view.rows.map(row => row[c]))));
    gl.uniform3fv(where.eye, view.eye);
    const thin = 0.0042 * data.size;
    draw(solids.grid, IDENTITY, palette.grid, 0, gl.LINES);
    const frames = place(jointsAt(state.at));
    const turns = state.bent && data.turns && !isMoving() ? data.turns[pose()] : null;
    const shown = turns ? bent(frames, turns, ENLARGED) : frames;
    drawArm(shown, coloursOf(pose()));
    drawBase();
    axes(thin);
    if (state.beams) wiresAndLoads(shown, thin);
    if (turns) drawGhost(frames, coloursOf(pose(), 0.3), shown);
    if (state.ghosts) {
      for (const one of ghosts(view)) drawGhost(one.frames, coloursOf(one.i, 0.3), shown);
    }
    drawAround();
    label(view, shown);
  }

  // Joints whose axes meet in a point, as in a wrist, share a name.
  function namedJoints(frames) {
    const found = [];
    data.chain.forEach((joint, j) => {
      const near = found.find(([, at]) => length(sub(at, frames.origins[j])) < 0.02 * data.size);
      if (near) near[0].push(joint.name);
      else found.push([[joint.name], frames.origins[j]]);
    });
    return found;
  }

  // ---- Names in the picture: those that would cover another one are left out.
  const layer = $("labels");
  function label(view, frames) {
    const found = [];
    const put = (text, p, kind = "") => {
      const at = project(view, p);
      if (at) found.push({ text, at, kind });
    };
    if (state.names) {
      const o = [data.base[3], data.base[7], data.floor];
      ["x", "y", "z"].forEach((name, i) => {
        const e = [0, 0, 0];
        e[i] = 1.06 * LONG_AXIS * data.size;
        put(name, add(o, e), name);
      });
      if (state.beams) {
        for (const eye of data.eyes) put(eye.name, eye.at);
        data.marks.forEach((mark, i) => put(
          why(i) ? `${mark.name} (not read)` : mark.name, apply(carrier(frames, mark.on), mark.at)));
        const size = length(data.forces[pose()]);
        if (size > 0) {
          const p = apply(carrier(frames, data.load.on), add(data.load.at, data.levers[pose()]));
          const long = 0.16 * data.size * (0.35 + 0.65 * size / data.largest);
          put(`${Math.round(size)} N`, add(p, times(long / size, data.forces[pose()])));
        }
      }
      for (const [names, at] of namedJoints(frames)) put(names.join(" "), at);
      for (const part of data.parts) {
        if (part.kind === "around" && part.middle) put(part.name, part.middle);
      }
    }
    const taken = [], kept = [];
    for (const one of found) {
      const [x, y] = [one.at[0] + 8, one.at[1] - 16], wide = 7.2 * one.text.length + 4;
      const clear = taken.every(([a, b, c]) => x > a + c || x + wide < a || Math.abs(y - b) > 15);
      if (!clear || x + wide > canvas.clientWidth || x < 0 || y < 0) continue;
      taken.push([x, y, wide]);
      kept.push([one, x, y]);
    }
    while (layer.children.length < kept.length) layer.append(document.createElement("span"));
    [...layer.children].forEach((span, i) => {
      span.hidden = i >= kept.length;
      if (span.hidden) return;
      const [one, x, y] = kept[i];
      span.textContent = one.text;
      span.className = one.kind;
      span.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px)`;
    });
  }

  // ---- Words beside the picture.
  const digits = (x, n = 3) => (x === null ? "-" : Number(x.toPrecision(n)).toString());
  function facts(i) {
    const rows = [["pose", `${data.names[i]} of ${count}`]];
    if (data.repeats[i] > 1) rows.push(["measured", `${data.repeats[i]} times`]);
    data.joints.forEach((name, j) => rows.push([name, data.shown[i][j]]));
    const tip = originOf(place(data.q[i]).tip);
    rows.push(["tool point", `${tip.map(x => (1000 * x).toFixed(1)).join(", ")} mm`]);
    if (data.loads[i]) rows.push(["load", data.loads[i]]);
    if (data.hidden.length) {
      const hidden = data.hidden[i].map((words, m) => (words ? `${data.marks[m].name} ${words}` : ""));
      rows.push(["not read", hidden.filter(Boolean).join("; ") || "none"]);
    }
    if (data.turns) {
      const frames = place(data.q[i]), moved = bent(frames, data.turns[i], 1);
      const by = length(sub(originOf(moved.tip), originOf(frames.tip)));
      rows.push(["bent by the load", `${(1000 * by).toPrecision(3)} mm`]);
    }
    for (const one of data.shades) {
      const beside = one.beside[i] ? `, ${one.beside[i]}` : "";
      rows.push([one.name, `${digits(one.values[i])}${beside}`]);
    }
    return rows;
  }
  function tell() {
    const i = pose();
    $("pose").value = i + 1;
    $("pose").setAttribute("aria-valuetext", `pose ${data.names[i]} of ${count}`);
    $("name").textContent = isMoving() ? "moving" : `pose ${data.names[i]}`;
    $("facts").replaceChildren(...facts(i).flatMap(([name, text]) => {
      const [dt, dd] = [document.createElement("dt"), document.createElement("dd")];
      dt.textContent = name;
      dd.textContent = text;
      return [dt, dd];
    }));
    if (!state.playing) {
      const words = facts(i).map(([name, text]) => `${name} ${text}`).join(", ");
      $("spoken").textContent = words;
      canvas.setAttribute("aria-label", `${data.title}: ${words}`);
    }
    for (const row of document.querySelectorAll("#table tbody tr")) {
      row.setAttribute("aria-current", String(row.rowIndex === i + 1));
    }
    bars();
  }
  function bars() {
    const strip = $("bars");
    strip.hidden = state.shade < 0;
    if (strip.hidden) return;
    const scale = Math.min(window.devicePixelRatio || 1, 2);
    [strip.width, strip.height] = [scale * strip.clientWidth, scale * strip.clientHeight];
    const pen = strip.getContext("2d"), wide = strip.width / count, gap = Math.min(2 * scale, wide / 4);
    const { values, low, high } = shade(), zero = Math.min(low, 0);
    for (let i = 0; i < count; i++) {
      if (values[i] === null) continue;
      const part = high > zero ? (values[i] - zero) / (high - zero) : 1;
      const tall = Math.max(2 * scale, (strip.height - 6 * scale) * part);
      pen.fillStyle = `rgb(${shadeOf(i).slice(0, 3).map(x => Math.round(255 * x)).join(" ")})`;
      pen.fillRect(i * wide + gap / 2, strip.height - 4 * scale - tall, wide - gap, tall);
      if (i !== pose()) continue;
      pen.fillStyle = getComputedStyle(document.body).color;
      pen.fillRect(i * wide + gap / 2, strip.height - 3 * scale, wide - gap, 3 * scale);
    }
    strip.setAttribute("aria-label", `${shade().name}: a bar a pose, from ${digits(low)} to ${digits(high)}`);
  }
  function legend() {
    $("legend").hidden = state.shade < 0;
    $("meaning").textContent = [
      state.shade < 0 ? "" : shade().words,
      state.bent ? data.springs : "",
    ].filter(Boolean).join(" ");
    if (state.shade < 0) return;
    $("low").textContent = digits(shade().low);
    $("high").textContent = digits(shade().high);
  }

  // ---- Time.
  let asked = false;
  function redraw() {
    if (asked || !gl) return;
    asked = true;
    requestAnimationFrame(() => { asked = false; paint(); });
  }
  function goTo(i) {
    state.at = Math.min(Math.max(i, 0), count - 1);
    tell();
    redraw();
  }
  const SPEED = 1.0, PAUSE = 0.5; // rad/s of the joint that turns most; s in each pose
  let waited = 0, last = 0;
  const calm = matchMedia("(prefers-reduced-motion: reduce)");
  function step(now) {
    if (!state.playing) return;
    const passed = Math.min((now - last) / 1000, 0.1);
    last = now;
    if (!isMoving() && waited < (calm.matches ? 1.5 : PAUSE)) {
      waited += passed;
    } else if (pose() >= count - 1 && !isMoving()) {
      return play(false);
    } else {
      const k = Math.floor(state.at + 1e-9);
      const whole = travelOf(wayAfter(k)).reduce((sum, leg) => sum + leg, 0);
      const share = passed / Math.min(Math.max(whole / SPEED, 0.5), 8);
      const next = calm.matches ? k + 1 : Math.min(state.at + share, k + 1);
      state.at = next > k + 1 - 1e-6 ? k + 1 : next;
      if (!isMoving()) waited = 0;
      tell();
      paint();
    }
    requestAnimationFrame(step);
  }
  function play(on) {
    if (on === state.playing || (on && count < 2)) return;
    state.playing = on;
    $("play").textContent = on ? "stop" : "play";
    $("play").setAttribute("aria-pressed", String(on));
    if (!on) return goTo(pose());
    if (pose() >= count - 1) state.at = 0;
    waited = 0;
    last = performance.now();
    requestAnimationFrame(step);
  }

  // ---- Controls.
  const stepBy = by => { play(false); goTo(pose() + by); };
  function choose(name, value) {
    state[name] = value;
    $(name).checked = value;
    legend();
    redraw();
  }
  function chooseShade(i) {
    state.shade = i;
    $("shade").value = String(i);
    legend();
    tell();
    redraw();
  }
  function zoom(factor) {
    state.distance = Math.min(Math.max(state.distance * factor, 0.3 * data.size), 40 * data.size);
    redraw();
  }
  function orbit(dx, dy) {
    state.azimuth -= 0.007 * dx;
    state.elevation = Math.min(Math.max(state.elevation + 0.007 * dy, -1.5), 1.5);
    redraw();
  }
  function pan(dx, dy) {
    const { right, up } = camera(), s = 2 * state.distance * Math.tan(FOV / 2) / canvas.clientHeight;
    state.target = add(state.target, add(times(-s * dx, right), times(s * dy, up)));
    redraw();
  }
  const KEYS = {
    ArrowLeft: () => stepBy(-1), ArrowRight: () => stepBy(1),
    Home: () => { play(false); goTo(0); }, End: () => { play(false); goTo(count - 1); },
    p: () => play(!state.playing), g: () => choose("ghosts", !state.ghosts),
    d: () => data.turns && choose("bent", !state.bent),
    b: () => choose("beams", !state.beams), n: () => choose("names", !state.names),
    c: () => chooseShade(state.shade + 1 < data.shades.length ? state.shade + 1 : -1),
    "+": () => zoom(0.85), "=": () => zoom(0.85), "-": () => zoom(1 / 0.85),
    1: () => look("corner"), 2: () => look("front"), 3: () => look("side"), 4: () => look("top"),
    5: () => look("all"),
  };
  const ORBITS = { ArrowLeft: [-25, 0], ArrowRight: [25, 0], ArrowUp: [0, -25], ArrowDown: [0, 25] };
  document.addEventListener("keydown", event => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const tag = event.target.tagName;
    const own = tag === "SELECT" || (tag === "INPUT" && event.target.type === "range");
    if (own && /^(Arrow|Home|End)/.test(event.key) && !event.shiftKey) return;
    if (event.shiftKey && ORBITS[event.key]) {
      orbit(...ORBITS[event.key]);
    } else if (KEYS[event.key]) {
      KEYS[event.key]();
    } else {
      return;
    }
    event.preventDefault();
  });
  $("pose").addEventListener("input", event => { play(false); goTo(Number(event.target.value) - 1); });
  $("before").addEventListener("click", () => stepBy(-1));
  $("next").addEventListener("click", () => stepBy(1));
  $("play").addEventListener("click", () => play(!state.playing));
  for (const name of ["ghosts", "bent", "beams", "names"]) {
    $(name).addEventListener("change", event => choose(name, event.target.checked));
  }
  $("shade").addEventListener("change", event => chooseShade(Number(event.target.value)));
  $("bars").addEventListener("click", event => {
    play(false);
    goTo(Math.floor(event.offsetX / $("bars").clientWidth * count));
  });
  for (const button of document.querySelectorAll("[data-view]")) {
    button.addEventListener("click", () => look(button.dataset.view));
  }
  document.querySelectorAll("#table tbody tr").forEach((row, i) => {
    const cell = row.cells[0], button = document.createElement("button");
    button.type = "button";
    button.textContent = cell.textContent;
    button.setAttribute("aria-label", `show pose ${cell.textContent}`);
    button.addEventListener("click", () => { play(false); goTo(i); });
    cell.replaceChildren(button);
  });

  // One finger or the mouse turns, two fingers or shift move and zoom.
  const fingers = new Map();
  canvas.addEventListener("pointerdown", event => {
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
  });
  canvas.addEventListener("pointermove", event => {
    const before = fingers.get(event.pointerId);
    if (!before) return;
    const now = [event.clientX, event.clientY], moved = [now[0] - before[0], now[1] - before[1]];
    if (fingers.size === 2) {
      const other = [...fingers.entries()].find(([id]) => id !== event.pointerId)[1];
      const apart = p => Math.hypot(p[0] - other[0], p[1] - other[1]) || 1;
      zoom(apart(before) / apart(now));
      pan(moved[0] / 2, moved[1] / 2);
    } else if (event.shiftKey || event.buttons === 2) {
      pan(...moved);
    } else {
      orbit(...moved);
    }
    fingers.set(event.pointerId, now);
  });
  for (const name of ["pointerup", "pointercancel"]) {
    canvas.addEventListener(name, event => fingers.delete(event.pointerId));
  }
  canvas.addEventListener("contextmenu", event => event.preventDefault());
  canvas.addEventListener("wheel", event => {
    event.preventDefault();
    zoom(Math.exp(0.0015 * event.deltaY));
  }, { passive: false });

  // ---- Begin.
  for (const [i, one] of [...data.shades.entries(), [-1, { name: "nothing" }]]) {
    const option = document.createElement("option");
    option.value = String(i);
    option.textContent = one.name;
    $("shade").append(option);
  }
  $("shade-label").hidden = !data.shades.length;
  $("shade").value = String(state.shade);
  $("all").hidden = data.size_of_all <= 1.02 * data.size;
  if (!data.turns) {
    $("bent").disabled = true;
    $("bent-label").classList.add("off");
    $("bent-label").title = data.springs;
  }
  $("scale").textContent = `grid ${Math.round(1000 * data.grid)} mm`;
  // A script of a test, or a person at the console, asks where the page has put the arm.
  window.edtkShow = {
    state, place: i => place(data.q[i]), goTo,
    bent: i => bent(place(data.q[i]), data.turns[i], ENLARGED),
  };
  if (gl) {
    prepare();
    readPalette();
    new ResizeObserver(() => { redraw(); bars(); }).observe(canvas);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
      readPalette();
      bars();
      redraw();
    });
    canvas.addEventListener("webglcontextlost", event => event.preventDefault());
    canvas.addEventListener("webglcontextrestored", () => { prepare(); redraw(); });
  } else {
    $("notice").hidden = false;
    $("notice").textContent = "This browser draws no 3D here (WebGL is off). The table has all poses.";
    $("table").open = true;
  }
  legend();
  goTo(0);
  look("corner");
})();
