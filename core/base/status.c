/* SPDX-License-Identifier: MIT */
#include "status.h"

const char *palp_status_text(palp_status status) {
    static const char *const text[PALP_STATUS_COUNT] = {
        [PALP_OK] = "ok",
        [PALP_ERR_MEMORY] = "memory block too small",
        [PALP_ERR_ALIGNMENT] = "blob or memory block is not 64-byte aligned",
        [PALP_ERR_TRUNCATED] = "blob is truncated",
        [PALP_ERR_MAGIC] = "not a Palp blob",
        [PALP_ERR_VERSION] = "unsupported blob version or byte order",
        [PALP_ERR_CRC] = "blob is corrupt: CRC-32C differs",
        [PALP_ERR_TABLE] = "blob section table is inconsistent",
        [PALP_ERR_RANGE] = "blob holds a count or an index out of range",
        [PALP_ERR_NOT_FINITE] = "not a finite number",
        [PALP_ERR_LIMITS] = "limits are zero or too large",
        [PALP_ERR_ARGUMENT] = "argument out of its domain",
        [PALP_ERR_NOT_SPD] = "capacitance matrix is not positive definite",
        [PALP_ERR_SINGULAR] = "capacitance matrix is singular",
        [PALP_ERR_CAPACITY] = "more constraints than the limits allow",
        [PALP_ERR_ABSENT] = "the blob does not carry the data asked for",
        [PALP_ERR_BUDGET] = "the coarsest answer does not fit the period",
    };
    return (unsigned)status < PALP_STATUS_COUNT ? text[status] : "unknown status";
}
