# SPDX-License-Identifier: MIT
"""Whether includes run one way: python3 tests/floors.py TABLE FILE... (tests/floors.txt). Prints what they do."""
import fnmatch, os, re, sys

may = {}
for line in open(sys.argv[1]):
    if line.startswith('#') or ':' not in line: continue
    folder, allowed = line.split(':', 1)
    for one in allowed.split():  # no floor stands on one that comes later
        if '*' not in one and one not in may: sys.exit('%s: %s includes %s, which comes later' % (sys.argv[1], folder, one))
    may[folder] = [folder] + allowed.split()
bad, count = [], 0
for path in sys.argv[2:]:
    text = open(path).read()
    folder = os.path.dirname(path)
    if re.search(r'^int main\(', text, re.M): continue
    if folder not in may: bad.append('%s is on no floor' % path); continue
    for inc in re.findall(r'^\s*#\s*include "([^"]+)"', text, re.M):
        beside = os.path.join(folder, inc)
        target = folder if os.path.exists(beside) else os.path.dirname(inc)
        if target == '': continue  # made by a generator
        count += 1
        if not any(fnmatch.fnmatchcase(target, a) for a in may[folder]): bad.append('%s includes %s' % (path, inc))
print('%d includes on %d floors, %d against the table' % (count, len(may), len(bad)))
for b in bad: print('  ' + b)
sys.exit(1 if bad else 0)
