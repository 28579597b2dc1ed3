/* SPDX-License-Identifier: MIT */
#include "port/host/page.h"
#include "port/host/assets.h"
#include "port/host/base64.h"
#include "port/host/util.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define BINS 48
#define BIN_LOW 0.1 /* of a histogram: six decades */
#define BIN_DECADES 6.0

void page_put_asset(FILE *f, int which) {
    size_t bytes;
    const char *text = asset_text((asset)which, &bytes);
    fwrite(text, 1, bytes, f);
}

void page_put_json(FILE *f, const char *text) {
    fputc('"', f);
    for (; *text != '\0'; text++) {
        const unsigned char c = (unsigned char)*text;
        if (c < 32 || c == '"' || c == '\\' || c == '<' || c == '>' || c == '&')
            fprintf(f, "\\u%04x", c);
        else
            fputc(c, f);
    }
    fputc('"', f);
}

void page_begin(page *p, FILE *f, const char *title) {
    *p = (page){.file = f};
    fputs("<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
          "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>Palp: ",
          f);
    print_escaped(f, title);
    fputs("</title>\n<style>\n", f);
    page_put_asset(f, ASSET_STYLE);
    fputs("</style>\n</head>\n<body>\n<main>\n<h1>", f);
    print_escaped(f, title);
    fputs("</h1>\n", f);
}

void page_close_table(page *p) {
    if (p->in_table) fputs("</table></div>\n", p->file);
    p->in_table = false;
}

void page_row(page *p, const char *name, const char *word, const char *text) {
    if (!p->in_table) fputs("<div class=\"wide\"><table class=\"stack\">\n", p->file);
    p->in_table = true;
    fputs("<tr><th>", p->file);
    if (word != NULL) {
        fputs("<span tabindex=\"0\" data-word title=\"", p->file);
        print_escaped(p->file, word);
        fputs("\">", p->file);
    }
    print_escaped(p->file, name);
    fputs(word != NULL ? "</span></th><td>" : "</th><td>", p->file);
    print_escaped(p->file, text);
    fputs("</td></tr>\n", p->file);
}

void page_lines(page *p, page_writer *write, const void *context) {
    char *text = NULL;
    size_t bytes = 0;
    FILE *lines = open_memory(&text, &bytes);
    write(lines, context);
    fclose(lines);
    page_close_table(p);
    fputs("<pre>", p->file);
    print_escaped(p->file, text);
    fputs("</pre>\n", p->file);
    free(text);
}

void page_curves(page *p) {
    page_close_table(p);
    fputs("<noscript><p class=\"bad\">Curves and the body need JavaScript.</p></noscript>\n"
          "<div id=\"page\"></div>\n<script type=\"application/json\" id=\"data\">\n"
          "{\"charts\": [",
          p->file);
}

static void close_chart(page *p) {
    if (p->charts > 0) fputs("]}", p->file);
}

void page_chart(page *p, const char *title, const char *word, const char *unit, page_axis axis) {
    close_chart(p);
    fputs(p->charts++ > 0 ? ",\n{\"title\": " : "\n{\"title\": ", p->file);
    page_put_json(p->file, title);
    fputs(", \"word\": ", p->file);
    page_put_json(p->file, word != NULL ? word : "");
    fputs(", \"unit\": ", p->file);
    page_put_json(p->file, unit);
    fprintf(p->file, ", \"zero\": %s, \"whole\": %s, \"series\": [",
            axis != PAGE_FREE ? "true" : "false", axis == PAGE_WHOLE ? "true" : "false");
    p->curves = 0;
}

void page_curve(page *p, const page_curve_spec *c, page_value *value, const void *context) {
    const size_t per = (c->count + PAGE_BUCKETS - 1) / PAGE_BUCKETS,
                 n = per > 0 ? (c->count + per - 1) / per : 0;
    float *low = allocate(n + 1, sizeof *low), *high = allocate(n + 1, sizeof *high);
    for (size_t i = 0; i < c->count; i++) {
        const float v = (float)value(context, i);
        const size_t at = i / per;
        low[at] = i % per == 0 ? v : fminf(low[at], v);
        high[at] = i % per == 0 ? v : fmaxf(high[at], v);
    }
    fputs(p->curves++ > 0 ? ",\n {\"name\": " : "\n {\"name\": ", p->file);
    page_put_json(p->file, c->name);
    fprintf(p->file, ", \"t0\": %.9g, \"dt\": %.9g, \"step\": %s, \"low\": \"", c->t0_s,
            c->dt_s * (double)(per > 0 ? per : 1), c->step ? "true" : "false");
    base64_write_f32(p->file, low, n);
    if (per > 1) {
        fputs("\", \"high\": \"", p->file);
        base64_write_f32(p->file, high, n);
    }
    fputs("\"}", p->file);
    free(low);
    free(high);
}

void page_events(page *p) {
    close_chart(p);
    fputs("],\n\"events\": [", p->file);
}

void page_event(page *p, double t_s, bool bad, const char *text) {
    if (p->events++ >= PAGE_EVENTS) return;
    fprintf(p->file, "%s{\"t\": %.9g, \"bad\": %s, \"text\": ", p->events > 1 ? ",\n " : "\n ", t_s,
            bad ? "true" : "false");
    page_put_json(p->file, text);
    fputc('}', p->file);
}

static void put_histogram(FILE *f, const page_rest *r) {
    size_t count[BINS] = {0};
    for (size_t i = 0; i < r->count; i++) {
        const double decades = log10(fmax((double)r->x[i], BIN_LOW) / BIN_LOW);
        const size_t bin = (size_t)(decades * BINS / BIN_DECADES);
        count[bin < BINS ? bin : BINS - 1]++;
    }
    fputs("{\"title\": ", f);
    page_put_json(f, r->histogram);
    fputs(", \"unit\": ", f);
    page_put_json(f, r->unit);
    fprintf(f, ", \"low\": %g, \"high\": %g, \"count\": [", BIN_LOW,
            BIN_LOW * pow(10, BIN_DECADES));
    for (int i = 0; i < BINS; i++) fprintf(f, "%s%zu", i > 0 ? ", " : "", count[i]);
    fputs("]}", f);
}

void page_end(page *p, const page_rest *r) {
    FILE *f = p->file;
    fprintf(f, "],\n\"unmarked\": %u,\n\"motion\": ",
            p->events > PAGE_EVENTS ? p->events - PAGE_EVENTS : 0u);
    if (r->motion != NULL && r->motion->frames > 0)
        motion_write(f, r->motion);
    else
        fputs("null", f);
    fputs(",\n\"histogram\": ", f);
    if (r->x != NULL && r->count > 0)
        put_histogram(f, r);
    else
        fputs("null", f);
    fputs("}\n</script>\n<script>\n", f);
    page_put_asset(f, ASSET_PLOT);
    page_put_asset(f, ASSET_BODY);
    page_put_asset(f, ASSET_REPORT);
    fputs("</script>\n</main>\n</body>\n</html>\n", f);
}
