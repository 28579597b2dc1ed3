// SPDX-License-Identifier: MIT
// What a pointer or a key does to the body: press, pull, grip, turn.
'use strict';

const away = hit => hit.at.map((v, k) => v + hit.normal[k] * HOVER_M * 1.6 * size);

function hitAt(x, y) {
    const box = view.canvas.getBoundingClientRect(), ray = view.ray(x - box.left, y - box.top);
    const hit = view.pick(ray, body && body.kind === 0);
    if (hit) hit.normal = smooth(hit);
    return hit;
}

// The normal of the smooth surface, by the corners of the triangle.
function smooth(hit) {
    const p = view.parts[hit.part], n = p.normal, sum = [0, 1, 2].map(k => n[3 * hit.node + k]);
    return unit(plus(unit(sum), hit.normal));
}

const far = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);

// How the device is turned so that its jaws, apart along its y, come down along the normal, side by side as the eye sees it:
// an axis times an angle in degrees.
function jawsAcross(hit) {
    const z = hit.normal, right = view.camera().right;
    const y = unit(sub(right, scaled(z, dot(right, z)))), x = cross(y, z);
    const angle = Math.acos(Math.max(-1, Math.min(1, (x[0] + y[1] + z[2] - 1) / 2)));
    const axis = unit([y[2] - z[1], z[0] - x[2], x[1] - y[0]]);
    return axis.map(v => +(v * angle * 180 / Math.PI).toFixed(3));
}

function begin(hit) {
    press = {hit, since: performance.now(), depth: 0};
    if (state.mode === 'pull') {
        if (body.kind !== 0 || hit.part !== 0) return say('Pulling works on one elastostatic body.', ['Close', () => {}]);
        press.start = hit.at;
        return;
    }
    const canMove = !recording && !replaying && !scene;
    if (state.mode === 'grip') turned = jawsAcross(hit);
    if (canMove && (!place || state.mode === 'grip' || far(place, hit.at) > REPLACE_M * size)) {
        place = hit.at.map(v => +v.toFixed(5));
        open();
    }
}

// From a tool's reference point to where it touches, along the device's axis.
const standOff = t => t.shape === 0 ? t.radius + t.half : t.shape === 1 ? t.half : 0;

// Where the tip of the device is wanted, at every frame while something is touched.
function reach() {
    if (!press || !body || opening || replaying || state.mode === 'look') return;
    const {hit} = press, seconds = (performance.now() - press.since) / 1000;
    if (state.mode === 'pull') return;
    if (state.mode === 'grip') {
        const off = size * (seconds < GRIP_S ? 2 * HOVER_M : -GRIP_M - state.depth / 1000); // open, about it, shut
        worker.postMessage({do: 'reach', device: 0, at: hit.at.map((v, k) => v + hit.normal[k] * off), grip: seconds < 2 * GRIP_S ? GRIP_OPEN : GRIP_SHUT});
        return;
    }
    const off = last && last.look.tools.length > 0 ? standOff(last.look.tools[0]) : 0;
    press.depth = Math.min(state.depth / 1000, press.depth + 0.0006);
    worker.postMessage({do: 'reach', device: 0, at: hit.at.map((v, k) => v + hit.normal[k] * (off - press.depth * size))});
}

function letGo() {
    if (!press) return;
    if (state.mode === 'pull') worker.postMessage({do: 'letgo'});
    else worker.postMessage({do: 'reach', device: 0, at: away(press.hit), grip: GRIP_OPEN});
    press = null;
}

function pullTo(x, y) {
    const box = view.canvas.getBoundingClientRect(), ray = view.ray(x - box.left, y - box.top), k = view.camera();
    const along = dot(sub(press.start, ray.origin), k.toward) / dot(ray.direction, k.toward);
    const by = sub(plus(ray.origin, scaled(ray.direction, along)), press.start), most = 0.25 * view.size, length = Math.hypot(...by);
    worker.postMessage({do: 'pull', node: press.hit.node, by: length > most ? scaled(by, most / length) : by});
}

function listenToPointer() {
    const c = view.canvas, down = new Map();
    c.addEventListener('pointerdown', e => {
        down.set(e.pointerId, [e.clientX, e.clientY]);
        c.setPointerCapture(e.pointerId);
        c.focus({preventScroll: true});
        if (down.size > 1) return letGo();
        const hit = e.button === 0 && state.mode !== 'look' && body && !replaying ? hitAt(e.clientX, e.clientY) : null;
        if (hit) begin(hit);
    });
    c.addEventListener('pointermove', e => {
        const before = down.get(e.pointerId);
        if (!before) return;
        if (down.size === 2) {
            const other = [...down.entries()].find(([id]) => id !== e.pointerId)[1];
            view.zoom(Math.hypot(before[0] - other[0], before[1] - other[1]) / Math.max(Math.hypot(e.clientX - other[0], e.clientY - other[1]), 1));
            view.turn((e.clientX - before[0]) / 2, (e.clientY - before[1]) / 2);
        } else if (press && state.mode === 'pull') {
            if (press.start) pullTo(e.clientX, e.clientY);
        } else if (press) {
            const hit = hitAt(e.clientX, e.clientY);
            if (hit) press.hit = hit;
        } else {
            view.turn(e.clientX - before[0], e.clientY - before[1]);
        }
        down.set(e.pointerId, [e.clientX, e.clientY]);
    });
    const up = e => { down.delete(e.pointerId); letGo(); share(); };
    c.addEventListener('pointerup', up);
    c.addEventListener('pointercancel', up);
    c.addEventListener('contextmenu', e => e.preventDefault());
    c.addEventListener('wheel', e => { e.preventDefault(); view.zoom(e.deltaY > 0 ? 1.1 : 0.9); }, {passive: false});
    listenToKeys(c);
}

// A place on the canvas that arrow keys move and space presses.
function listenToKeys(c) {
    let x = null, y = null;
    c.addEventListener('keydown', e => {
        const box = c.getBoundingClientRect(), step = {ArrowLeft: [-8, 0], ArrowRight: [8, 0], ArrowUp: [0, -8], ArrowDown: [0, 8]}[e.key];
        if (x === null) { x = box.left + box.width / 2; y = box.top + box.height / 2; }
        if (step && e.shiftKey) view.turn(1.5 * step[0], 1.5 * step[1]);
        else if (step) {
            x += step[0];
            y += step[1];
            if (press && state.mode === 'pull') { if (press.start) pullTo(x, y); }
            else if (press) press.hit = hitAt(x, y) || press.hit;
            marker(x - box.left, y - box.top);
        } else if (e.key === ' ') {
            const hit = press || replaying ? null : hitAt(x, y);
            if (press) letGo(); else if (hit) begin(hit);
        } else if (e.key === '+' || e.key === '=') view.zoom(0.9);
        else if (e.key === '-') view.zoom(1.1);
        else if (e.key === 'Escape') letGo();
        else return;
        e.preventDefault();
    });
}

function marker(x, y) {
    let m = $('marker');
    if (!m) {
        m = document.createElement('div');
        m.id = 'marker';
        m.style.cssText = 'position:absolute;width:14px;height:14px;margin:-7px;border:2px solid var(--accent);border-radius:50%;pointer-events:none';
        $('stage').append(m);
    }
    m.style.left = x + 'px';
    m.style.top = y + 'px';
}

