# SPDX-License-Identifier: MIT
# Static analysis: cppcheck on everything, clang's analyzer on core.
. "$(dirname "$0")/../cli/lib.sh"
cd "$here" || exit 1
if command -v cppcheck >/dev/null; then
    # in tools, arrays are filled by callees that cppcheck does not follow
    said=$(cppcheck --std=c11 --enable=warning,performance,portability --error-exitcode=1 --quiet -I. --library=tests/check/cppcheck.cfg \
        --suppress=missingIncludeSystem --suppress=uninitvar:tools/* core/*/*.c port/host/*.c sim/*.c sim/*/*.c tools/*/*.c $(ls port/linux/*.c | grep -v telemetry_dds) 2>&1)
    ok $? "cppcheck: warnings, performance, portability $(echo "$said" | head -3 | tr '\n' ' ')"
else
    count=$((count + 1)); echo "ok $count - cppcheck # SKIP not installed (make deps)"
fi
if command -v clang >/dev/null; then
    said=$(for c in core/*/*.c; do clang --analyze -std=c11 -I. -Xclang -analyzer-output=text "$c" -o /dev/null 2>&1; done)
    [ -z "$(echo "$said" | grep warning)" ]; ok $? "clang's analyzer finds nothing in core $(echo "$said" | grep -m2 warning)"
else
    count=$((count + 1)); echo "ok $count - clang's analyzer # SKIP clang is not installed (make deps)"
fi
done_testing
