// SPDX-License-Identifier: MIT
// What is shown of a frame, and what can be switched.
'use strict';

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
    if (replaying && l.end) ended(l.end);
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
    const box = $('controls');
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
        const root = document.documentElement, dark = matchMedia('(prefers-color-scheme: dark)').matches;
        root.dataset.theme = (root.dataset.theme || (dark ? 'dark' : 'light')) === 'dark' ? 'light' : 'dark';
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

