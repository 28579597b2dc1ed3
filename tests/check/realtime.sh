# SPDX-License-Identifier: MIT
# What the real-time loop does besides its work: allocations (preloaded trap), system calls (strace), page faults (getrusage).
. "$(dirname "$0")/../cli/lib.sh"
small_body body.palp
gcc -shared -fPIC -O1 -w "$here/tests/check/trap.c" -o trap.so
for try in 1 2 3; do # the kernel moves pages that it may not lock: a fault of the loop's own comes every time
    LD_PRELOAD=$work/trap.so $palpd body.palp --bus loop --device arm3 --seconds 3 --log run.log >out.txt 2>err.txt
    grep -q '^loop  *0 minor page faults' out.txt && break
done
line=$(grep '^trap:' err.txt)
echo "$line" | grep -qE 'trap: 0 in the loop, [1-9]'; ok $? "allocations in 3 s with a log: $line"
grep -q '^loop  *0 minor page faults after the start, 0 ticks not on record' out.txt; ok $? "$(grep '^loop' out.txt | tr -s ' ')"
if command -v strace >/dev/null && strace -o /dev/null true 2>/dev/null; then
    strace -f -tt -o trace $palpd body.palp --bus loop --device arm3 --seconds 3 --log run.log >/dev/null 2>&1
    # the loop's thread is the one that sleeps to an absolute time
    thread=$(grep -m1 'clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME' trace | awk '{print $1}')
    grep "^$thread " trace | sed -E 's/^[0-9]+ +[0-9:.]+ //' | awk '/clock_nanosleep/{n++} n>20 && !/resumed/{sub(/\(.*/,""); c[$0]++} END{for(k in c) if(c[k]>0) print c[k], k}' | sort -rn >calls
    # the thread's own end is allowed for
    others=$(grep -vE ' (clock_nanosleep|exit|madvise|munmap|rt_sigprocmask|getrusage|\+\+\+.*)$' calls | tr '\n' ';')
    [ -n "$thread" ] && [ -z "$others" ]; ok $? "system calls after 20 ticks, the thread's end included: $(tr '\n' ';' <calls)"
else
    count=$((count + 1)); echo "ok $count - system calls # SKIP strace is not installed or may not trace (make deps)"
fi
done_testing
