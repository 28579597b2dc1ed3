// SPDX-License-Identifier: MIT
// Runs the engine in a thread of its own, at the rate of its scene, in step with the clock as far as this machine keeps up.
// Takes {do, ..} and answers {is, ..}: opened, frame, failed, log, file, said.
'use strict';

const SLICE_MS = 8, MOST_BEHIND_S = 0.1, START_S = 0.5;
let module = null, engine = null, paused = false, drawn = true, begun = 0, done = 0, pulls = null, serial = 0;
let spent = 0, counted = 0; // ms for so many ticks, since the last frame

function fail(error, doing) {
    const text = error instanceof WasiExit ? error.message : 'the engine stopped: ' + error.message;
    postMessage({is: 'failed', doing, text: text.replace(/^palpd?: /gm, '').replace(/(^|\s)\/(?=[\w.]+)/g, '$1'), serial});
}

const answers = {
    async module(m) { module = await WebAssembly.compile(m.bytes); },

    // A scene, or with `log` a session, on files; the one before goes on where this one does not open.
    async open(m) {
        const files = new Map(m.files);
        try {
            const next = await Engine.start(module, files, line => postMessage({is: 'said', line}));
            if (m.log) next.replay(m.scene);
            else next.open(m.scene, m.ns);
            if (m.record) next.x.engine_log();
            engine = next;
            serial = m.serial;
            pulls = null;
            paused = false;
            if (!m.log) engine.tick(Math.round(START_S * engine.number('rate_hz')));
            begin();
            postMessage({is: 'opened', serial, log: !!m.log, ...engine.describe()});
            frame();
        } catch (error) {
            serial = m.serial;
            fail(error, 'open');
        }
    },

    reach(m) { if (engine) engine.x.engine_reach(m.device, ...m.at, m.grip || 0); },
    pull(m) { pulls = {...m, moved: true}; },
    letgo() { pulls = null; if (engine) engine.x.engine_let_go(); },
    joint(m) { if (engine) engine.x.engine_joint(m.joint, m.value); },
    reset() { if (engine) engine.x.engine_reset(); },
    pause(m) { paused = m.on; begin(); },
    drawn() { drawn = true; },

    // Exactly so many ticks, for tests and scripts, each with its own place to reach.
    run(m) {
        paused = true;
        for (const at of m.path) {
            engine.x.engine_reach(0, ...at, 0);
            engine.tick(1);
        }
        frame();
        postMessage({is: 'ran', digest: engine.text('digest'), ticks: engine.ticks});
    },

    stoplog() {
        engine.x.engine_stop_log();
        postMessage({is: 'log', bytes: engine.files.get('/page.log').slice()});
    },

    // A command of palp, on files; answers with the file that it makes.
    async command(m) {
        const files = new Map(m.files);
        try {
            const e = await Engine.start(module, files, line => postMessage({is: 'said', line}));
            const code = e.command(m.list);
            if (code !== 0) throw new WasiExit(code, e.system.message);
            postMessage({is: 'file', bytes: files.get(m.makes).slice(), as: m.as, name: m.name});
        } catch (error) {
            fail(error, 'command');
        }
    },
};

// One after the other: an engine that starts later must not be ready before an earlier one.
let turn = Promise.resolve();
onmessage = e => {
    turn = turn.then(() => answers[e.data.do](e.data)).catch(error => fail(error, e.data.do));
};

function begin() { begun = performance.now(); done = 0; }

function frame() {
    drawn = false;
    const look = engine.look(), news = engine.news(), ms = counted > 0 ? spent / counted : 0;
    spent = counted = 0;
    const moved = [news.buffer, look.points.buffer, ...look.parts.flatMap(p => [p.at.buffer, p.pressure.buffer])];
    postMessage({is: 'frame', serial, look, news, ms, paused}, moved);
}

setInterval(() => {
    if (!engine || !module) return;
    try {
        const now = performance.now(), rate = engine.number('rate_hz');
        let due = Math.floor((now - begun) * 1e-3 * rate) - done;
        if (due > MOST_BEHIND_S * rate) { begin(); due = MOST_BEHIND_S * rate; } // slower than the clock: virtual time waits
        if (!paused && due > 0) {
            const start = performance.now();
            let n = 0;
            while (n < due && performance.now() - start < 3 * SLICE_MS) n += engine.tick(Math.min(4, due - n)) || due;
            spent += performance.now() - start;
            counted += Math.min(n, due);
            done += n;
        }
        if (pulls && pulls.moved) engine.x.engine_pull(pulls.node, ...pulls.by);
        if (pulls) pulls.moved = false;
        if (drawn && (!paused || pulls)) frame();
    } catch (error) {
        engine = null;
        fail(error, 'tick');
    }
}, SLICE_MS);
