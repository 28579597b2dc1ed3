/* SPDX-License-Identifier: MIT */
#include "status.h"

const char *palp_status_text(palp_status status) {
    switch (status) {
    case PALP_OK:
        return "ok";
    case PALP_ERR_MEMORY:
        return "no memory block, or one that is too small";
    case PALP_ERR_ALIGNMENT:
        return "blob or memory block is not 64-byte aligned";
    case PALP_ERR_TRUNCATED:
        return "blob is truncated";
    case PALP_ERR_MAGIC:
        return "not a Palp blob";
    case PALP_ERR_VERSION:
        return "unsupported blob version or byte order";
    case PALP_ERR_CRC:
        return "blob is corrupt: CRC-32C differs";
    case PALP_ERR_TABLE:
        return "blob section table is inconsistent";
    case PALP_ERR_RANGE:
        return "blob holds a count or an index out of range";
    case PALP_ERR_NOT_FINITE:
        return "not a finite number";
    case PALP_ERR_LIMITS:
        return "limits are zero or too large";
    case PALP_ERR_ARGUMENT:
        return "argument out of its domain";
    case PALP_ERR_NOT_SPD:
        return "capacitance matrix is not positive definite";
    case PALP_ERR_SINGULAR:
        return "capacitance matrix is singular";
    case PALP_ERR_CAPACITY:
        return "more constraints than the limits allow";
    case PALP_ERR_ABSENT:
        return "the blob does not carry the data asked for";
    case PALP_ERR_BUDGET:
        return "the coarsest answer does not fit the period";
    case PALP_STATUS_COUNT:
        break;
    }
    return "unknown status";
}
