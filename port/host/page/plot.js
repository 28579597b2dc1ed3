// SPDX-License-Identifier: MIT
// Curves over time with one cursor: class Plots. A series is {name, unit, t0, dt, low, high, step}: values of buckets of
// dt seconds from t0 on, the least and the most of each (the same array where a bucket is a sample), so that however far
// away it is looked at nothing that sticks out is lost.
'use strict';

const NICE = [1, 2, 2.5, 5, 10];

// A round step that cuts `span` into at most `most` parts.
function roundStep(span, most) {
    const raw = span / Math.max(most, 1), ten = Math.pow(10, Math.floor(Math.log10(raw)));
    return ten * NICE.find(n => n * ten >= raw * (1 - 1e-9));
}

function number(v) {
    if (v === 0) return '0';
    const a = Math.abs(v);
    return a >= 1e5 || a < 1e-3 ? v.toExponential(2) : String(+v.toPrecision(4));
}

function cssColour(name) { return getComputedStyle(document.documentElement).getPropertyValue(name).trim(); }

class Plots {
    // element: where they go; charts: [{title, word, unit, series, height, zero, whole}]:
    // zero: it is always in sight; whole: values are whole numbers; events: [{t, text, bad}];
    // moved(t): called when the cursor moves.
    constructor(element, charts, events, moved) {
        this.charts = charts;
        this.events = events || [];
        this.moved = moved || (() => {});
        this.cursor = null;
        this.pending = false;
        for (const c of charts) this.build(element, c);
        this.all();
        new ResizeObserver(() => this.draw()).observe(element);
        matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => this.draw());
        addEventListener('beforeprint', () => this.paint());
    }

    build(element, c) {
        const head = document.createElement('h2'), title = document.createElement('span');
        title.textContent = c.title + (c.unit ? ', ' + c.unit : '');
        if (c.word) { title.title = c.word; title.dataset.word = ''; title.tabIndex = 0; }
        head.append(title);
        c.canvas = document.createElement('canvas');
        c.canvas.className = 'plot';
        c.canvas.tabIndex = 0;
        c.canvas.style.height = (c.height || 170) + 'px';
        c.canvas.setAttribute('role', 'img');
        c.canvas.setAttribute('aria-label', c.title + ' over time; arrow keys move the cursor, plus and minus zoom, 0 shows all');
        c.key = document.createElement('div');
        c.key.className = 'key';
        c.key.setAttribute('aria-live', 'off');
        element.append(head, c.canvas, c.key);
        this.listen(c.canvas);
    }

    range() {
        let low = Infinity, high = -Infinity;
        for (const c of this.charts) for (const s of c.series) {
            low = Math.min(low, s.t0);
            high = Math.max(high, s.t0 + s.dt * Math.max(s.low.length - 1, 1));
        }
        return low < high ? [low, high] : [0, 1];
    }

    all() { [this.from, this.to] = this.range(); this.draw(); }

    zoom(t, factor) {
        const [low, high] = this.range(), span = Math.max((this.to - this.from) * factor, 1e-3);
        const share = (t - this.from) / (this.to - this.from);
        this.show(t - share * span, Math.min(span, high - low));
    }

    show(from, span) {
        const [low, high] = this.range();
        this.from = Math.max(low, Math.min(from, high - span));
        this.to = this.from + span;
        this.draw();
    }

    set(t) { this.cursor = t; this.draw(); this.moved(t); }

    time(canvas, x) {
        const box = canvas.getBoundingClientRect();
        return this.from + (x - box.left - this.left) / (box.width - this.left - 8) * (this.to - this.from);
    }

    listen(canvas) {
        const down = new Map();
        let grip = null;
        canvas.addEventListener('pointerdown', e => {
            down.set(e.pointerId, e.clientX);
            canvas.setPointerCapture(e.pointerId);
            grip = {x: e.clientX, from: this.from};
        });
        canvas.addEventListener('pointermove', e => {
            const width = canvas.clientWidth - this.left - 8, span = this.to - this.from;
            if (down.size === 2 && down.has(e.pointerId)) {
                const old = [...down.values()];
                down.set(e.pointerId, e.clientX);
                const now = [...down.values()], apart = Math.abs(now[0] - now[1]) || 1;
                this.zoom(this.time(canvas, (now[0] + now[1]) / 2), Math.abs(old[0] - old[1]) / apart);
            } else if (down.size === 1 && e.pointerType === 'mouse' && Math.abs(e.clientX - grip.x) > 3) {
                this.show(grip.from - (e.clientX - grip.x) / width * span, span);
            } else {
                this.set(this.time(canvas, e.clientX));
            }
        });
        const up = e => down.delete(e.pointerId);
        canvas.addEventListener('pointerup', up);
        canvas.addEventListener('pointercancel', up);
        canvas.addEventListener('wheel', e => {
            e.preventDefault();
            this.zoom(this.time(canvas, e.clientX), e.deltaY > 0 ? 1.25 : 0.8);
        }, {passive: false});
        canvas.addEventListener('dblclick', () => this.all());
        canvas.addEventListener('keydown', e => {
            const span = this.to - this.from, t = this.cursor === null ? (this.from + this.to) / 2 : this.cursor;
            const step = span / (e.shiftKey ? 20 : 200);
            if (e.key === 'ArrowLeft' || e.key === 'ArrowRight') this.set(t + (e.key === 'ArrowLeft' ? -step : step));
            else if (e.key === '+' || e.key === '=') this.zoom(t, 0.8);
            else if (e.key === '-') this.zoom(t, 1.25);
            else if (e.key === '0') this.all();
            else return;
            if (this.cursor !== null && (this.cursor < this.from || this.cursor > this.to)) this.show(this.cursor - span / 2, span);
            e.preventDefault();
        });
    }

    draw() {
        if (this.pending) return;
        this.pending = true;
        requestAnimationFrame(() => { this.pending = false; this.paint(); });
    }

    paint() { for (const c of this.charts) this.paintChart(c); }

    // First and last bucket of a series that is in sight.
    inSight(s, from, to) {
        const last = s.low.length - 1;
        return [Math.max(0, Math.floor((from - s.t0) / s.dt)), Math.min(last, Math.ceil((to - s.t0) / s.dt))];
    }

    limits(c) {
        const zero = c.whole || c.zero;
        let low = zero ? 0 : Infinity, high = zero ? 0 : -Infinity;
        for (const s of c.series) {
            const [a, b] = this.inSight(s, this.from, this.to);
            for (let i = a; i <= b; i++) {
                if (s.low[i] < low) low = s.low[i];
                if (s.high[i] > high) high = s.high[i];
            }
        }
        if (!(low <= high)) return [0, 1];
        if (low === high) return low === 0 ? [0, 1] : [Math.min(low, 0), Math.max(low, 0)];
        const room = 0.04 * (high - low);
        return [low < 0 || low > room ? low - room : 0, high + room];
    }

    paintChart(c) {
        const ratio = devicePixelRatio || 1, w = c.canvas.clientWidth, h = c.canvas.clientHeight;
        if (w === 0) return;
        c.canvas.width = Math.round(w * ratio);
        c.canvas.height = Math.round(h * ratio);
        const g = c.canvas.getContext('2d'), left = this.left = 56, right = w - 8, top = 8, bottom = h - 22;
        g.scale(ratio, ratio);
        g.font = '12px system-ui, sans-serif';
        const [low, high] = this.limits(c);
        const x = t => left + (t - this.from) / (this.to - this.from) * (right - left);
        const y = v => bottom - (v - low) / (high - low) * (bottom - top);
        this.axes(g, {left, right, top, bottom, low, high, x, y, whole: c.whole});
        g.save();
        g.beginPath();
        g.rect(left, top - 4, right - left, bottom - top + 8);
        g.clip();
        this.labelled = left; // up to where a label stands
        for (const e of this.events) this.mark(g, e, x, top, bottom);
        c.series.forEach((s, i) => this.curve(g, s, i, x, y, right - left));
        g.restore();
        if (this.cursor !== null && this.cursor >= this.from && this.cursor <= this.to) {
            g.strokeStyle = cssColour('--accent');
            g.beginPath();
            g.moveTo(x(this.cursor), top);
            g.lineTo(x(this.cursor), bottom);
            g.stroke();
        }
        this.legend(c);
    }

    axes(g, a) {
        g.strokeStyle = cssColour('--grid');
        g.fillStyle = cssColour('--quiet');
        g.textAlign = 'right';
        g.textBaseline = 'middle';
        let step = roundStep(a.high - a.low, (a.bottom - a.top) / 28);
        if (a.whole) step = Math.max(1, Math.round(step));
        for (let k = Math.ceil(a.low / step - 1e-6); k * step <= a.high * (1 + 1e-9) + 1e-12; k++) {
            g.beginPath();
            g.moveTo(a.left, a.y(k * step));
            g.lineTo(a.right, a.y(k * step));
            g.stroke();
            g.fillText(number(k * step), a.left - 6, a.y(k * step));
        }
        const dt = roundStep(this.to - this.from, (a.right - a.left) / 80);
        g.textAlign = 'center';
        g.textBaseline = 'top';
        for (let k = Math.ceil(this.from / dt - 1e-6); k * dt <= this.to + 1e-9; k++) {
            const at = a.x(k * dt);
            g.beginPath();
            g.moveTo(at, a.bottom);
            g.lineTo(at, a.bottom + 4);
            g.stroke();
            g.fillText(number(k * dt) + ' s', Math.min(at, a.right - 12), a.bottom + 6);
        }
    }

    mark(g, e, x, top, bottom) {
        if (e.t < this.from || e.t > this.to) return;
        g.strokeStyle = cssColour(e.bad ? '--warn' : '--quiet');
        g.setLineDash([3, 3]);
        g.beginPath();
        g.moveTo(x(e.t), top);
        g.lineTo(x(e.t), bottom);
        g.stroke();
        g.setLineDash([]);
        g.fillStyle = g.strokeStyle;
        g.textAlign = 'left';
        g.textBaseline = 'top';
        if (x(e.t) < this.labelled) return;
        g.fillText(e.text, x(e.t) + 3, top);
        this.labelled = x(e.t) + 8 + g.measureText(e.text).width;
    }

    // A column of pixels gets the least and the most of what falls into it.
    curve(g, s, index, x, y, width) {
        const [a, b] = this.inSight(s, this.from, this.to), per = Math.max(1, Math.floor((b - a) / width));
        g.strokeStyle = cssColour('--c' + (index % 6 + 1));
        g.lineWidth = 1.5;
        g.setLineDash([[], [7, 3], [2, 2], [9, 3, 2, 3]][index % 4]);
        g.beginPath();
        let before = null;
        for (let i = a; i <= b; i += per) {
            let low = Infinity, high = -Infinity;
            for (let k = i; k < Math.min(i + per, b + 1); k++) {
                low = Math.min(low, s.low[k]);
                high = Math.max(high, s.high[k]);
            }
            const at = x(s.t0 + i * s.dt);
            if (before === null) g.moveTo(at, y(low));
            else if (s.step) g.lineTo(at, y(before));
            if (before !== null && before > (low + high) / 2) { g.lineTo(at, y(high)); g.lineTo(at, y(low)); before = low; }
            else { g.lineTo(at, y(low)); g.lineTo(at, y(high)); before = high; }
        }
        g.stroke();
        g.setLineDash([]);
        g.lineWidth = 1;
    }

    at(s, t) {
        const i = Math.round((t - s.t0) / s.dt);
        return i < 0 || i >= s.low.length ? null : [s.low[i], s.high[i]];
    }

    // Names come from files: they are text, never markup.
    legend(c) {
        const t = this.cursor, unit = c.unit ? ' ' + c.unit : '', items = t === null ? [] : [[number(t) + ' s', -1]];
        c.series.forEach((s, i) => {
            const v = t === null ? null : this.at(s, t);
            const value = v === null ? '' : v[0] === v[1] ? ' ' + number(v[0]) + unit : ' ' + number(v[0]) + ' to ' + number(v[1]) + unit;
            if (c.series.length > 1 || value !== '') items.push([s.name + value, c.series.length > 1 ? i : -1]);
        });
        const shown = JSON.stringify(items);
        if (shown === c.shown) return;
        c.shown = shown;
        c.key.replaceChildren(...items.map(([text, i]) => {
            const item = document.createElement('span');
            if (i >= 0) {
                const line = document.createElement('i');
                line.style.borderColor = 'var(--c' + (i % 6 + 1) + ')';
                line.style.borderTopStyle = ['solid', 'dashed', 'dotted', 'dashed'][i % 4];
                item.append(line);
            }
            item.append(text);
            return item;
        }));
    }
}

// How often what: bars over a logarithmic axis.
function histogram(canvas, values, unit) {
    const paint = () => {
        const ratio = devicePixelRatio || 1, w = canvas.clientWidth, h = canvas.clientHeight;
        canvas.width = Math.round(w * ratio);
        canvas.height = Math.round(h * ratio);
        const g = canvas.getContext('2d'), left = 56, bottom = h - 22, most = Math.max(...values.count, 1);
        const from = Math.log10(values.low), to = Math.log10(values.high), n = values.count.length;
        g.scale(ratio, ratio);
        g.font = '12px system-ui, sans-serif';
        g.fillStyle = g.strokeStyle = cssColour('--grid');
        const top = Math.ceil(Math.log10(most + 1)), y = c => bottom - Math.log10(c + 1) / Math.max(top, 1) * (bottom - 8);
        for (let d = 0; d <= top; d++) {
            g.beginPath();
            g.moveTo(left, y(Math.pow(10, d) - (d === 0 ? 1 : 0)));
            g.lineTo(w - 8, y(Math.pow(10, d) - (d === 0 ? 1 : 0)));
            g.stroke();
        }
        g.fillStyle = cssColour('--accent');
        values.count.forEach((c, i) => {
            const a = left + i / n * (w - left - 8);
            if (c > 0) g.fillRect(a, y(c), (w - left - 8) / n - 1, bottom - y(c));
        });
        g.fillStyle = cssColour('--quiet');
        g.textAlign = 'right';
        for (let d = 0; d <= top; d++) g.fillText(String(Math.pow(10, d)), left - 6, y(Math.pow(10, d)) + 4);
        g.textAlign = 'center';
        for (let d = Math.ceil(from - 1e-9); d <= to + 1e-9; d++)
            g.fillText(number(Math.pow(10, d)) + ' ' + unit, Math.min(left + (d - from) / (to - from) * (w - left - 8), w - 30), bottom + 16);
    };
    paint();
    new ResizeObserver(paint).observe(canvas);
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', paint);
}
