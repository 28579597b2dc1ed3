// SPDX-License-Identifier: MIT
// Files that are dropped on the page: bodies, tools, meshes, scenes, logs.
'use strict';

function takeBody(bytes, name) {
    files = new Map([['/body.palp', bytes]]);
    own = name;
    scene = place = body = null;
    joints = [];
    turns = [];
    size = 1;
    endReplay();
    reopen();
}

function replayLog(bytes, name) {
    files.set('/page.log', bytes);
    replaying = true;
    recording = false;
    open(null, {log: true, scene: scene || 'body body.palp\ndevice arm3\ntool ' + (toolFile ? 'own.tool' : 'ball') + '\n'});
    panel();
}

function meshDialog(name, bytes) {
    const end = name.split('.').pop().toLowerCase(), at = '/mesh.' + end;
    const run = (as, list, makes, out) => {
        say(as === 'tool' ? 'Making a tool of ' + name + ' ..' : 'Baking ' + name + ': this takes up to a minute ..');
        $('message').dataset.busy = 1;
        worker.postMessage({do: 'command', files: [[at, bytes]], list, makes, as, name: out});
    };
    const stem = name.replace(/\.[^.]*$/, '');
    say(name + ': what is it?',
        ['A body: bake it here (642 nodes, 20 kPa, held at its base)', () => run('body', ['bake', at, '-o', '/out.palp', '--levels', '2', '--young', '2e4', '--poisson', '0.45',
            '--density', '1000', '--fix-below', 'z', base(bytes, end)], '/out.palp', stem + '.palp')],
        ['A rigid tool', () => run('tool', ['tool', at, '-o', '/out.tool', '--cells', '60'], '/out.tool', stem + '.tool')], ['Neither', () => {}]);
}

// A twentieth of the height of a mesh above its lowest point, in its own numbers.
function base(bytes, end) {
    let low = Infinity, high = -Infinity;
    const take = z => { if (isFinite(z)) { low = Math.min(low, z); high = Math.max(high, z); } };
    const text = end === 'obj' || new TextDecoder().decode(bytes.subarray(0, 5)) === 'solid' ? new TextDecoder().decode(bytes) : '';
    if (/^\s*v\s/m.test(text)) for (const m of text.matchAll(/^\s*v\s+\S+\s+\S+\s+(\S+)/gm)) take(+m[1]);
    else if (/vertex/.test(text)) for (const m of text.matchAll(/vertex\s+\S+\s+\S+\s+(\S+)/g)) take(+m[1]);
    else if (end === 'stl') {
        const v = new DataView(bytes.buffer, bytes.byteOffset, bytes.length), n = v.getUint32(80, true);
        for (let i = 0; i < n && 84 + 50 * i + 50 <= bytes.length; i++) for (let k = 0; k < 3; k++) take(v.getFloat32(84 + 50 * i + 20 + 12 * k, true));
    }
    return low < high ? String(low + 0.05 * (high - low)) : '0';
}

async function takeFiles(list) {
    const got = [];
    for (const f of list) got.push({name: f.name, end: f.name.split('.').pop().toLowerCase(), bytes: new Uint8Array(await f.arrayBuffer())});
    const of = end => got.filter(f => f.end === end);
    const unknown = got.find(f => !['palp', 'scene', 'tool', 'stl', 'obj', 'ply', 'log', 'dev', 'hand'].includes(f.end));
    if (unknown) return say(unknown.name + ': not a blob (.palp), scene, tool, mesh or log', ['Close', () => {}]);
    for (const t of of('tool')) { toolFile = t.bytes; state.tool = 'own'; }
    const meshes = got.filter(f => ['stl', 'obj', 'ply'].includes(f.end));
    if (of('scene').length > 0) return takeScene(of('scene')[0], got);
    if (of('palp').length > 0) takeBody(of('palp')[0].bytes, of('palp')[0].name);
    if (of('log').length > 0) return replayLog(of('log')[0].bytes, of('log')[0].name);
    if (of('palp').length > 0) return;
    if (meshes.length > 0) return meshDialog(meshes[0].name, meshes[0].bytes);
    if (of('tool').length > 0) reopen();
    panel();
}

// A scene's paths are those of the files dropped with it, by their names alone.
function takeScene(s, got) {
    const text = new TextDecoder().decode(s.bytes), names = new Set(got.map(f => f.name)), missing = [];
    const short = text.replace(/^(\s*(?:body|tool|hand|device)\s+)(\S+\.(?:palp|tool|hand|dev))/gm, (all, key, path) => {
        const name = path.split('/').pop();
        if (!names.has(name)) missing.push(name);
        return key + name;
    });
    if (missing.length > 0) return say(s.name + ': drop it together with ' + [...new Set(missing)].join(', '), ['Close', () => {}]);
    files = new Map(got.map(f => ['/' + f.name, f.bytes]));
    own = s.name;
    body = place = null;
    joints = [];
    endReplay();
    scene = short;
    const log = got.find(f => f.end === 'log');
    if (log) replayLog(log.bytes, log.name); else open();
}

function listenToFiles() {
    const stop = e => e.preventDefault();
    addEventListener('dragover', e => { stop(e); document.body.classList.add('dropping'); });
    addEventListener('dragleave', () => document.body.classList.remove('dropping'));
    addEventListener('drop', e => { stop(e); document.body.classList.remove('dropping'); takeFiles([...e.dataTransfer.files]); });
    $('files').onchange = e => takeFiles([...e.target.files]);
}

