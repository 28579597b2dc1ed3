// SPDX-License-Identifier: MIT
// Takes README's pictures: node pictures.mjs PAGE.html FOLDER-WITH-REPORTS OUT-FOLDER (make pictures).
import { readFileSync, writeFileSync, mkdirSync } from 'node:fs';
import { browser, sleep } from './chromium.mjs';

const [page, reports, out] = process.argv.slice(2);
mkdirSync(out, {recursive: true});
const b = await browser(reports);
const box = (p, query) => p.run(`(() => { const r = document.querySelector('${query}').getBoundingClientRect(); return {x: r.left + scrollX, y: r.top + scrollY, width: r.width, height: r.height, scale: 1}; })()`);

async function press(options, tune, ms) {
    const p = await b.page('file://' + page + options, {width: 1120, height: 640});
    await p.until('!!(last && body)');
    if (tune) await p.run(tune);
    const at = await p.run('(() => { const q = view.project([0.024, -0.03, 0.1]), r = view.canvas.getBoundingClientRect(); return [q[0] + r.left, q[1] + r.top]; })()');
    await p.drag(at, [at[0] + 4, at[1]], 400);
    await sleep(ms);
    return p;
}

// The page, a body pressed on it.
{
    const p = await press('#depth=14&colour=moved', 'view.yaw = -1.25, view.draw()', 2500);
    await p.shot(`${out}/page.png`);
    await p.close();
}

// The same press on three levels.
{
    const parts = [];
    for (const level of [3, 2, 0]) {
        const p = await press(`#depth=12&level=${level}&colour=pressure`, 'view.yaw = -0.75, view.pitch = 0.15, view.distance *= 0.5, view.centre = [0.015, -0.012, 0.1], document.head.insertAdjacentHTML("beforeend", "<style>#modes, #readout, #legend { display: none }</style>"), view.draw()', 3000);
        const text = await p.run('[series.level.high.at(-1), last.look.points.length / 6, parseFloat($("readout").textContent), last.news.length > 0 ? last.news.at(-2) : 0]');
        await p.shot(`${out}/level.png`, await box(p, '#view'));
        parts.push(`<figure><img src="data:image/png;base64,${readFileSync(`${out}/level.png`).toString('base64')}"><figcaption>level ${text[0]}: ${text[1]} points carry ${text[2].toFixed(2)} N<br>bound of a tick ${text[3].toFixed(0)} us</figcaption></figure>`);
        await p.close();
    }
    writeFileSync(`${reports}/levels.html`, `<style>body{margin:0;display:flex;font:17px system-ui;background:#fdfcfa;color:#1f2328}figure{margin:8px;width:360px}img{width:360px;height:270px;object-fit:cover;border-radius:4px}</style>${parts.join('')}`);
    const q = await b.page(`file://${reports}/levels.html`, {width: 1136, height: 350});
    await sleep(500);
    await q.shot(`${out}/level.png`);
    await q.close();
}

// What ticks took against what they could take at most.
{
    const p = await b.page(`file://${reports}/run.html`, {width: 1000, height: 1200});
    await p.until('window.report');
    await p.run('report.plots.set(2.9)');
    await sleep(500);
    const charts = await p.run(`(() => { const c = report.plots.charts, of = t => c.find(x => x.title === t), top = of('Latency').canvas.previousSibling.getBoundingClientRect(), end = of('Latency').key.getBoundingClientRect();
        return {x: top.left - 8 + scrollX, y: top.top - 14 + scrollY, width: top.width + 16, height: end.bottom - top.top + 12, scale: 1}; })()`);
    await p.shot(`${out}/bound.png`, charts);
    await p.close();
}

// The finger that closes on a rod.
{
    const p = await b.page(`file://${reports}/finger.html`, {width: 1000, height: 900});
    await p.until('window.report');
    await p.run('report.view.yaw = -1.3, report.view.pitch = 0.25, report.view.distance *= 0.85, report.plots.set(3.0)');
    await sleep(800);
    const at = await box(p, '.body3d');
    await p.shot(`${out}/finger.png`, {...at, x: at.x + 180, width: at.width - 400, y: at.y + 60, height: at.height - 80});
    await p.close();
}
await b.close();
