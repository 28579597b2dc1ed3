// SPDX-License-Identifier: MIT
// A browser for tests: Chromium without a screen, spoken to through its debugging pipe. `const b = await browser(folder)`;
// `const p = await b.page(url, {width, height, mobile, dark})`.
import { spawn } from 'node:child_process';
import { writeFileSync } from 'node:fs';

export const sleep = ms => new Promise(done => setTimeout(done, ms));

export async function browser(folder) {
    const child = spawn('chromium', ['--headless', '--no-sandbox', '--disable-quic', '--no-first-run', '--disable-background-networking', '--disable-component-update',
        '--disable-sync', '--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--ignore-gpu-blocklist', '--remote-debugging-pipe',
        '--user-data-dir=' + folder + '/profile', 'about:blank'], {stdio: ['ignore', 'ignore', 'ignore', 'pipe', 'pipe'], env: {...process.env, HOME: folder}});
    const waiting = new Map(), listeners = [];
    let next = 1, held = '';
    child.stdio[4].on('data', data => {
        held += data;
        const parts = held.split('\0');
        held = parts.pop();
        for (const m of parts.map(p => JSON.parse(p))) {
            if (!m.id) { listeners.forEach(l => l(m)); continue; }
            const {done, failed} = waiting.get(m.id);
            waiting.delete(m.id);
            m.error ? failed(new Error(m.error.message)) : done(m.result);
        }
    });
    const send = (method, params = {}, sessionId) => new Promise((done, failed) => {
        waiting.set(next, {done, failed});
        child.stdio[3].write(JSON.stringify({id: next++, method, params, sessionId}) + '\0');
    });
    const page = async (url, {width = 1280, height = 800, mobile = false, dark = false} = {}) => {
        const {targetId} = await send('Target.createTarget', {url: 'about:blank'});
        const {sessionId} = await send('Target.attachToTarget', {targetId, flatten: true});
        const call = (method, params) => send(method, params, sessionId), said = [];
        listeners.push(m => {
            if (m.sessionId !== sessionId) return;
            if (m.method === 'Runtime.exceptionThrown') said.push(m.params.exceptionDetails.exception?.description || m.params.exceptionDetails.text);
            if (m.method === 'Network.requestWillBeSent') asked.push(m.params.request.url);
        });
        const asked = [];
        await call('Runtime.enable');
        await call('Network.enable');
        await call('Page.enable');
        await call('Emulation.setDeviceMetricsOverride', {width, height, deviceScaleFactor: 1, mobile});
        await call('Emulation.setTouchEmulationEnabled', {enabled: mobile});
        await call('Emulation.setEmulatedMedia', {features: [{name: 'prefers-color-scheme', value: dark ? 'dark' : 'light'}]});
        await call('Page.navigate', {url});
        const p = {
            said, asked, // exceptions; addresses of what was fetched
            async run(text) {
                const r = await call('Runtime.evaluate', {expression: text, awaitPromise: true, returnByValue: true});
                if (r.exceptionDetails) throw new Error(r.exceptionDetails.exception?.description || r.exceptionDetails.text);
                return r.result.value;
            },
            async until(text, ms = 40000) { // what the text gives as soon as it is not nothing
                for (const end = Date.now() + ms; Date.now() < end; await sleep(50)) {
                    const v = await p.run(text).catch(() => null);
                    if (v) return v;
                }
                throw new Error('never: ' + text);
            },
            mouse: (type, x, y, held = type !== 'mouseMoved') => call('Input.dispatchMouseEvent', {type, x, y, button: held ? 'left' : 'none', buttons: held && type !== 'mouseReleased' ? 1 : 0, clickCount: 1}),
            async drag(from, to, ms = 500) {
                await p.mouse('mouseMoved', ...from);
                await p.mouse('mousePressed', ...from);
                for (let i = 1; i <= 20; i++) {
                    await p.mouse('mouseMoved', ...from.map((v, k) => v + (to[k] - v) * i / 20), true);
                    await sleep(ms / 20);
                }
            },
            touch: (type, points) => call('Input.dispatchTouchEvent', {type, touchPoints: points.map(([x, y], id) => ({x, y, id}))}),
            async key(key, code = key, modifiers = 0) {
                await call('Input.dispatchKeyEvent', {type: 'keyDown', key, code, modifiers, text: key.length === 1 ? key : undefined});
                await call('Input.dispatchKeyEvent', {type: 'keyUp', key, code, modifiers});
            },
            async drop(files) { // [[name, Buffer] ..], as if dropped by the system
                const list = JSON.stringify(files.map(([name, data]) => [name, Buffer.from(data).toString('base64')]));
                await p.run(`(() => { const t = new DataTransfer(); for (const [name, b] of ${list}) t.items.add(new File([Uint8Array.from(atob(b), c => c.charCodeAt(0))], name));
                    document.body.dispatchEvent(new DragEvent('drop', {dataTransfer: t, bubbles: true, cancelable: true})); })()`);
            },
            // All that is seen, or a part of the page {x, y, width, height, scale}.
            async shot(path, clip) { writeFileSync(path, Buffer.from((await call('Page.captureScreenshot', {format: 'png', clip, captureBeyondViewport: !!clip})).data, 'base64')); },
            close: () => send('Target.closeTarget', {targetId}),
        };
        return p;
    };
    return {page, close: async () => { await send('Browser.close').catch(() => 0); child.kill(); }};
}
