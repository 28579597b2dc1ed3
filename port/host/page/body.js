// SPDX-License-Identifier: MIT
// Bodies, tools and forces in three dimensions: class BodyView, on WebGL2. Lengths are metres; z is up.
'use strict';

// From calm to strong: lightness falls all the way, so it reads without colour vision and in print.
const COLD = [[0.93, 0.87, 0.76], [0.93, 0.70, 0.42], [0.80, 0.42, 0.23], [0.52, 0.17, 0.24], [0.22, 0.06, 0.20]];

function heat(share) {
    const at = Math.max(0, Math.min(share, 1)) * (COLD.length - 1), i = Math.min(Math.floor(at), COLD.length - 2), f = at - i;
    return COLD[i].map((c, k) => c + f * (COLD[i + 1][k] - c));
}

// Meshes of a dynamic body, coarse to fine.
const LEVELS = ['#466ebe', '#50aa5a', '#d8b23a', '#d86a38', '#a03050'];

function heatCss() { return 'linear-gradient(90deg,' + COLD.map(c => 'rgb(' + c.map(v => Math.round(255 * v)).join()+ ')').join() + ')'; }

const sub = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const scaled = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
const plus = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
const unit = a => scaled(a, 1 / (Math.hypot(...a) || 1));

const VERTEX = `#version 300 es
uniform mat4 view; uniform vec3 eye;
in vec3 place; in vec3 normal; in vec3 colour;
out vec3 n; out vec3 c; out vec3 to;
void main() { n = normal; c = colour; to = eye - place; gl_Position = view * vec4(place, 1.0); }`;
const FRAGMENT = `#version 300 es
precision highp float;
uniform vec3 lamp; uniform float alpha; uniform float flatness;
in vec3 n; in vec3 c; in vec3 to; out vec4 pixel;
void main() {
    vec3 m = normalize(n), e = normalize(to);
    float light = 0.45 + 0.5 * max(dot(m, lamp), 0.0) + 0.12 * abs(dot(m, e));
    float shine = 0.12 * pow(max(dot(m, normalize(lamp + e)), 0.0), 24.0);
    pixel = vec4(mix(c * light + shine, c, flatness), alpha);
}`;

class BodyView {
    // Throws where the browser has no WebGL2.
    constructor(canvas) {
        this.canvas = canvas;
        this.gl = canvas.getContext('webgl2', {antialias: true, preserveDrawingBuffer: true});
        if (!this.gl) throw new Error('this browser does not offer WebGL2');
        this.program = this.link();
        this.parts = [];
        this.tools = [];
        this.mode = 'moved';
        this.show = {points: true, force: true, rest: false, edges: false};
        this.yaw = -0.9;
        this.pitch = 0.35;
        this.distance = 1;
        this.centre = [0, 0, 0];
        this.most = 0;
        this.toolMesh = null;
        this.points = new Float32Array(0);
        this.force = null;
        new ResizeObserver(() => this.draw()).observe(canvas);
        matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => this.draw());
    }

    link() {
        const gl = this.gl, p = gl.createProgram();
        for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
            const s = gl.createShader(kind);
            gl.shaderSource(s, text);
            gl.compileShader(s);
            if (!gl.getShaderParameter(s, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(s));
            gl.attachShader(p, s);
        }
        ['place', 'normal', 'colour'].forEach((name, i) => gl.bindAttribLocation(p, i, name));
        gl.linkProgram(p);
        this.at = {};
        for (const name of ['view', 'eye', 'lamp', 'alpha', 'flatness']) this.at[name] = gl.getUniformLocation(p, name);
        return p;
    }

    // Arrays on the card: of n vertices, with triangles or lines.
    buffers(n, index) {
        const gl = this.gl, b = {n, count: index.length, array: gl.createVertexArray(), data: []};
        gl.bindVertexArray(b.array);
        for (let i = 0; i < 3; i++) {
            b.data.push(gl.createBuffer());
            gl.bindBuffer(gl.ARRAY_BUFFER, b.data[i]);
            gl.enableVertexAttribArray(i);
            gl.vertexAttribPointer(i, 3, gl.FLOAT, false, 0, 0);
        }
        gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
        gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, index instanceof Uint32Array ? index : new Uint32Array(index), gl.STATIC_DRAW);
        return b;
    }

    fill(b, place, normal, colour) {
        const gl = this.gl;
        [place, normal, colour].forEach((x, i) => {
            gl.bindBuffer(gl.ARRAY_BUFFER, b.data[i]);
            gl.bufferData(gl.ARRAY_BUFFER, x, gl.DYNAMIC_DRAW);
        });
    }

    // parts: [{triangles, rest, fixed}]
    setParts(parts) {
        this.parts = parts.map(p => {
            const n = p.rest.length / 3, edges = [];
            for (let i = 0; i < p.triangles.length; i += 3)
                for (let k = 0; k < 3; k++) {
                    const a = p.triangles[i + k], b = p.triangles[i + (k + 1) % 3];
                    if (a < b) edges.push(a, b);
                }
            return {...p, n, at: p.rest, value: new Float32Array(n), normal: new Float32Array(3 * n), colour: new Float32Array(3 * n),
                surface: this.buffers(n, p.triangles), wire: this.buffers(n, edges), ghost: this.buffers(n, edges)};
        });
        const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
        for (const p of parts)
            for (let i = 0; i < p.rest.length; i++) {
                low[i % 3] = Math.min(low[i % 3], p.rest[i]);
                high[i % 3] = Math.max(high[i % 3], p.rest[i]);
            }
        this.centre = scaled(plus(low, high), 0.5);
        this.size = Math.hypot(...sub(high, low));
        this.distance = 1.35 * this.size;
        this.most = 0;
    }

    // parts: [{at, pressure, rest}], rest where joints move it; tools: [{shape, radius, half, r, t}], points: [x, y, z, fx, fy, fz ..]
    update(parts, tools, points) {
        parts.forEach((p, i) => {
            this.parts[i].at = p.at;
            this.parts[i].rest = p.rest || this.parts[i].rest;
            this.parts[i].pressure = p.pressure;
            this.parts[i].level = p.level;
        });
        this.tools = tools;
        this.points = points || new Float32Array(0);
        this.draw();
    }

    // What colours stand for: size of the displacement (m), or pressure (Pa); the scale follows at once and falls slowly.
    values() {
        let most = 0;
        for (const p of this.parts) {
            for (let i = 0; i < p.n; i++) {
                const v = this.mode === 'pressure' ? (p.pressure ? p.pressure[i] : 0)
                    : Math.hypot(p.at[3 * i] - p.rest[3 * i], p.at[3 * i + 1] - p.rest[3 * i + 1], p.at[3 * i + 2] - p.rest[3 * i + 2]);
                p.value[i] = v;
                if (v > most) most = v;
            }
        }
        this.now = most;
        this.most = this.hold ? Math.max(this.hold, 1e-12) : Math.max(most, 0.98 * this.most, this.mode === 'pressure' ? 1 : 1e-3 * this.size);
    }

    normals(p) {
        const n = p.normal, x = p.at, t = p.triangles;
        n.fill(0);
        for (let i = 0; i < t.length; i += 3) {
            const a = 3 * t[i], b = 3 * t[i + 1], c = 3 * t[i + 2];
            const ux = x[b] - x[a], uy = x[b + 1] - x[a + 1], uz = x[b + 2] - x[a + 2];
            const vx = x[c] - x[a], vy = x[c + 1] - x[a + 1], vz = x[c + 2] - x[a + 2];
            const nx = uy * vz - uz * vy, ny = uz * vx - ux * vz, nz = ux * vy - uy * vx;
            for (const k of [a, b, c]) { n[k] += nx; n[k + 1] += ny; n[k + 2] += nz; }
        }
    }

    colours(p) {
        for (let i = 0; i < p.n; i++) {
            const c = this.mode === 'plain' ? COLD[0] : this.mode === 'value' && p.share ? heat(p.share[i]) : this.mode === 'level' && p.level ? this.levelColour(p.level[i]) : heat(p.value[i] / this.most), dim = p.fixed && p.fixed[i] ? 0.72 : 1;
            p.colour.set([dim * c[0], dim * c[1], dim * c[2]], 3 * i);
        }
    }

    levelColour(level) { return LEVELS[Math.min(level, LEVELS.length - 1)].match(/\w\w/g).map(v => parseInt(v, 16) / 255); }

    camera() {
        const c = Math.cos(this.pitch), toward = [c * Math.cos(this.yaw), c * Math.sin(this.yaw), Math.sin(this.pitch)];
        const right = unit(cross([0, 0, 1], toward)), up = cross(toward, right);
        return {eye: plus(this.centre, scaled(toward, this.distance)), toward, right, up};
    }

    matrix() {
        const k = this.camera(), aspect = this.canvas.width / Math.max(this.canvas.height, 1), f = 2.4, near = 0.02 * this.distance,
            far = 20 * this.distance, fx = aspect > 1 ? f / aspect : f, fy = aspect > 1 ? f : f * aspect;
        const row = (v, s) => [s * v[0], s * v[1], s * v[2], -s * dot(v, k.eye)];
        const x = row(k.right, fx), y = row(k.up, fy), z = row(k.toward, 1);
        const a = (far + near) / (near - far), b = 2 * far * near / (near - far);
        const w = z.map(v => -v), d = z.map((v, i) => a * v + (i === 3 ? b : 0));
        const m = new Float32Array(16);
        for (let i = 0; i < 4; i++) m.set([x[i], y[i], d[i], w[i]], 4 * i);
        return m;
    }

    project(p) {
        const m = this.matrix(), v = [0, 1, 2, 3].map(r => m[r] * p[0] + m[4 + r] * p[1] + m[8 + r] * p[2] + m[12 + r]);
        return [(v[0] / v[3] + 1) / 2 * this.canvas.clientWidth, (1 - v[1] / v[3]) / 2 * this.canvas.clientHeight, v[3]];
    }

    // From the eye through a pixel of the canvas (CSS pixels).
    ray(x, y) {
        const k = this.camera(), w = this.canvas.clientWidth, h = this.canvas.clientHeight, aspect = w / h, f = 2.4;
        const sx = (2 * x / w - 1) / (aspect > 1 ? f / aspect : f), sy = (1 - 2 * y / h) / (aspect > 1 ? f : f * aspect);
        return {origin: k.eye, direction: unit(plus(plus(scaled(k.right, sx), scaled(k.up, sy)), scaled(k.toward, -1)))};
    }

    // The nearest triangle that a ray meets: {part, node, at, normal}; on the surface at rest if asked.
    pick(ray, atRest) {
        let best = null, least = Infinity;
        this.parts.forEach((p, number) => {
            const x = atRest ? p.rest : p.at, t = p.triangles;
            for (let i = 0; i < t.length; i += 3) {
                const a = [x[3 * t[i]], x[3 * t[i] + 1], x[3 * t[i] + 2]];
                const u = sub([x[3 * t[i + 1]], x[3 * t[i + 1] + 1], x[3 * t[i + 1] + 2]], a);
                const v = sub([x[3 * t[i + 2]], x[3 * t[i + 2] + 1], x[3 * t[i + 2] + 2]], a);
                const n = cross(u, v), facing = dot(n, ray.direction);
                if (facing >= 0) continue;
                const off = sub(ray.origin, a), s = -dot(n, off) / facing;
                if (s <= 0 || s >= least) continue;
                const q = plus(off, scaled(ray.direction, s)), nn = dot(n, n);
                const b = dot(cross(q, v), n) / nn, c = dot(cross(u, q), n) / nn;
                if (b < 0 || c < 0 || b + c > 1) continue;
                least = s;
                const node = b > c ? (b > 1 - b - c ? t[i + 1] : t[i]) : c > 1 - b - c ? t[i + 2] : t[i];
                best = {part: number, node, at: plus(a, q), normal: unit(n)};
            }
        });
        return best;
    }

    // ---- drawing ----

    draw() {
        if (this.pending) return;
        this.pending = true;
        requestAnimationFrame(() => { this.pending = false; this.paint(); });
    }

    paint() {
        const gl = this.gl, ratio = Math.min(devicePixelRatio || 1, 2), w = this.canvas.clientWidth, h = this.canvas.clientHeight;
        if (w === 0 || this.parts.length === 0) return;
        if (this.canvas.width !== Math.round(w * ratio) || this.canvas.height !== Math.round(h * ratio)) {
            this.canvas.width = Math.round(w * ratio);
            this.canvas.height = Math.round(h * ratio);
        }
        const back = this.background(), k = this.camera();
        gl.viewport(0, 0, this.canvas.width, this.canvas.height);
        gl.clearColor(...back, 1);
        gl.enable(gl.DEPTH_TEST);
        gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
        gl.useProgram(this.program);
        gl.uniformMatrix4fv(this.at.view, false, this.matrix());
        gl.uniform3fv(this.at.eye, k.eye);
        gl.uniform3fv(this.at.lamp, unit(plus(plus(scaled(k.toward, 0.6), scaled(k.up, 0.7)), scaled(k.right, -0.4))));
        this.values();
        for (const p of this.parts) {
            this.normals(p);
            this.colours(p);
            this.fill(p.surface, p.at, p.normal, p.colour);
            this.solid(p.surface, gl.TRIANGLES, 1, 0);
            if (this.show.edges) this.lines(p.wire, p.at, p.normal, [0.25, 0.2, 0.2], 0.25);
            if (this.show.rest) this.lines(p.ghost, p.rest, p.normal, [0.2, 0.4, 0.7], 0.5);
        }
        for (const t of this.tools) this.drawTool(t);
        if (this.show.points) this.drawPoints();
        if (this.show.force && this.force) this.arrow(this.force.at, this.force.vector, [0.12, 0.37, 0.66]);
        if (this.drawn) this.drawn();
    }

    background() {
        const c = cssColour('--panel').match(/\w\w/g);
        return c ? c.slice(0, 3).map(v => parseInt(v, 16) / 255) : [1, 1, 1];
    }

    solid(b, kind, alpha, flatness) {
        const gl = this.gl;
        gl.uniform1f(this.at.alpha, alpha);
        gl.uniform1f(this.at.flatness, flatness);
        if (alpha < 1) { gl.enable(gl.BLEND); gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA); }
        gl.bindVertexArray(b.array);
        gl.drawElements(kind, b.count, gl.UNSIGNED_INT, 0);
        gl.disable(gl.BLEND);
    }

    lines(b, place, normal, colour, alpha) {
        const all = new Float32Array(place.length);
        for (let i = 0; i < all.length; i++) all[i] = colour[i % 3];
        this.fill(b, place, normal, all);
        this.solid(b, this.gl.LINES, alpha, 1);
    }

    // A surface of revolution about z from a profile [[radius, z] ..], from below.
    revolve(profile) {
        const around = 28, place = [], index = [];
        for (const [r, z] of profile)
            for (let i = 0; i < around; i++) place.push(r * Math.cos(2 * Math.PI * i / around), r * Math.sin(2 * Math.PI * i / around), z);
        for (let k = 0; k + 1 < profile.length; k++)
            for (let i = 0; i < around; i++) {
                const a = k * around + i, b = k * around + (i + 1) % around;
                index.push(a, b, b + around, a, b + around, a + around);
            }
        return {place, index};
    }

    // Half circles of radius r about -half and half of the axis: a ball, a capsule.
    rounded(r, half) {
        const profile = [];
        for (let i = -10; i <= 10; i++) {
            const angle = i / 10 * Math.PI / 2, z = r * Math.sin(angle) + (i < 0 ? -half : half);
            profile.push([r * Math.cos(angle), z]);
            if (i === 0 && half > 0) profile.splice(-1, 0, [r, -half]);
        }
        return this.revolve(profile);
    }

    toolShape(t) {
        if (t.shape === 3 && this.toolMesh) return this.toolMesh;
        if (t.shape === 1) return this.revolve([[1e-6, -t.half], [t.radius, -t.half], [t.radius, t.half], [1e-6, t.half]]);
        if (t.shape === 2) {
            const [a, b, c] = [t.radius, t.half, 0.25 * Math.min(t.radius, t.half)];
            const place = [-a, -b, 0, a, -b, 0, a, b, 0, -a, b, 0, -a, -b, c, a, -b, c, a, b, c, -a, b, c];
            return {place, index: [0, 2, 1, 0, 3, 2, 4, 5, 6, 4, 6, 7, 0, 1, 5, 0, 5, 4, 1, 2, 6, 1, 6, 5, 2, 3, 7, 2, 7, 6, 3, 0, 4, 3, 4, 7]};
        }
        return this.rounded(t.radius, t.shape === 0 ? t.half : 0);
    }

    drawTool(t) {
        if (t.t.some(v => Math.abs(v) > 100)) return;
        const s = this.toolShape(t), place = new Float32Array(s.place.length);
        for (let i = 0; i < place.length; i += 3)
            for (let k = 0; k < 3; k++)
                place[i + k] = t.t[k] + t.r[3 * k] * s.place[i] + t.r[3 * k + 1] * s.place[i + 1] + t.r[3 * k + 2] * s.place[i + 2];
        this.mesh(place, s.index, [0.42, 0.52, 0.64], this.show.points && this.points.length > 0 ? 0.55 : 0.9);
    }

    mesh(place, index, colour, alpha) {
        const key = index.length + '/' + place.length;
        this.kept = this.kept || new Map();
        if (!this.kept.has(key)) this.kept.set(key, this.buffers(place.length / 3, index));
        const b = this.kept.get(key), part = {at: place, triangles: index, normal: new Float32Array(place.length)};
        const all = new Float32Array(place.length);
        for (let i = 0; i < all.length; i++) all[i] = colour[i % 3];
        this.normals(part);
        this.fill(b, place, part.normal, all);
        this.solid(b, this.gl.TRIANGLES, alpha, 0);
    }

    drawPoints() {
        const n = this.points.length / 6;
        let most = 0;
        for (let i = 0; i < n; i++) most = Math.max(most, Math.hypot(...this.points.subarray(6 * i + 3, 6 * i + 6)));
        this.gl.disable(this.gl.DEPTH_TEST);
        for (let i = 0; i < n; i++) {
            const at = this.points.subarray(6 * i, 6 * i + 3), share = Math.hypot(...this.points.subarray(6 * i + 3, 6 * i + 6)) / (most || 1);
            const r = 0.004 * this.size * (0.5 + Math.sqrt(share));
            this.dot = this.dot || this.rounded(1, 0);
            const place = new Float32Array(this.dot.place.length);
            for (let k = 0; k < place.length; k++) place[k] = at[k % 3] + r * this.dot.place[k];
            this.mesh(place, this.dot.index, [0.08, 0.1, 0.14], 1);
        }
        this.gl.enable(this.gl.DEPTH_TEST);
    }

    // From a place along a vector (m).
    arrow(at, vector, colour) {
        const length = Math.hypot(...vector), z = unit(vector);
        if (!(length > 1e-4 * this.size)) return;
        const side = unit(cross(z, Math.abs(z[0]) < 0.7 ? [1, 0, 0] : [0, 1, 0])), up = cross(z, side);
        const r = 0.008 * this.size, head = Math.min(0.4 * length, 0.06 * this.size);
        const s = this.revolve([[1e-6, 0], [r, 0], [r, length - head], [2.6 * r, length - head], [1e-6, length]]);
        const place = new Float32Array(s.place.length);
        for (let i = 0; i < place.length; i += 3)
            for (let k = 0; k < 3; k++) place[i + k] = at[k] + side[k] * s.place[i] + up[k] * s.place[i + 1] + z[k] * s.place[i + 2];
        this.gl.disable(this.gl.DEPTH_TEST);
        this.mesh(place, s.index, colour, 0.9);
        this.gl.enable(this.gl.DEPTH_TEST);
    }

    // ---- turning it ----

    turn(dx, dy) {
        this.yaw -= 0.008 * dx;
        this.pitch = Math.max(-1.5, Math.min(1.5, this.pitch + 0.008 * dy));
        this.draw();
    }

    zoom(factor) {
        this.distance = Math.max(0.2 * this.size, Math.min(6 * this.size, this.distance * factor));
        this.draw();
    }

    // Turning and zooming by pointer, wheel and arrow keys, where nothing else is done with them.
    orbit() {
        const down = new Map(), c = this.canvas;
        c.addEventListener('pointerdown', e => { down.set(e.pointerId, [e.clientX, e.clientY]); c.setPointerCapture(e.pointerId); });
        c.addEventListener('pointermove', e => {
            const before = down.get(e.pointerId);
            if (!before) return;
            if (down.size === 2) {
                const other = [...down.entries()].find(([id]) => id !== e.pointerId)[1];
                const was = Math.hypot(before[0] - other[0], before[1] - other[1]), is = Math.hypot(e.clientX - other[0], e.clientY - other[1]);
                this.zoom(was / Math.max(is, 1));
            } else {
                this.turn(e.clientX - before[0], e.clientY - before[1]);
            }
            down.set(e.pointerId, [e.clientX, e.clientY]);
        });
        const up = e => down.delete(e.pointerId);
        c.addEventListener('pointerup', up);
        c.addEventListener('pointercancel', up);
        c.addEventListener('wheel', e => { e.preventDefault(); this.zoom(e.deltaY > 0 ? 1.1 : 0.9); }, {passive: false});
        c.addEventListener('keydown', e => {
            const step = {ArrowLeft: [-12, 0], ArrowRight: [12, 0], ArrowUp: [0, -12], ArrowDown: [0, 12]}[e.key];
            if (step) this.turn(...step);
            else if (e.key === '+' || e.key === '=') this.zoom(0.9);
            else if (e.key === '-') this.zoom(1.1);
            else return;
            e.preventDefault();
        });
    }
}
