/* SPDX-License-Identifier: MIT */
#include "tools/feel/table.h"
#include "port/host/util.h"
#include <math.h>

void feel_add(feel_table *t, const char *measure, const char *of, double value, const char *unit,
              double threshold, double goal) {
    t->row = grow(t->row, &t->room, t->count + 1, sizeof *t->row);
    feel_row *r = &t->row[t->count++];
    *r = (feel_row){.value = value, .unit = unit, .threshold = threshold, .goal = goal};
    snprintf(r->measure, sizeof r->measure, "%s", measure);
    snprintf(r->of, sizeof r->of, "%s", of);
}

static void number(FILE *f, double x) {
    if (isfinite(x)) {
        fprintf(f, "%.4g", x);
    } else {
        fputs("null", f);
    }
}

void feel_json(FILE *f, const feel_table *t) {
    fputs("[", f);
    for (size_t i = 0; i < t->count; i++) {
        const feel_row *r = &t->row[i];
        fprintf(f, "%s\n {\"measure\":\"%s\",\"case\":\"%s\",\"value\":", i > 0 ? "," : "",
                r->measure, r->of);
        number(f, r->value);
        fprintf(f, ",\"unit\":\"%s\",\"threshold\":", r->unit);
        number(f, r->threshold);
        fputs(",\"goal\":", f);
        number(f, r->goal);
        fputs("}", f);
    }
    fputs("\n]\n", f);
}

static const char *verdict(const feel_row *r) {
    if (!isfinite(r->goal)) return "";
    return fabs(r->value) <= r->goal ? "reached" : "missed";
}

void feel_text(FILE *f, const feel_table *t) {
    fprintf(f, "%-22s %-42s %10s %-6s %9s %9s\n", "measure", "case", "value", "unit", "felt from",
            "goal");
    for (size_t i = 0; i < t->count; i++) {
        const feel_row *r = &t->row[i];
        fprintf(f, "%-22s %-42s %10.4g %-6s ", r->measure, r->of, r->value, r->unit);
        if (isfinite(r->threshold)) {
            fprintf(f, "%9.3g ", r->threshold);
        } else {
            fprintf(f, "%9s ", "");
        }
        if (isfinite(r->goal)) fprintf(f, "%9.3g %s", r->goal, verdict(r));
        fputc('\n', f);
    }
}

void feel_html(FILE *f, const feel_table *t) {
    fputs(
        "<!doctype html><html lang='en'><head><meta charset='utf-8'><title>Palp: felt "
        "quality</title><style>body{font:15px/1.5 system-ui,sans-serif;max-width:60rem;margin:2rem "
        "auto;padding:0 "
        "1rem;color:#222}table{border-collapse:collapse;width:100%}td,th{padding:3px "
        "10px;border-bottom:1px solid #e2ddd4;text-align:left}td.n{text-align:right}.missed{"
        "font-weight:bold}</style></head><body><h1>Felt quality</h1><p>Virtual time; the "
        "threshold is what a hand just notices.</p><table><tr><th>measure<th>case<th>value"
        "<th>unit<th>felt from<th>goal<th></tr>\n",
        f);
    for (size_t i = 0; i < t->count; i++) {
        const feel_row *r = &t->row[i];
        fprintf(f, "<tr><td>%s<td>%s<td class='n'>%.4g<td>%s<td class='n'>", r->measure, r->of,
                r->value, r->unit);
        if (isfinite(r->threshold)) fprintf(f, "%.3g", r->threshold);
        fputs("<td class='n'>", f);
        if (isfinite(r->goal)) fprintf(f, "%.3g", r->goal);
        fprintf(f, "<td class='%s'>%s</tr>\n", verdict(r), verdict(r));
    }
    fputs("</table></body></html>\n", f);
}
