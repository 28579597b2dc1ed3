/* SPDX-License-Identifier: MIT */
#include "port/host/assets.h"

extern const char palp_style[], palp_style_end[], palp_plot[], palp_plot_end[], palp_body_view[],
    palp_body_view_end[], palp_report_page[], palp_report_page_end[], palp_card_page[],
    palp_card_page_end[];

const char *asset_text(asset which, size_t *bytes) {
    static const char *const at[ASSETS][2] = {
        [ASSET_STYLE] = {palp_style, palp_style_end},
        [ASSET_PLOT] = {palp_plot, palp_plot_end},
        [ASSET_BODY] = {palp_body_view, palp_body_view_end},
        [ASSET_REPORT] = {palp_report_page, palp_report_page_end},
        [ASSET_CARD] = {palp_card_page, palp_card_page_end}};
    *bytes = (size_t)(at[which][1] - at[which][0]);
    return at[which][0];
}
