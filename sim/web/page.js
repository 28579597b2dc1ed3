// SPDX-License-Identifier: MIT
// The page: what is shown, what a pointer does, what can be switched. The worker has the engine.
'use strict';

const WINDOW_S = 10; // that the plots show
const HOVER_M = 0.012; // above the surface, where the tool waits under the pointer
const REPLACE_M = 0.03; // off the place of the device, from which on it is put where it is wanted
const RATES = [1000, 500, 250, 100];
const GRIP_OPEN = 1.4, GRIP_SHUT = 0.3; // rad
const GRIP_S = 0.6, GRIP_M = 0.01; // of each move; how much further in than something is pressed
const GRIPPER = 'like arm7-palp-fd\ngripper 0.04\n'; // jaws that open wider, m per rad
const DEVICES = {one: 'arm3', grip: 'gripper.dev'};
const SPEEDS = [[0.25, 'fast'], [1, '4 times slower'], [3, '12 times slower'], [6, '24 times slower'], [12, '48 times slower'],
    [24, '96 times slower'], [48, '192 times slower']];
const TOOLS = {small: ['ball, 4 mm', 'ball 0.004'], ball: ['ball, 8 mm', 'ball 0.008'], large: ['ball, 16 mm', 'ball 0.016'],
    capsule: ['capsule, 3 x 20 mm', 'capsule 0.003 0.010'], cylinder: ['cylinder, 6 x 16 mm', 'cylinder 0.006 0.008'],
    pad: ['pad, 16 x 12 mm', 'pad 0.008 0.006 0.002']};
const MATERIALS = {baked: ['as baked', null], jelly: ['jelly', [600, 0.45, 5e-4, 1]], fat: ['fat', [2e3, 0.45, 1e-3, 8]],
    muscle: ['muscle', [2e4, 0.45, 4e-4, 4]], gel: ['gel', [5e4, 0.4, 1e-4, 2]]}; // Young's modulus, Poisson's ratio, damping, drag
const MODES = {press: ['Press', 'Drag on the body: the tool presses and slides'], pull: ['Pull', 'Drag a place of the body: it is held and moved, as in the paper'],
    grip: ['Grip', 'Two jaws come down about the place that is touched, and close'], look: ['Turn', 'Drag to turn the body']};
const STATE_WORDS = {RUN: 'the force is felt', READY: 'waits for the operator', FAULT: 'a fault took the force away: reset',
    DAMPING: 'only damping: reset', ENABLING: 'the drives take torque', INIT: 'waits for the drives', CONFIG_CHECK: 'asks the drives what they are',
    HOMING: 'waits for the home pose', ESTOP: 'stopped'};

const $ = id => document.getElementById(id);
const state = {model: null, tool: 'ball', depth: 6, level: 3, friction: 0.3, speed: 0.25, material: 'baked', mode: 'press', colour: 'moved',
    points: true, force: true, rest: false, edges: false};
let worker, view, plots, series, files = new Map(), scene = null, toolFile = null, own = null; // own: dropped body {name}
let body = null, joints = [], place = null, turned = null, rate = RATES[0], serial = 0, opening = false, again = null;
let press = null, recording = false, replaying = false, paused = false, last = null, started = 0, firstForce = 0, frameMs = 0, frameAt = 0;

// ---- files that the page brings along ----

async function unpack(base64) {
    const packed = Uint8Array.from(atob(base64.trim()), c => c.charCodeAt(0));
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream('gzip'));
    return new Uint8Array(await new Response(stream).arrayBuffer());
}

// Models of the page: in it, or in a script beside it.
const models = window.MODELS || [];

function palpModel(name, base64) { models.find(m => m.name === name).packed = base64; }

async function fetchModel(m) {
    if (!m.packed && m.script) {
        say('Loading ' + m.title + ' ..');
        await new Promise((done, failed) => {
            const s = document.createElement('script');
            s.src = m.script;
            s.onload = done;
            s.onerror = () => failed(new Error(m.script + ' is not there: it belongs beside this page'));
            document.head.append(s);
        });
        say();
    }
    if (m.url) return new Uint8Array(await (await fetch(m.url)).arrayBuffer());
    return unpack(m.packed);
}

// ---- saying something ----

function say(text, ...buttons) {
    const m = $('message');
    m.hidden = !text;
    m.textContent = text || '';
    for (const [label, action] of buttons) {
        const b = document.createElement('button');
        b.textContent = label;
        b.onclick = () => { say(); action(); };
        m.append(document.createElement('br'), b);
    }
}

// ---- scenes ----

function jointLines() {
    return joints.map((j, i) => `pose 0 ${j.name} ${j.value}\nlisten ${j.name} 0 ${0x3a0 + (i >> 1)} ${4 * (i & 1)} ${2 * (j.high - j.low)}\n`).join('');
}

// The device at `place`, with the tool that is chosen.
function sceneText() {
    const grip = state.mode === 'grip', lines = ['seconds 10', 'rate ' + rate];
    lines.push('body body.palp body', 'finest ' + state.level);
    const material = MATERIALS[state.material][1];
    if (body && body.kind === 2 && material) ['young', 'poisson', 'damping', 'drag'].forEach((k, i) => lines.push(k + ' ' + material[i]));
    let text = lines.join('\n') + '\n' + jointLines();
    text += 'device ' + (grip ? DEVICES.grip : DEVICES.one) + '\n';
    if (place) text += 'place ' + place.join(' ') + '\n';
    if (grip && turned) text += 'turn ' + turned.join(' ') + '\n';
    const friction = state.friction > 0 ? 'friction ' + state.friction + '\n' : '';
    if (grip) return text + 'tool ball 0.005\njaw -0.5\n' + friction + 'tool ball 0.005\njaw 0.5\n' + friction;
    return text + 'tool ' + (state.tool === 'own' ? 'own.tool' : TOOLS[state.tool][1]) + '\n' + friction;
}

// Opens what is chosen; `then` comes after it has opened.
function open(then, options = {}) {
    opening = true;
    again = then || null;
    const list = [...files];
    if (toolFile) list.push(['/own.tool', toolFile]);
    list.push(['/gripper.dev', new TextEncoder().encode(GRIPPER)]);
    worker.postMessage({do: 'open', files: list, scene: scene || sceneText(), ns: state.speed, serial: ++serial, record: recording, ...options});
    share();
}

function reopen(then) {
    if (replaying) return;
    rate = RATES[0];
    open(then);
}

async function choose(name) {
    const m = models.find(x => x.name === name) || models[0];
    try {
        files = new Map([['/body.palp', await fetchModel(m)]]);
        Object.assign(state, {model: m.name});
        own = scene = place = body = null;
        joints = [];
        endReplay();
        reopen();
        if (m.log) return replayLog(await fetchModel({url: m.log}), m.log);
    } catch (error) {
        say('This model does not load: ' + error.message);
    }
}

function endReplay() { replaying = false; recording = false; paused = false; panel(); }

// ---- what the worker says ----

const heard = {
    opened(m) {
        const fresh = !body || m.parts.length !== body.parts.length || m.parts.some((p, i) => p.rest.length !== body.parts[i].rest.length) || m.kind !== body.kind;
        opening = false;
        body = m;
        if (fresh) {
            view.setParts(m.parts);
            if (m.joints.length > 0 && joints.length === 0 && !scene && !m.log) {
                joints = m.joints.map(j => ({...j, value: Math.max(0, j.low)}));
                panel();
                return open(again);
            }
        }
        clearPlots();
        panel();
        say();
        if (press) press.since = performance.now();
        if (again) again();
        again = null;
    },

    frame(m) {
        worker.postMessage({do: 'drawn'});
        if (m.serial !== serial || !body || m.look.parts.length !== view.parts.length) return;
        const now = performance.now();
        frameMs = 0.9 * frameMs + 0.1 * (now - frameAt);
        frameAt = now;
        last = m;
        keep(m.news);
        show(m);
    },

    failed(m) {
        const at = RATES.indexOf(rate);
        opening = false;
        if (m.doing === 'open' && !scene && /lower --rate/.test(m.text) && at + 1 < RATES.length) {
            rate = RATES[at + 1];
            return open(again);
        }
        rate = RATES[0];
        recording = false;
        if (replaying) endReplay();
        const text = m.text.replace('lower --rate', 'a faster controller, or a coarser level').replace(/\bbody\.palp/g, own || state.model);
        say(text, ['Close', () => {}]);
        panel();
    },

    said(m) { if ($('message').dataset.busy) say(m.line.replace(/^palp: /, '')); else console.info(m.line); },
    log(m) { download(m.bytes, 'palp.log'); recording = false; panel(); },
    ran(m) { window.ran = m; },

    file(m) {
        delete $('message').dataset.busy;
        say();
        if (m.as === 'tool') {
            toolFile = m.bytes;
            state.tool = 'own';
            reopen();
        } else {
            takeBody(m.bytes, m.name);
            say('Baked. It can be kept as a blob for palpd.', ['Save ' + m.name, () => download(m.bytes, m.name)], ['Close', () => {}]);
        }
        panel();
    },
};

function download(bytes, name) {
    const a = document.createElement('a');
    a.href = URL.createObjectURL(new Blob([bytes]));
    a.download = name;
    a.click();
    setTimeout(() => URL.revokeObjectURL(a.href), 10000);
}

// ---- touching ----

const away = hit => hit.at.map((v, k) => v + hit.normal[k] * HOVER_M * 1.6);

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
    if (canMove && (!place || state.mode === 'grip' || far(place, hit.at) > REPLACE_M)) {
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
        const off = seconds < GRIP_S ? 2 * HOVER_M : -GRIP_M - state.depth / 1000; // open, about it, shut
        worker.postMessage({do: 'reach', device: 0, at: hit.at.map((v, k) => v + hit.normal[k] * off), grip: seconds < 2 * GRIP_S ? GRIP_OPEN : GRIP_SHUT});
        return;
    }
    const off = last && last.look.tools.length > 0 ? standOff(last.look.tools[0]) : 0;
    press.depth = Math.min(state.depth / 1000, press.depth + 0.0006);
    worker.postMessage({do: 'reach', device: 0, at: hit.at.map((v, k) => v + hit.normal[k] * (off - press.depth))});
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

// ---- showing ----

function show(m) {
    const l = m.look, tool = l.tools[0];
    view.mode = state.colour;
    Object.assign(view.show, {points: state.points, force: state.force, rest: state.rest, edges: state.edges});
    view.update(l.parts, l.pulled ? [] : l.tools, l.points);
    const row = m.news.length >= MEASURE_COUNT ? m.news.subarray(m.news.length - MEASURE_COUNT) : null;
    if (row) {
        const force = [row[2], row[3], row[4]], newton = Math.hypot(...force);
        const from = l.pulled && l.points.length >= 3 ? [...l.points.subarray(0, 3)] : tool ? [...tool.t] : [0, 0, 0];
        view.force = {at: from, vector: scaled(force, 0.1 * view.size)};
        $('readout').innerHTML = '<b>' + newton.toFixed(2) + ' N</b><br><span class="note">' +
            (l.pulled ? 'holds the place' : 'at the hand') + '</span>';
        if (newton > 0.02 && firstForce === 0) firstForce = performance.now() - started;
    }
    legend();
    numbers(m, row);
    if (l.state === 'FAULT' || l.state === 'DAMPING') sayFault(l);
    else if ($('message').dataset.fault) { delete $('message').dataset.fault; say(); }
    if (replaying && l.end && !m.told) ended(l.end);
}

function sayFault(l) {
    if ($('message').dataset.fault || replaying) return;
    say('State ' + l.state + (l.faults ? ': ' + l.faults : '') + '. The force is off.', ['Reset', () => worker.postMessage({do: 'reset'})]);
    $('message').dataset.fault = 1;
}

function ended(end) {
    if (replaying === 'ended') return;
    replaying = 'ended';
    const words = {done: 'The recording has ended: every tick came out as recorded, bit for bit.', cut: 'The recording was cut off; up to there every tick came out as recorded.',
        gap: 'Ticks are missing from the recording here.', exchanged: 'Bodies or tools were exchanged here, where a replay ends.', differs: 'From here on this run differs from the recording.'};
    say(words[end], ['Again', () => replayLog(files.get('/page.log'), '')], ['Back to touching', () => { endReplay(); files.delete('/page.log'); scene = null; reopen(); }]);
}

function legend() {
    const of = {moved: [1e3 * view.most, 'mm moved'], pressure: [1e-3 * view.most, 'kPa']}[state.colour];
    $('legend').hidden = !of;
    if (of) $('legend-text').innerHTML = '<span>0</span><span>' + number(+of[0].toPrecision(2)) + ' ' + of[1] + '</span>';
}

function numbers(m, row) {
    const l = m.look, us = 1000 * m.ms, list = [];
    const add = (name, value, word) => list.push('<tr><th><span data-word title="' + word + '">' + name + '</span></th><td>' + value + '</td></tr>');
    add('state', l.state, STATE_WORDS[l.state] || 'of the controller');
    if (row) {
        add('level', row[8] + (row[8] < state.level ? ' of ' + state.level + (l.limit < state.level ? ': more would not be in time' : '') : ''),
            'How many points the contact is solved with: coarser where the time of a tick does not allow more');
        add('points in contact', row[9] + ' of ' + l.wanted, 'Points of the surface under the tool that carry force, of those that were laid');
        add('bound of a tick', number(+row[10].toPrecision(3)) + ' us of ' + number(1e6 / body.rate_hz),
            'Most that a tick can take on a controller of the chosen speed, known before it begins');
    }
    add('a tick here', m.ms > 0 ? number(+us.toPrecision(2)) + ' us' : '-', 'What a tick takes in this browser, in the mean');
    add('rate', body.rate_hz + ' ticks a second' + (m.ms * body.rate_hz > 1000 ? ', slowed down to ' + Math.round(1000 / m.ms) : ''), 'Ticks of the controller in a second of virtual time');
    add('a frame', number(+frameMs.toPrecision(2)) + ' ms', 'Between two pictures');
    const html = '<table>' + list.join('') + '</table>';
    if (html !== numbers.html) $('numbers').innerHTML = numbers.html = html;
}

const MEASURE_COUNT = 12;

function ring(name) { return {name, t0: 0, dt: 1e-3, low: new Float32Array(0), high: null}; }

function clearPlots() {
    series = {force: ring('force'), stored: ring('stored'), given: ring('given to the hand'), level: ring('level')};
    series.level.step = true;
    plots.charts[0].series = [series.force];
    plots.charts[1].series = [series.stored, series.given];
    plots.charts[2].series = [series.level];
    for (const s of Object.values(series)) { s.dt = 1 / body.rate_hz; s.high = s.low; }
}

function keep(news) {
    const n = news.length / MEASURE_COUNT, most = Math.round(WINDOW_S * body.rate_hz);
    if (n === 0) return;
    [['force', 1], ['stored', 5], ['given', 7], ['level', 8]].forEach(([name, column]) => {
        const s = series[name], held = s.low.subarray(Math.max(0, s.low.length + n - most));
        const next = new Float32Array(held.length + n);
        next.set(held);
        for (let i = 0; i < n; i++) next[held.length + i] = news[i * MEASURE_COUNT + column];
        s.low = s.high = next;
        s.t0 = news[news.length - MEASURE_COUNT] - (next.length - 1) * s.dt;
    });
    if (!plots.held) plots.all();
}

// ---- the panel ----

function control(label, element, word) {
    const row = document.createElement('label');
    row.className = 'row';
    const name = document.createElement('span');
    name.textContent = label;
    if (word) { name.title = word; name.dataset.word = ''; }
    row.append(name, element);
    return row;
}

function select(options, value, changed) {
    const s = document.createElement('select');
    for (const [key, text] of options) s.append(new Option(text, key, false, String(key) === String(value)));
    s.onchange = () => changed(s.value);
    return s;
}

function slider(low, high, step, value, text, changed) {
    const row = document.createElement('div'), input = document.createElement('input'), out = document.createElement('output');
    row.className = 'slider';
    Object.assign(input, {type: 'range', min: low, max: high, step});
    input.value = value;
    out.textContent = text(value);
    input.oninput = () => { out.textContent = text(+input.value); changed(+input.value, false); };
    input.onchange = () => changed(+input.value, true);
    row.append(input, out);
    return row;
}

function button(text, action, pressed) {
    const b = document.createElement('button');
    b.type = 'button';
    b.textContent = text;
    if (pressed !== undefined) b.setAttribute('aria-pressed', pressed);
    b.onclick = action;
    return b;
}

function set(key, value) { state[key] = value; panel(); share(); }

function panel() {
    const box = $('controls'), focus = document.activeElement && document.activeElement.dataset.key;
    box.replaceChildren();
    const list = models.map(m => [m.name, m.title]);
    if (own) list.push(['own', own]);
    box.append(control('body', select(list, own ? 'own' : state.model, v => v !== 'own' && choose(v))));
    const tools = Object.entries(TOOLS).map(([k, t]) => [k, t[0]]);
    if (toolFile) tools.push(['own', 'your own']);
    box.append(control('tool', select(tools, state.tool, v => { set('tool', v); reopen(); })));
    box.append(control('how deep', slider(0.5, 25, 0.5, state.depth, v => v + ' mm', v => { state.depth = v; if (press) press.depth = Math.min(press.depth, v / 1000); }),
        'How far the hand wants the tool below the surface; the body pushes back'));
    box.append(control('friction', slider(0, 1, 0.05, state.friction, v => v.toFixed(2), (v, done) => { state.friction = v; if (done) reopen(); }), 'Coulomb\'s coefficient'));
    box.append(control('finest level', slider(0, 4, 1, state.level, v => String(v), (v, done) => { state.level = v; if (done) reopen(); }),
        'The finest level of contact: 0 has about 7 points in contact, 3 about 19, 4 about 37'));
    box.append(control('controller', select(SPEEDS.map(([ns, text]) => [ns, text + ' (' + ns + ' ns an instruction)']), state.speed, v => { set('speed', +v); reopen(); }),
        'How fast the controller is taken to be: a slow one answers on a coarser level, never late'));
    if (body && body.kind === 2)
        box.append(control('material', select(Object.entries(MATERIALS).map(([k, m]) => [k, m[0]]), state.material, v => { set('material', v); reopen(); })));
    joints.forEach((j, i) => box.append(control(j.name, slider(j.low, j.high, 0.01, j.value, v => Math.round(v * 180 / Math.PI) + '\u00b0',
        v => { j.value = v; worker.postMessage({do: 'joint', joint: i, value: v}); }), 'A joint of the model, turned by another controller on the bus')));
    box.append(control('colours', select([['moved', 'how far it is moved'], ['pressure', 'pressure'], ['plain', 'none']], state.colour, v => { view.most = 0; set('colour', v); if (last) show(last); })));
    const checks = document.createElement('div');
    checks.className = 'checks';
    for (const [key, text] of [['points', 'contact points'], ['force', 'force'], ['rest', 'at rest'], ['edges', 'mesh']]) {
        const label = document.createElement('label'), input = document.createElement('input');
        input.type = 'checkbox';
        input.checked = state[key];
        input.onchange = () => { set(key, input.checked); if (last) show(last); };
        label.append(input, ' ' + text);
        checks.append(label);
    }
    box.append(checks, actions());
    modes();
}

function actions() {
    const row = document.createElement('div');
    row.className = 'buttons';
    row.append(button(paused ? 'Go on' : 'Pause', () => { paused = !paused; worker.postMessage({do: 'pause', on: paused}); panel(); }));
    if (!replaying) {
        row.append(button(recording ? 'Stop and save' : 'Record', () => {
            if (recording) return worker.postMessage({do: 'stoplog'});
            recording = true;
            reopen();
            panel();
        }));
    } else {
        row.append(button('Back to touching', () => { endReplay(); files.delete('/page.log'); scene = null; reopen(); }));
    }
    row.append(button('Light or dark', () => {
        const root = document.documentElement, dark = matchMedia('(prefers-color-scheme: dark)').matches !== (root.dataset.theme === 'other');
        root.dataset.theme = root.dataset.theme ? (root.dataset.theme === 'dark' ? 'light' : 'dark') : dark ? 'light' : 'dark';
        view.draw();
        plots.draw();
    }));
    return row;
}

function modes() {
    $('modes').replaceChildren(...Object.entries(MODES).map(([key, [text, word]]) => {
        const b = button(text, () => {
            const device = state.mode === 'grip' || key === 'grip';
            letGo();
            set('mode', key);
            if (device) reopen();
        }, state.mode === key);
        b.title = word;
        return b;
    }));
}

// ---- sharing ----

function share() {
    const list = ['model', 'tool', 'depth', 'level', 'friction', 'speed', 'material', 'mode', 'colour'].filter(k => !(k === 'tool' && state.tool === 'own') && state[k] !== null);
    const part = list.map(k => k + '=' + encodeURIComponent(state[k]));
    for (const k of ['points', 'force', 'rest', 'edges']) part.push(k + '=' + (state[k] ? 1 : 0));
    if (view) part.push('look=' + [view.yaw, view.pitch, view.distance / (view.size || 1)].map(v => v.toFixed(3)).join());
    if (place) part.push('place=' + place.join());
    if (joints.length > 0) part.push('joints=' + joints.map(j => j.value).join());
    history.replaceState(null, '', '#' + part.join('&'));
}

function readShared() {
    const shared = {};
    for (const part of location.hash.slice(1).split('&')) {
        const [key, value] = part.split('=').map(decodeURIComponent);
        if (['points', 'force', 'rest', 'edges'].includes(key)) state[key] = value === '1';
        else if (['depth', 'level', 'friction', 'speed'].includes(key) && isFinite(+value)) state[key] = +value;
        else if (key === 'tool' && TOOLS[value] || key === 'mode' && MODES[value] || key === 'material' && MATERIALS[value] || key === 'colour' || key === 'model')
            state[key] = value;
        else shared[key] = value;
    }
    return shared;
}

// ---- files dropped on the page ----

function takeBody(bytes, name) {
    files = new Map([['/body.palp', bytes]]);
    own = name;
    scene = place = body = null;
    joints = [];
    endReplay();
    reopen();
}

function replayLog(bytes, name) {
    files.set('/page.log', bytes);
    replaying = true;
    recording = false;
    open(null, {log: true, scene: scene || 'body body.palp\ndevice arm3\ntool ' + (toolFile ? 'own.tool' : 'ball') + '\n'});
    panel();
}

function meshDialog(name, bytes) {
    const end = name.split('.').pop().toLowerCase(), at = '/mesh.' + end;
    const run = (as, list, makes, out) => {
        say(as === 'tool' ? 'Making a tool of ' + name + ' ..' : 'Baking ' + name + ': this takes up to a minute ..');
        $('message').dataset.busy = 1;
        worker.postMessage({do: 'command', files: [[at, bytes]], list, makes, as, name: out});
    };
    const stem = name.replace(/\.[^.]*$/, '');
    say(name + ': what is it?',
        ['A body: bake it here (642 nodes, 20 kPa, held at its base)', () => run('body', ['bake', at, '-o', '/out.palp', '--levels', '2', '--young', '2e4', '--poisson', '0.45',
            '--density', '1000', '--fix-below', 'z', base(bytes, end)], '/out.palp', stem + '.palp')],
        ['A rigid tool', () => run('tool', ['tool', at, '-o', '/out.tool', '--cells', '60'], '/out.tool', stem + '.tool')], ['Neither', () => {}]);
}

// A twentieth of the height of a mesh above its lowest point, in its own numbers.
function base(bytes, end) {
    let low = Infinity, high = -Infinity;
    const take = z => { if (isFinite(z)) { low = Math.min(low, z); high = Math.max(high, z); } };
    const text = end === 'obj' || new TextDecoder().decode(bytes.subarray(0, 5)) === 'solid' ? new TextDecoder().decode(bytes) : '';
    if (/^\s*v\s/m.test(text)) for (const m of text.matchAll(/^\s*v\s+\S+\s+\S+\s+(\S+)/gm)) take(+m[1]);
    else if (/vertex/.test(text)) for (const m of text.matchAll(/vertex\s+\S+\s+\S+\s+(\S+)/g)) take(+m[1]);
    else if (end === 'stl') {
        const v = new DataView(bytes.buffer, bytes.byteOffset, bytes.length), n = v.getUint32(80, true);
        for (let i = 0; i < n && 84 + 50 * i + 50 <= bytes.length; i++) for (let k = 0; k < 3; k++) take(v.getFloat32(84 + 50 * i + 20 + 12 * k, true));
    }
    return low < high ? String(low + 0.05 * (high - low)) : '0';
}

async function takeFiles(list) {
    const got = [];
    for (const f of list) got.push({name: f.name, end: f.name.split('.').pop().toLowerCase(), bytes: new Uint8Array(await f.arrayBuffer())});
    const of = end => got.filter(f => f.end === end);
    const unknown = got.find(f => !['palp', 'scene', 'tool', 'stl', 'obj', 'ply', 'log', 'dev', 'hand'].includes(f.end));
    if (unknown) return say(unknown.name + ': not a blob (.palp), scene, tool, mesh or log', ['Close', () => {}]);
    for (const t of of('tool')) { toolFile = t.bytes; state.tool = 'own'; }
    const meshes = got.filter(f => ['stl', 'obj', 'ply'].includes(f.end));
    if (of('scene').length > 0) return takeScene(of('scene')[0], got);
    if (of('palp').length > 0) takeBody(of('palp')[0].bytes, of('palp')[0].name);
    if (of('log').length > 0) return replayLog(of('log')[0].bytes, of('log')[0].name);
    if (of('palp').length > 0) return;
    if (meshes.length > 0) return meshDialog(meshes[0].name, meshes[0].bytes);
    if (of('tool').length > 0) reopen();
    panel();
}

// A scene's paths are those of the files dropped with it, by their names alone.
function takeScene(s, got) {
    const text = new TextDecoder().decode(s.bytes), names = new Set(got.map(f => f.name)), missing = [];
    const short = text.replace(/^(\s*(?:body|tool|hand|device)\s+)(\S+\.(?:palp|tool|hand|dev))/gm, (all, key, path) => {
        const name = path.split('/').pop();
        if (!names.has(name)) missing.push(name);
        return key + name;
    });
    if (missing.length > 0) return say(s.name + ': drop it together with ' + [...new Set(missing)].join(', '), ['Close', () => {}]);
    files = new Map(got.map(f => ['/' + f.name, f.bytes]));
    own = s.name;
    body = place = null;
    joints = [];
    endReplay();
    scene = short;
    const log = got.find(f => f.end === 'log');
    if (log) replayLog(log.bytes, log.name); else open();
}

function listenToFiles() {
    const stop = e => e.preventDefault();
    addEventListener('dragover', e => { stop(e); document.body.classList.add('dropping'); });
    addEventListener('dragleave', () => document.body.classList.remove('dropping'));
    addEventListener('drop', e => { stop(e); document.body.classList.remove('dropping'); takeFiles([...e.dataTransfer.files]); });
    $('files').onchange = e => takeFiles([...e.target.files]);
}

// ---- the beginning ----

async function served() {
    if (!location.protocol.startsWith('http')) return null;
    try {
        const answer = await fetch('start.json');
        return answer.ok ? await answer.json() : null;
    } catch { return null; }
}

async function openServed(s) {
    const got = [];
    for (const name of s.files) got.push({name, end: name.split('.').pop().toLowerCase(), bytes: new Uint8Array(await (await fetch('files/' + encodeURIComponent(name))).arrayBuffer())});
    if (got.some(f => f.end === 'scene' || f.end === 'log' || f.end === 'tool' || f.end === 'palp'))
        return takeFiles(got.map(f => new File([f.bytes], f.name)));
}

async function start() {
    started = performance.now();
    if (typeof WebAssembly !== 'object' || typeof DecompressionStream === 'undefined')
        return say('This browser cannot run the page: it needs WebAssembly and DecompressionStream. A current Firefox, Chrome, Edge or Safari has them.');
    try {
        view = new BodyView($('view'));
    } catch (error) {
        return say('The body cannot be drawn: ' + error.message + '. Switch hardware acceleration on, or use a current Firefox, Chrome, Edge or Safari.');
    }
    document.querySelector('#legend .scale').style.background = heatCss();
    plots = new Plots($('plots'), [
        {title: 'Force', unit: 'N', word: 'At the hand', series: [], height: 110, zero: true},
        {title: 'Energy', unit: 'mJ', word: 'Stored in body and coupling; given to the hand beyond what it put in, which stays 0', series: [], height: 90, zero: true},
        {title: 'Level', unit: '', word: 'Of the contact: falls where a tick has no time for more', series: [], height: 70, whole: true}]);
    for (const c of plots.charts) c.canvas.addEventListener('pointerdown', () => { plots.held = true; }), c.canvas.addEventListener('dblclick', () => { plots.held = false; });
    worker = new Worker(URL.createObjectURL(new Blob([$('worker').textContent], {type: 'text/javascript'})));
    worker.onmessage = e => heard[e.data.is](e.data);
    worker.onerror = e => say('The engine does not start: ' + e.message);
    const shared = readShared();
    panel();
    listenToPointer();
    listenToFiles();
    const touching = () => { reach(); requestAnimationFrame(touching); };
    touching();
    const bytes = await unpack($('wasm').textContent);
    worker.postMessage({do: 'module', bytes});
    const from = await served();
    if (from && from.files.length > 0) return openServed(from);
    if (models.length === 0) return say('No model is in this page: drop a blob on it (.palp), or choose one.');
    await choose(state.model || models[0].name);
    if (shared.place) place = shared.place.split(',').map(Number);
    if (shared.look) [view.yaw, view.pitch] = shared.look.split(',').map(Number);
    if (shared.look && view.size) view.distance = +shared.look.split(',')[2] * view.size;
}
