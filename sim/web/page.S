/* SPDX-License-Identifier: MIT */
/* The web page without a model, for palp view: PAGE names the file; without it there is none. */
    .section .rodata
    .global palp_page
    .global palp_page_end
palp_page:
#ifdef PAGE
    .incbin PAGE
#endif
palp_page_end:
    .byte 0
    .section .note.GNU-stack, "", %progbits
