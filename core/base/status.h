/* SPDX-License-Identifier: MIT */
/* The closed set of results that a fallible core function returns. */
#ifndef PALP_BASE_STATUS_H
#define PALP_BASE_STATUS_H

#ifdef __cplusplus
#define PALP_STATIC_ASSERT static_assert
#else
#define PALP_STATIC_ASSERT _Static_assert
#endif

typedef enum {
    PALP_OK = 0,
    PALP_ERR_MEMORY,     /* the block handed over is NULL or smaller than memsize() said */
    PALP_ERR_ALIGNMENT,  /* the blob or the block is not aligned to PALP_ALIGN */
    PALP_ERR_TRUNCATED,  /* the blob is NULL or ends before its header or table says */
    PALP_ERR_MAGIC,      /* not a Palp blob */
    PALP_ERR_VERSION,    /* a format version or byte order that this build does not read */
    PALP_ERR_CRC,        /* stored and computed CRC-32C differ */
    PALP_ERR_TABLE,      /* section table: overlap, order, size or a missing section */
    PALP_ERR_RANGE,      /* a count or an index in the blob is out of its range */
    PALP_ERR_NOT_FINITE, /* NaN or infinity where a number is needed */
    PALP_ERR_LIMITS,     /* limits asked for are zero or beyond what the format allows */
    PALP_ERR_ARGUMENT,   /* an argument out of its documented domain */
    PALP_ERR_NOT_SPD,    /* a pivot of the capacitance matrix is not positive */
    PALP_ERR_SINGULAR,   /* the general capacitance matrix has no usable pivot */
    PALP_ERR_CAPACITY,   /* more switched unknowns than the limits allow */
    PALP_ERR_ABSENT,     /* the blob does not carry what was asked for */
    PALP_ERR_BUDGET,     /* the coarsest level does not fit the period */
    PALP_STATUS_COUNT
} palp_status;

/* One line of text for `status`; never NULL. Constant time. */
const char *palp_status_text(palp_status status);

#endif
