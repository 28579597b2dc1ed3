// SPDX-License-Identifier: MIT
// The card of a blob: its body, coloured by how stiff it is where. Its data is JSON in the page (card.c).
'use strict';

(() => {
    const take = (text, Kind) => new Kind(Uint8Array.from(atob(text), c => c.charCodeAt(0)).buffer);
    const data = JSON.parse(document.getElementById('data').textContent), root = document.getElementById('body');
    const parts = data.parts.map(p => ({triangles: take(p.triangles, Uint32Array), rest: take(p.rest, Float32Array), fixed: take(p.fixed, Uint8Array),
        stiffness: p.value ? take(p.value, Float32Array) : null}));
    const canvas = document.createElement('canvas');
    Object.assign(canvas, {className: 'body3d', tabIndex: 0});
    canvas.setAttribute('role', 'img');
    canvas.setAttribute('aria-label', 'The body; drag or arrow keys turn it, plus and minus zoom');
    root.append(canvas);
    let view;
    try {
        view = new BodyView(canvas);
    } catch (error) {
        root.textContent = 'The body cannot be drawn: ' + error.message + '.';
        return;
    }
    view.setParts(parts);
    view.orbit();
    const known = parts.flatMap(p => p.stiffness ? [...p.stiffness].filter(v => v > 0) : []);
    const note = document.createElement('p');
    note.className = 'note';
    root.append(note);
    if (known.length === 0) {
        view.mode = 'plain';
        note.textContent = 'Darker: held. How stiff it is where is not known of a body that moves.';
    } else {
        // Colours by the logarithm: nodes differ by orders of magnitude.
        let low = Infinity, high = 0;
        for (const v of known) { low = Math.min(low, v); high = Math.max(high, v); }
        document.getElementById('title').textContent = 'How stiff it is where';
        view.mode = 'value';
        view.parts.forEach((p, i) => {
            p.share = parts[i].stiffness ? parts[i].stiffness.map(v => v > 0 ? Math.log(v / low) / Math.log(high / low || 1) : 1) : null;
        });
        const bar = document.createElement('div');
        bar.className = 'scale';
        bar.style.background = heatCss();
        note.before(bar);
        note.textContent = number(+low.toPrecision(3)) + ' to ' + number(+high.toPrecision(3)) + ' N/m along the normal, by its logarithm; dark: held';
        const grid = document.createElement('p');
        grid.className = 'note';
        note.after(grid);
        canvas.addEventListener('pointermove', e => {
            const box = canvas.getBoundingClientRect(), hit = view.pick(view.ray(e.clientX - box.left, e.clientY - box.top), true);
            grid.textContent = hit && parts[hit.part].stiffness ? 'node ' + hit.node + (parts[hit.part].fixed[hit.node] ? ': held' : ': ' + number(+parts[hit.part].stiffness[hit.node].toPrecision(4)) + ' N/m') +
                ' at ' + [0, 1, 2].map(k => number(+(1000 * parts[hit.part].rest[3 * hit.node + k]).toFixed(2))).join(', ') + ' mm' : '\u00a0';
        });
        grid.textContent = '\u00a0';
    }
    view.draw();
    window.card = {view, parts};
})();
