// SPDX-License-Identifier: MIT
// The web page in a browser: node page.mjs PAGE.html VIEW-ADDRESS BLOB SCENE-LOG OUT, with real pointer events. Prints TAP lines.
import { readFileSync, writeFileSync } from 'node:fs';
import { browser, sleep } from './chromium.mjs';

const [page, served, blob, log, folder] = process.argv.slice(2);
let count = 0;
const ok = (good, text) => console.log(`${good ? 'ok' : 'not ok'} ${++count} - ${text}`);
const b = await browser(folder);
const open = async (address, options) => {
    const p = await b.page(address, options);
    await p.until('(last && body && !opening && view.now !== undefined) || !$("message").hidden', 40000); // opened, and drawn once
    await sleep(300);
    return p;
};
const centre = (p, dx = 0, dy = 0) => p.run(`(() => { const q = view.project(view.centre), r = view.canvas.getBoundingClientRect(); return [q[0] + r.left + ${dx}, q[1] + r.top + ${dy}]; })()`);
const force = p => p.run('parseFloat($("readout").textContent)');
const moved = p => p.run('view.now'); // farthest that a node is moved, m
const lookedAt = async (p, name) => {
    const path = `${folder}/${name}.png`;
    await p.shot(path);
    const bytes = readFileSync(path).length;
    ok(bytes > 20000 && p.said.length === 0, `${name}.png: a picture of ${bytes} bytes, no error in the page${p.said.length ? ': ' + p.said[0] : ''}`);
};

// Pressed, slid, let go; by mouse on a desk.
{
    const p = await open('file://' + page);
    const at = await centre(p, 0, -20);
    await p.drag(at, [at[0] + 15, at[1]], 600);
    await p.until('parseFloat($("readout").textContent) > 0.02');
    await sleep(800);
    const [f, u, first, frame, tick] = [await force(p), await moved(p), await p.run('firstForce'), await p.run('frameMs'), await p.run('1000 * last.ms')];
    ok(f > 0.02 && u > 1e-4, `pressed with the mouse: ${f} N, the surface moves by ${(1e3 * u).toFixed(2)} mm`);
    ok(first > 0, `first force ${(first / 1000).toFixed(2)} s after opening; ${tick.toFixed(0)} us a tick, ${frame.toFixed(1)} ms a frame, drawn by software`);
    const before = await force(p);
    await p.run('(() => { const i = document.querySelectorAll("#controls input[type=range]")[0]; i.value = 12; i.oninput(); })()');
    await sleep(1000);
    ok(await force(p) > 1.2 * before, `deeper: ${before} N, then ${await force(p)} N`);
    await lookedAt(p, 'desk-light');
    await p.mouse('mouseReleased', at[0] + 15, at[1]);
    await p.until('parseFloat($("readout").textContent) === 0');
    ok(true, 'let go: no force');
    ok(p.asked.every(a => a.startsWith('file://') || a.startsWith('blob:')), 'nothing is fetched');
    // A slow controller answers on a coarser level.
    const fine = await p.run('last.news.length, series.level.high.at(-1)');
    await p.run('(() => { const s = [...document.querySelectorAll("#controls select")].find(x => /slower/.test(x.textContent)); s.value = "1"; s.onchange(); })()');
    await p.until('!opening && last && last.serial === serial && series.level.low.length > 50');
    const level = await p.run('[last.look.limit, series.level.high.at(-1), body.rate_hz]');
    ok(level[1] < fine, `four times slower: level ${level[1]} in place of ${fine}, at ${level[2]} Hz`);
    ok(/speed=1/.test(await p.run('location.hash')), 'the address says what was chosen');
    await p.close();
}

// Keys alone.
{
    const p = await open('file://' + page + '#speed=0.25');
    await p.run('view.canvas.focus()');
    for (let i = 0; i < 3; i++) await p.key('ArrowUp');
    await p.key(' ', 'Space');
    await p.until('parseFloat($("readout").textContent) > 0.02');
    ok(true, `pressed with the space bar: ${await force(p)} N`);
    await p.close();
}

// Pulled.
{
    const p = await open('file://' + page + '#mode=pull');
    const at = await centre(p, 0, -60);
    await p.drag(at, [at[0] + 60, at[1]], 500);
    await p.until('last.look.pulled && parseFloat($("readout").textContent) > 0.02');
    ok(await moved(p) > 5e-3, `pulled: ${await force(p)} N hold a place ${(1e3 * await moved(p)).toFixed(1)} mm off`);
    await p.close();
}

// A finger on a phone, in the dark.
{
    const p = await open('file://' + page, {width: 390, height: 780, mobile: true, dark: true});
    const at = await centre(p);
    await p.touch('touchStart', [at]);
    await p.until('parseFloat($("readout").textContent) > 0.02');
    ok(await p.run('document.documentElement.scrollWidth <= 390'), `touched on a phone: ${await force(p)} N, nothing is wider than its screen`);
    await lookedAt(p, 'phone-dark');
    await p.touch('touchEnd', []);
    await p.close();
}

// A scripted press, tick by tick, recorded.
{
    const p = await open('file://' + page);
    await p.run(`(async () => { recording = true; reopen(); })()`);
    await p.until('!opening && last && last.serial === serial');
    const path = await p.run(`(() => { const t = last.look.tools[0], z = [t.r[2], t.r[5], t.r[8]], path = [];
        for (let i = 0; i < 1500; i++) { const q = 0.028 * Math.min(1, i / 700); path.push([0, 1, 2].map(k => t.t[k] - q * z[k])); }
        return path; })()`);
    await p.run(`worker.postMessage({do: 'run', path: ${JSON.stringify(path)}})`);
    const ran = await p.until('window.ran');
    await p.run(`(() => { heard.log = m => { let s = ''; for (const c of m.bytes) s += String.fromCharCode(c); window.logged = btoa(s); }; worker.postMessage({do: 'stoplog'}); })()`);
    writeFileSync(folder + '/page.log', Buffer.from(await p.until('window.logged'), 'base64'));
    writeFileSync(folder + '/page.digest', ran.digest + '\n');
    ok(ran.ticks >= 1500, `a scripted press of 1,500 ticks, recorded: digest ${ran.digest}`);
    await p.close();
}

// Files dropped on it: a blob, a bad one, a log, a mesh as a tool.
{
    const p = await open('file://' + page);
    await p.drop([['own.palp', readFileSync(blob)]]);
    await p.until('own === "own.palp" && !opening && last && last.serial === serial');
    const nodes = await p.run('view.parts[0].n');
    const at = await centre(p);
    await p.drag(at, at, 200);
    await p.until('parseFloat($("readout").textContent) > 0.005');
    ok(true, `a blob dropped on it, of ${nodes} nodes, is felt: ${await force(p)} N`);
    await p.mouse('mouseReleased', ...at);
    const bad = Buffer.from(readFileSync(blob));
    bad[bad.length >> 1] ^= 1;
    await p.drop([['bad.palp', bad]]);
    const said = await p.until('!$("message").hidden && $("message").textContent');
    ok(/damaged|CRC/i.test(said) && await p.run('!!last'), `a damaged blob: "${said.replace(/Close$/, '').trim()}"`);
    await p.drop([['own.palp', readFileSync(blob)], ['run.log', readFileSync(log)]]);
    const end = await p.until('replaying === "ended" && $("message").textContent', 60000);
    ok(/bit for bit/.test(end), `a log dropped with its blob: ${end.split('.')[0]}`);
    await p.run('[...$("message").querySelectorAll("button")].at(-1).click()');
    await p.until('!replaying && !opening');
    await p.drop([['cube.stl', Buffer.from(cube(0.006))]]);
    await p.until('/what is it/.test($("message").textContent)');
    await p.run('[...$("message").querySelectorAll("button")].find(b => /tool/.test(b.textContent)).click()');
    await p.until('state.tool === "own" && !opening && last && last.look.tools[0].shape === 3', 60000);
    ok(true, 'a mesh dropped on it is made a tool, and held');
    ok(p.said.length === 0, `no error in the page${p.said.length ? ': ' + p.said[0] : ''}`);
    await p.close();
}

// What palp view serves.
{
    const p = await open(served);
    const name = await p.until('own || replaying');
    ok(!!name && p.asked.every(a => a.startsWith(served) || a.startsWith('blob:')), `palp view: ${name}, all of it from 127.0.0.1`);
    await p.close();
}

// A browser without WebGL2, one without WebAssembly.
for (const [gone, what] of [["HTMLCanvasElement.prototype.getContext = () => null", 'WebGL2'], ["window.WebAssembly = undefined", 'WebAssembly']]) {
    const p = await b.page('about:blank');
    const text = readFileSync(page, 'utf8').replace('<script>start();</script>', `<script>${gone}; start();</script>`);
    writeFileSync(`${folder}/without.html`, text);
    const q = await b.page(`file://${folder}/without.html`);
    const said = await q.until('!$("message").hidden && $("message").textContent');
    ok(said.includes(what), `without ${what}: "${said.slice(0, 90)}"`);
    await q.close();
    await p.close();
}

function cube(h) {
    const corner = i => [(i & 1 ? h : -h), (i & 2 ? h : -h), (i & 4 ? h : -h)].join(' ');
    const faces = [[0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6], [0, 1, 4], [1, 5, 4], [2, 6, 3], [3, 6, 7], [0, 4, 2], [2, 4, 6], [1, 3, 5], [3, 7, 5]];
    return 'solid cube\n' + faces.map(f => ' facet normal 0 0 0\n outer loop\n' + f.map(i => '  vertex ' + corner(i) + '\n').join('') + ' endloop\n endfacet\n').join('') + 'endsolid cube\n';
}

await b.close();
