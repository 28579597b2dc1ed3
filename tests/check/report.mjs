// SPDX-License-Identifier: MIT
// A report in a browser against the session that it shows: node report.mjs REPORT.html TICKS.csv FOLDER. TICKS.csv is of palp export.
import { readFileSync, statSync } from 'node:fs';
import { browser, sleep } from './chromium.mjs';

const [page, table, folder] = process.argv.slice(2);
let count = 0;
const ok = (good, text) => console.log(`${good ? 'ok' : 'not ok'} ${++count} - ${text}`);
const lines = readFileSync(table, 'utf8').trim().split('\n').map(l => l.split(',')), head = lines.shift();
const column = name => lines.map(l => Number(l[head.indexOf(name)]));
const extremes = x => x.reduce(([a, b], v) => [Math.min(a, v), Math.max(b, v)], [Infinity, -Infinity]);

const b = await browser(folder), p = await b.page('file://' + page, {width: 1100, height: 1500});
await p.until('window.report && document.readyState === "complete"');
const ready = await p.run('performance.timing.loadEventEnd - performance.timing.navigationStart');
const bytes = statSync(page).size, ticks = lines.length;
ok(bytes <= 3e6, `a report of ${ticks} ticks: ${(bytes / 1e6).toFixed(2)} MB`);
ok(ready < 5000, `open after ${ready} ms`);
const shown = await p.run(`report.data.charts.map(c => [c.title, c.series.map(s => [s.name, s.low.length, s.low.reduce((a, v) => Math.min(a, v), Infinity), s.high.reduce((a, v) => Math.max(a, v), -Infinity)])])`);
const series = (chart, name) => shown.find(c => c[0] === chart)[1].find(s => s[0] === name);
for (const [chart, name, of, times] of [['Force on the hand', 'z', 'fz', 1], ['Place of the tip', 'z', 'z', 1e3], ['Energy', 'stored in body and coupling', 'stored_J', 1e3], ['Level of contact', 'level', 'level', 1],
    ['Latency', 'tick', 'tick_us', 1], ['Contact points', 'in contact', 'active', 1]]) {
    const [, buckets, low, high] = series(chart, name), [a, z] = extremes(column(of)).map(v => v * times);
    const same = (u, v) => Math.abs(u - v) <= 1e-5 * Math.max(Math.abs(u), Math.abs(v), 1e-6);
    ok(same(low, a) && same(high, z), `${chart}, ${name}: from ${a.toPrecision(4)} to ${z.toPrecision(4)} in ${ticks} ticks, kept in ${buckets} buckets`);
}
const box = await p.run('(() => { const r = report.plots.charts[0].canvas.getBoundingClientRect(); return [r.left, r.top + scrollY, r.width, r.height]; })()');
await p.run(`scrollTo(0, ${box[1]} - 40)`);
await p.mouse('mouseMoved', box[0] + box[2] / 2, 60, false);
await p.until('report.plots.cursor !== null && /N/.test(report.plots.charts[0].key.textContent) && /mm/.test(report.plots.charts[1].key.textContent)');
ok(true, `one cursor over all curves: ${await p.run('report.plots.charts[0].key.textContent')}`);
const before = await p.run('report.plots.to - report.plots.from');
await p.run('report.plots.charts[0].canvas.focus()');
for (let i = 0; i < 4; i++) await p.key('+', 'Equal');
ok(await p.run('report.plots.to - report.plots.from') < 0.6 * before, 'plus zooms');
await p.run(`(() => { const s = report.plots.charts[0].series[0]; s.name = '<b id="markup">force</b>'; report.plots.set(report.plots.cursor + 0.001); })()`);
await sleep(300);
ok(await p.run('!document.getElementById("markup") && report.plots.charts[0].key.textContent.includes("<b id")'), 'a name is text, never markup');
ok(await p.run('!!document.querySelector(".body3d")'), 'the body is there, at the cursor');
await sleep(300);
await p.shot(`${folder}/report.png`);
ok(readFileSync(`${folder}/report.png`).length > 20000 && p.said.length === 0, `report.png, no error in the page${p.said.length ? ': ' + p.said[0] : ''}`);
ok(p.asked.every(a => a.startsWith('file://')), 'nothing is fetched');
await p.close();
for (const [name, options] of [['phone', {width: 390, height: 800, mobile: true}], ['dark', {width: 1100, height: 1200, dark: true}]]) {
    const q = await b.page('file://' + page, options);
    await q.until('window.report');
    await sleep(500);
    ok(await q.run('document.documentElement.scrollWidth <= innerWidth') && q.said.length === 0, `${name}: nothing is wider than the screen`);
    await q.shot(`${folder}/report-${name}.png`);
    await q.close();
}
await b.close();
