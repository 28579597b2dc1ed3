# SPDX-License-Identifier: MIT
# Decodes a candump log by a DBC file and nothing else: dbc.py FILE.dbc LOG CSV BUS. Reads the log with python3-can, the DBC
# with a parser of its own, and compares with what palp replay wrote. Prints TAP.
import re, struct, sys, can

dbc, log, csv, bus = sys.argv[1:]
messages, current, floats = {}, None, set()
for line in open(dbc):
    m = re.match(r'BO_ (\d+) (\w+): (\d+) (\w+)', line)
    if m:
        current = messages[int(m[1])] = {'name': m[2], 'length': int(m[3]), 'signals': {}}
    m = re.match(r' SG_ (\w+) : (\d+)\|(\d+)@1([+-]) \(([^,]+),([^)]+)\) \[([^|]+)\|([^\]]+)\] "([^"]*)"', line)
    if m:
        current['signals'][m[1]] = (int(m[2]), int(m[3]), m[4] == '-', float(m[5]), float(m[6]), float(m[7]), float(m[8]))
    m = re.match(r'SIG_VALTYPE_ \d+ (\w+) : 1;', line)
    if m:
        floats.add(m[1])

def decode(message, data):
    whole, out = int.from_bytes(data, 'little'), {}
    for name, (start, length, signed, scale, offset, low, high) in message['signals'].items():
        raw = whole >> start & (1 << length) - 1
        if name in floats:
            value = struct.unpack('<f', raw.to_bytes(4, 'little'))[0]
        else:
            if signed and raw >> (length - 1):
                raw -= 1 << length
            value = raw * scale + offset
        assert low <= value <= high, (message['name'], name, value)
        out[name] = value
    return out

def crc8(data):
    crc = 0xff
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc << 1 ^ (0x1d if crc & 0x80 else 0)) & 0xff
    return crc ^ 0xff

count, bad_length, bad_crc, gaps, results, last = {}, 0, 0, 0, [], {}
torques = positions = 0
for frame in can.CanutilsLogReader(log):
    key = frame.arbitration_id | (0x80000000 if frame.is_extended_id else 0)
    if key not in messages:
        continue
    message = messages[key]
    count[message['name']] = count.get(message['name'], 0) + 1
    bad_length += len(frame.data) != message['length']
    values = decode(message, bytes(frame.data))
    if frame.channel == bus:
        name = message['name']
        bad_crc += values[name + '_CRC'] != crc8(bytes([key & 255, key >> 8]) + bytes(frame.data[1:]))
        gaps += name in last and values[name + '_COUNTER'] != (last[name] + 1) % 15
        last[name] = values[name + '_COUNTER']
        torques += abs(values.get(name + '_TORQUE', 0)) > 1e-3
        positions += abs(values.get(name + '_POSITION', 0)) > 1e-3
    elif message['name'] == 'RESULT':
        results.append(values)
rows = [line.rstrip('\n').split(',') for line in open(csv)][1:]
names = ['RESULT_TIP_X', 'RESULT_TIP_Y', 'RESULT_TIP_Z', 'RESULT_FORCE_X', 'RESULT_FORCE_Y', 'RESULT_FORCE_Z', 'RESULT_STORED',
         'RESULT_ABSORBED']
same = len(rows) == len(results) and all(
    abs(float(row[5 + i]) - result[name]) <= 1e-6 * abs(result[name]) for row, result in zip(rows, results) for i, name in enumerate(names))
checks = [
    (all(count.get(f'{k}{n}', 0) >= len(rows) - 5 for k in ('COMMAND', 'STATUS') for n in (1, 2, 3)),
     f'frames of all drives both ways by their DBC names: {sum(count.values())}'),
    (bad_length == 0, 'each of the length that the DBC says'),
    (bad_crc == 0 and gaps == 0, 'each with the CRC of an independent implementation and the next counter'),
    (torques > 100 and positions > 100, f'{torques} torques and {positions} positions that are not zero, all within the ranges of the DBC'),
    (same and len(rows) > 100, f'force, tip and energy of {len(results)} ticks as palp replay has them'),
]
for i, (good, name) in enumerate(checks):
    print(f'{"ok" if good else "not ok"} {i + 1} - {name}')
print(f'1..{len(checks)}')
sys.exit(not all(good for good, _ in checks))
