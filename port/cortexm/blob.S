/* SPDX-License-Identifier: MIT */
/* The blob, as it is, in flash: BLOB names the file. */
    .section .blob, "a"
    .balign 64
    .global blob_begin
    .global blob_end
blob_begin:
    .incbin BLOB
blob_end:
