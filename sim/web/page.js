// SPDX-License-Identifier: MIT
// The page: its state, the scenes it makes of that, and what it hears from the worker, which has the engine. touch.js has what a
// pointer does, panel.js what is shown and switched, drop.js files that are dropped on it.
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
let body = null, joints = [], place = null, turned = null, turns = [], looked = null, size = 1, rate = RATES[0], serial = 0, opening = false, again = null;
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
    const jaw = 'tool ball ' + 0.005 * size + '\n';
    if (grip) return text + jaw + 'jaw -0.5\n' + friction + jaw + 'jaw 0.5\n' + friction;
    const shape = TOOLS[state.tool] && TOOLS[state.tool][1].replace(/[\d.]+/g, m => +(m * size).toPrecision(6));
    return text + 'tool ' + (state.tool === 'own' ? 'own.tool' : shape) + '\n' + friction;
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

// A model of the page; `shared` says where the device stands and how joints are turned.
async function choose(name, shared = {}) {
    const m = models.find(x => x.name === name) || models[0];
    try {
        files = new Map([['/body.palp', await fetchModel(m)]]);
        Object.assign(state, {model: m.name});
        own = scene = body = null;
        size = 1;
        place = shared.place ? shared.place.split(',').map(Number) : null;
        turns = shared.joints ? shared.joints.split(',').map(Number) : [];
        joints = [];
        endReplay();
        reopen();
    } catch (error) {
        say('This model does not load: ' + error.message);
    }
}

function endReplay() { replaying = false; recording = false; paused = false; panel(); }

// ---- what the worker says ----

const heard = {
    opened(m) {
        if (m.serial !== serial) return; // another has been asked for since
        // A body much larger or smaller than a hand's is scaled to the device's workspace: tools and depths go with it.
        if (!m.log && !scene && Math.abs(m.scale / size - 1) > 0.01) {
            size = m.scale;
            return open(again);
        }
        const fresh = !body || m.parts.length !== body.parts.length || m.parts.some((p, i) => p.rest.length !== body.parts[i].rest.length) || m.kind !== body.kind;
        opening = false;
        body = m;
        if (fresh) {
            view.setParts(m.parts);
            if (looked) [view.yaw, view.pitch, view.distance] = looked.split(',').map((v, i) => i < 2 ? +v : v * view.size);
            looked = null;
            if (m.joints.length > 0 && joints.length === 0 && !scene && !m.log) {
                joints = m.joints.map((j, i) => ({...j, value: Math.min(Math.max(turns[i] || 0, j.low), j.high)}));
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
    for (const name of s.files) got.push(new File([await (await fetch('files/' + encodeURIComponent(name))).arrayBuffer()], name));
    return takeFiles(got);
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
    looked = shared.look;
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
    await choose(state.model || models[0].name, shared);
}
