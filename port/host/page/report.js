// SPDX-License-Identifier: MIT
// A report: curves with one cursor, what happened, and the body at that time. Its data is JSON in the page (page.c).
'use strict';

function unpacked(text, Kind) {
    const bytes = Uint8Array.from(atob(text), c => c.charCodeAt(0));
    return new Kind(bytes.buffer);
}

function make(parent, tag, text, attributes) {
    const e = document.createElement(tag);
    if (text) e.textContent = text;
    for (const [name, value] of Object.entries(attributes || {})) e.setAttribute(name, value);
    parent.append(e);
    return e;
}

// The surfaces between two frames of a motion.
class Motion {
    constructor(data) {
        this.time = unpacked(data.time, Float32Array);
        this.parts = data.parts.map(p => ({triangles: unpacked(p.triangles, Uint32Array), rest: unpacked(p.rest, Float32Array),
            fixed: p.fixed ? unpacked(p.fixed, Uint8Array) : null, scale: unpacked(p.scale, Float32Array),
            step: unpacked(p.step, p.bits === 16 ? Int16Array : Int8Array), levels: p.level ? unpacked(p.level, Uint8Array) : null}));
        this.tools = data.tools.map(t => ({...t, pose: unpacked(t.pose, Float32Array)}));
    }

    at(t) {
        const time = this.time, last = time.length - 1;
        let i = 0;
        while (i < last && time[i + 1] <= t) i++;
        const j = Math.min(i + 1, last), f = j > i ? Math.max(0, Math.min((t - time[i]) / (time[j] - time[i]), 1)) : 0;
        const near = f < 0.5 ? i : j;
        const parts = this.parts.map(p => {
            const n = p.rest.length, at = new Float32Array(n), a = p.scale[i] * (1 - f), b = p.scale[j] * f;
            for (let k = 0; k < n; k++) at[k] = p.rest[k] + a * p.step[i * n + k] + b * p.step[j * n + k];
            return {at, level: p.levels ? p.levels.subarray(near * n / 3, (near + 1) * n / 3) : null};
        });
        const tools = this.tools.map(q => {
            const r = q.pose.subarray(12 * near, 12 * near + 9), t3 = [9, 10, 11].map(k => (1 - f) * q.pose[12 * i + k] + f * q.pose[12 * j + k]);
            return {shape: q.shape, radius: q.radius, half: q.half, r, t: t3};
        });
        return {parts, tools};
    }
}

// The body at the cursor, with a slider and a button that lets time pass.
function bodyAt(parent, data, plots, start) {
    make(parent, 'h2', 'The body at the cursor');
    const canvas = make(parent, 'canvas', '', {class: 'body3d', tabindex: 0, role: 'img', 'aria-label': 'The body; drag or arrow keys turn it, plus and minus zoom'});
    let view;
    try {
        view = new BodyView(canvas);
    } catch (error) {
        canvas.replaceWith(make(parent, 'p', 'The body cannot be drawn: ' + error.message + '.', {class: 'note'}));
        return;
    }
    const motion = new Motion(data), row = make(parent, 'div', '', {class: 'screen'});
    row.style.cssText = 'display:grid;grid-template-columns:auto 1fr 160px;gap:10px;align-items:center;margin:4px 0';
    const play = make(row, 'button', 'Play'), slide = make(row, 'input', '', {type: 'range', min: motion.time[0], max: motion.time[motion.time.length - 1], step: 0.001, 'aria-label': 'time'});
    const scale = make(row, 'div'), bar = make(scale, 'div', '', {class: 'scale'}), text = make(scale, 'div', '', {class: 'note'});
    bar.style.background = heatCss();
    view.setParts(motion.parts);
    let most = 1e-3 * view.size;
    motion.parts.forEach(p => p.scale.forEach(s => { most = Math.max(most, s * (p.step instanceof Int8Array ? 127 : 32767)); }));
    view.hold = most;
    text.textContent = '0 to ' + number(+(1e3 * most).toPrecision(2)) + ' mm moved';
    if (motion.parts.some(p => p.levels)) {
        view.mode = 'level';
        bar.remove();
        const last = Math.max(...motion.parts.map(p => p.levels ? p.levels.reduce((a, b) => Math.max(a, b), 0) : 0));
        text.innerHTML = LEVELS.slice(0, last + 1).map((c, i) => '<span style="color:' + c + '">\u25a0</span>\u00a0' + i).join(' ') + ' level at work';
    }
    view.orbit();
    const lean = motion.at(start).tools[0];
    if (lean && lean.t.every(v => Math.abs(v) < 100)) view.yaw = Math.atan2(lean.t[1] - view.centre[1], lean.t[0] - view.centre[0]) + 0.5;
    const show = t => {
        const s = motion.at(t);
        view.update(s.parts, s.tools, null);
        slide.value = t;
    };
    let timer = null;
    play.onclick = () => {
        if (timer) { clearInterval(timer); timer = null; play.textContent = 'Play'; return; }
        play.textContent = 'Stop';
        const began = performance.now(), from = plots.cursor === null || plots.cursor >= +slide.max - 0.01 ? +slide.min : plots.cursor;
        timer = setInterval(() => {
            const t = from + (performance.now() - began) / 1000;
            if (t > +slide.max) return play.onclick();
            plots.set(t);
        }, 33);
    };
    slide.oninput = () => plots.set(+slide.value);
    plots.moved = show;
    show(start);
    return view;
}

function happened(parent, data, plots) {
    if (data.events.length === 0) return;
    make(parent, 'h2', 'What happened');
    const list = make(make(parent, 'div', '', {class: 'wide'}), 'table');
    for (const e of data.events) {
        const row = make(list, 'tr'), at = make(make(row, 'td', '', {class: 'n'}), 'a', number(+e.t.toFixed(4)) + ' s', {href: '#'});
        make(row, 'td', e.text, {class: e.bad ? 'bad' : ''});
        at.onclick = click => { click.preventDefault(); plots.set(e.t); };
    }
    if (data.unmarked > 0) make(parent, 'p', 'and ' + data.unmarked + ' more', {class: 'note'});
}

(() => {
    const data = JSON.parse(document.getElementById('data').textContent), root = document.getElementById('page');
    for (const c of data.charts) for (const s of c.series) {
        s.low = unpacked(s.low, Float32Array);
        s.high = s.high ? unpacked(s.high, Float32Array) : s.low;
    }
    const where = make(root, 'div');
    const curves = make(root, 'div'), plots = new Plots(curves, data.charts, data.events);
    make(curves, 'p', 'Move over a curve for values; drag to pan, turn the wheel to zoom, double click for all of it. Keys: arrows, plus, minus, 0.', {class: 'note screen'});
    // The cursor begins where the first curve of the first chart is largest.
    let start = 0, most = -Infinity;
    const first = data.charts.length > 0 ? data.charts[0].series[0] : null;
    if (first) first.high.forEach((v, i) => { if (v > most) { most = v; start = first.t0 + i * first.dt; } });
    const view = data.motion ? bodyAt(where, data.motion, plots, start) : null;
    if (first && most > 0) plots.set(start);
    happened(root, data, plots);
    if (data.histogram) {
        make(root, 'h2', data.histogram.title);
        const canvas = make(root, 'canvas', '', {class: 'plot', role: 'img', 'aria-label': data.histogram.title});
        canvas.style.height = '170px';
        histogram(canvas, data.histogram, data.histogram.unit);
    }
    window.report = {data, plots, view};
})();
