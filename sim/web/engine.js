// SPDX-License-Identifier: MIT
// The engine (engine.h) as the page's worker and the tests use it: class Engine.
'use strict';

const MEASURES = ['time_s', 'force_N', 'force_x', 'force_y', 'force_z', 'stored_mJ', 'absorbed_mJ', 'given_mJ', 'level',
    'active', 'bound_us', 'depth_mm'];
const HISTORY = 4096;
const NUMBER = {ticks: 0, limit: 1, points: 2, flags: 3, state: 4, joints: 5, bodies: 6, kind: 7, rate_hz: 8, scale: 9, tools: 10,
    hands: 11, edge_m: 12, pulled: 13, held: 14};
const NUMBER_TOOL = 16, NUMBER_JOINT = 48, TOOL_NUMBERS = 15;
const PART = {at: 0, rest: 1, pressure: 2, triangles: 3, fixed: 4};
const TEXT = {state: 0, faults: 1, joint: 2, digest: 3};
const ENDS = ['', 'done', 'cut', 'gap', 'exchanged', 'differs'];

class Engine {
    // Of a compiled module, on files; say(line) gets what the program says while it works.
    static async start(module, files, say) {
        const e = new Engine();
        e.system = new WasiSystem(files, say);
        const instance = await WebAssembly.instantiate(module, e.system.imports);
        e.system.instance = instance;
        e.x = instance.exports;
        e.files = files;
        e.x._initialize();
        e.shown = 0; // ticks whose measures were handed out
        e.ticks = 0;
        return e;
    }

    put(text) {
        const bytes = new TextEncoder().encode(text + '\0'), at = this.x.malloc(bytes.length);
        new Uint8Array(this.x.memory.buffer).set(bytes, at);
        return at;
    }

    // palp's command with these arguments; throws WasiExit where that ends the program.
    command(list) { return this.x.engine_command(this.put(list.join('\n'))); }

    open(scene, nsPerInstruction) {
        this.files.set('/page.scene', new TextEncoder().encode(scene));
        this.x.engine_open(nsPerInstruction);
    }

    replay(scene) {
        this.files.set('/page.scene', new TextEncoder().encode(scene));
        this.x.engine_replay();
    }

    tick(n) {
        const done = this.x.engine_tick(n);
        this.ticks += done;
        return done;
    }

    text(what, which = 0) {
        const bytes = new Uint8Array(this.x.memory.buffer), at = this.x.engine_text(TEXT[what], which);
        let end = at;
        while (bytes[end] !== 0) end++;
        return new TextDecoder().decode(bytes.slice(at, end));
    }

    numbers() { return new Float32Array(this.x.memory.buffer, this.x.engine_numbers(), 64).slice(); }
    number(name) { return this.numbers()[NUMBER[name]]; }
    end() { return ENDS[this.x.engine_ended()]; }

    // Measures of the ticks since the last call, a row of MEASURES.length each; the oldest may be gone.
    news() {
        const n = Math.min(this.ticks - this.shown, HISTORY), wide = MEASURES.length;
        const all = new Float32Array(this.x.memory.buffer, this.x.engine_history(), HISTORY * wide), out = new Float32Array(n * wide);
        for (let i = 0; i < n; i++) {
            const row = (this.ticks - n + i) % HISTORY;
            out.set(all.subarray(row * wide, (row + 1) * wide), i * wide);
        }
        this.shown = this.ticks;
        return out;
    }

    part(number, what) {
        const n = this.x.engine_part_count(number, PART[what]), at = this.x.engine_part_data(number, PART[what]);
        const buffer = this.x.memory.buffer;
        if (what === 'triangles') return new Uint32Array(buffer, at, 3 * n).slice();
        if (what === 'fixed') return new Uint8Array(buffer, at, n).slice();
        return new Float32Array(buffer, at, what === 'pressure' ? n : 3 * n).slice();
    }

    // What does not change: surfaces, tools, joints.
    describe() {
        const n = this.numbers(), parts = [], joints = [];
        for (let i = 0; i < this.x.engine_parts(); i++)
            parts.push({triangles: this.part(i, 'triangles'), rest: this.part(i, 'rest'), fixed: this.part(i, 'fixed')});
        for (let j = 0; j < n[NUMBER.joints]; j++)
            joints.push({name: this.text('joint', j), low: n[NUMBER_JOINT + 2 * j], high: n[NUMBER_JOINT + 2 * j + 1]});
        return {parts, joints, kind: n[NUMBER.kind], rate_hz: n[NUMBER.rate_hz], scale: n[NUMBER.scale], edge_m: n[NUMBER.edge_m],
            hands: n[NUMBER.hands]};
    }

    // What does: one frame of the display.
    look() {
        this.x.engine_look();
        const n = this.numbers(), parts = [], tools = [], count = this.x.engine_points();
        for (let i = 0; i < this.x.engine_parts(); i++) {
            const p = {at: this.part(i, 'at'), pressure: this.part(i, 'pressure')};
            if (n[NUMBER.joints] > 0) p.rest = this.part(i, 'rest'); // joints move it
            parts.push(p);
        }
        for (let t = 0; t < Math.min(n[NUMBER.tools], 2); t++) {
            const at = NUMBER_TOOL + TOOL_NUMBERS * t;
            tools.push({shape: n[at], radius: n[at + 1], half: n[at + 2], r: n.slice(at + 3, at + 12), t: n.slice(at + 12, at + 15)});
        }
        const points = new Float32Array(this.x.memory.buffer, this.x.engine_point_data(), 6 * count).slice();
        return {parts, tools, points, ticks: n[NUMBER.ticks], limit: n[NUMBER.limit], wanted: n[NUMBER.points], flags: n[NUMBER.flags],
            held: n[NUMBER.held], pulled: n[NUMBER.pulled], state: this.text('state'), faults: this.text('faults'), end: this.end()};
    }
}
