/* SPDX-License-Identifier: MIT */
/* The files of port/host/page, as they are. */
    .section .rodata
    .macro asset name, file
    .global \name
    .global \name\()_end
\name:
    .incbin "\file"
\name\()_end:
    .byte 0
    .endm
    asset palp_style, port/host/page/style.css
    asset palp_plot, port/host/page/plot.js
    asset palp_body_view, port/host/page/body.js
    asset palp_report_page, port/host/page/report.js
    asset palp_card_page, port/host/page/card.js
    .section .note.GNU-stack, "", %progbits
