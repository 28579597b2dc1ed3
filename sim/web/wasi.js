// SPDX-License-Identifier: MIT
// What a WASI program needs of its system, on files in memory: class WasiSystem(files), where `files` is a Map from
// paths to Uint8Array. The program's messages go to `say`. It ends by throwing WasiExit.
'use strict';

class WasiExit extends Error {
    constructor(code, message) {
        super(message);
        this.code = code;
    }
}

class WasiSystem {
    constructor(files, say) {
        this.files = files;
        this.say = say;
        this.open = new Map(); // by descriptor: {path, at, write}
        this.next = 4; // 0, 1, 2 are the standard streams, 3 the root
        this.message = '';
        this.line = ''; // begun
        this.instance = null;
        const known = this.calls();
        // Calls that are not here answer "not supported".
        this.imports = {wasi_snapshot_preview1: new Proxy(known, {get: (t, name) => t[name] || (() => 58)})};
    }

    view() { return new DataView(this.instance.exports.memory.buffer); }
    bytes() { return new Uint8Array(this.instance.exports.memory.buffer); }
    string(at, length) { return new TextDecoder().decode(this.bytes().slice(at, at + length)); }

    path(at, length) {
        const s = this.string(at, length);
        return s.startsWith('/') ? s : '/' + s.replace(/^\.\//, '');
    }

    tell(text) {
        this.message = (this.message + text).slice(-4000);
        const lines = (this.line + text).split('\n');
        this.line = lines.pop();
        if (this.say) lines.filter(l => l !== '').forEach(this.say);
    }

    vectors(at, count) {
        const v = this.view(), list = [];
        for (let i = 0; i < count; i++) list.push([v.getUint32(at + 8 * i, true), v.getUint32(at + 8 * i + 4, true)]);
        return list;
    }

    append(file, data) {
        let held = this.files.get(file.path);
        const end = file.at + data.length;
        if (held.room === undefined || held.room.length < end) {
            const room = new Uint8Array(Math.max(2 * end, 65536));
            room.set(held);
            const size = held.length;
            held = room.subarray(0, size);
            held.room = room;
        }
        held.room.set(data, file.at);
        const grown = held.room.subarray(0, Math.max(held.length, end));
        grown.room = held.room;
        this.files.set(file.path, grown);
        file.at = end;
    }

    stat(at, path) {
        const v = this.view(), file = this.files.get(path);
        for (let i = 0; i < 64; i += 8) v.setBigUint64(at + i, 0n, true);
        v.setUint8(at + 16, file ? 4 : 3);
        v.setBigUint64(at + 32, BigInt(file ? file.length : 0), true);
        return 0;
    }

    calls() {
        const none = 8, absent = 44;
        return {
            args_sizes_get: (a, b) => { this.view().setUint32(a, 0, true); this.view().setUint32(b, 0, true); return 0; },
            args_get: () => 0,
            environ_sizes_get: (a, b) => { this.view().setUint32(a, 0, true); this.view().setUint32(b, 0, true); return 0; },
            environ_get: () => 0,
            clock_time_get: (id, precision, at) => {
                this.view().setBigUint64(at, BigInt(Math.round(1e6 * performance.now())), true);
                return 0;
            },
            random_get: (at, n) => { this.bytes().fill(7, at, at + n); return 0; }, // repeats
            proc_exit: code => { throw new WasiExit(code, this.message.trim()); },
            fd_prestat_get: (fd, at) => {
                if (fd !== 3) return none;
                this.view().setUint32(at, 0, true);
                this.view().setUint32(at + 4, 1, true);
                return 0;
            },
            fd_prestat_dir_name: (fd, at) => { this.bytes()[at] = 47; return 0; },
            fd_fdstat_get: (fd, at) => {
                const v = this.view();
                v.setUint8(at, fd < 3 ? 2 : fd === 3 ? 3 : 4);
                v.setUint16(at + 2, 0, true);
                v.setBigUint64(at + 8, ~0n & 0xffffffffffffffffn, true);
                v.setBigUint64(at + 16, ~0n & 0xffffffffffffffffn, true);
                return 0;
            },
            fd_fdstat_set_flags: () => 0,
            fd_close: fd => (this.open.delete(fd), 0),
            fd_filestat_get: (fd, at) => this.stat(at, fd === 3 ? '/' : (this.open.get(fd) || {}).path),
            path_filestat_get: (fd, flags, at, n, out) => {
                const path = this.path(at, n);
                return this.files.has(path) || path === '/' ? this.stat(out, path) : absent;
            },
            path_unlink_file: (fd, at, n) => this.files.delete(this.path(at, n)) ? 0 : absent,
            path_rename: (fd, at, n, to, into, length) => {
                const from = this.path(at, n), file = this.files.get(from);
                if (!file) return absent;
                this.files.delete(from);
                this.files.set(this.path(into, length), file);
                return 0;
            },
            path_open: (fd, look, at, n, how, rights, inherit, flags, out) => {
                const path = this.path(at, n), make = how & 1, cut = how & 8;
                if (!this.files.has(path) && !make) return absent;
                if (!this.files.has(path) || cut) this.files.set(path, new Uint8Array(0));
                this.open.set(this.next, {path, at: flags & 1 ? this.files.get(path).length : 0});
                this.view().setUint32(out, this.next++, true);
                return 0;
            },
            fd_seek: (fd, offset, whence, out) => {
                const f = this.open.get(fd);
                if (!f) return fd < 3 ? 70 : none;
                const from = whence === 0 ? 0 : whence === 1 ? f.at : this.files.get(f.path).length;
                f.at = from + Number(offset);
                this.view().setBigUint64(out, BigInt(f.at), true);
                return 0;
            },
            fd_read: (fd, at, count, out) => {
                const f = this.open.get(fd);
                let total = 0;
                if (!f && fd !== 0) return none;
                for (const [to, n] of f ? this.vectors(at, count) : []) {
                    const part = this.files.get(f.path).subarray(f.at, f.at + n);
                    this.bytes().set(part, to);
                    f.at += part.length;
                    total += part.length;
                    if (part.length < n) break;
                }
                this.view().setUint32(out, total, true);
                return 0;
            },
            fd_write: (fd, at, count, out) => {
                const f = this.open.get(fd);
                let total = 0;
                if (!f && (fd < 1 || fd > 2)) return none;
                for (const [from, n] of this.vectors(at, count)) {
                    if (f) this.append(f, this.bytes().subarray(from, from + n));
                    else this.tell(this.string(from, n));
                    total += n;
                }
                this.view().setUint32(out, total, true);
                return 0;
            },
        };
    }
}
