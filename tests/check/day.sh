# SPDX-License-Identifier: MIT
# A day of work with faults in virtual time (tests/soak/day.c): half an hour of it here, 24 hours with make soak (HOURS).
. "$(dirname "$0")/../cli/lib.sh"
small_body body.palp
"$here/$BUILD/day" body.palp "${HOURS:-0.5}" "${DEVICE:-arm3}"
