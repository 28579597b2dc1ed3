/* SPDX-License-Identifier: MIT */
#include "tools/cli/card.h"
#include "core/device/busload.h"
#include "port/host/assets.h"
#include "port/host/base64.h"
#include "port/host/machine.h"
#include "port/host/stiffness.h"
#include "port/host/util.h"
#include "tools/export/film.h"
#include "tools/wcet/scene_bounds.h"
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define SHARE 0.8          /* of a period that a tick may take */
#define NAME_COLUMNS 22    /* of a line of palp info */
#define MOST_STIFF 4.0     /* times the coupling, from which on hardly anything else is felt */
#define CARD_DEVICE "arm3" /* that ticks are bounded for */

/* ---- the lines of palp info ---- */

static const char *const words[][2] = {
    {"nodes", "Vertices of the mesh: free ones may move, fixed ones hold the body"},
    {"size", "Of the box around it"},
    {"levels",
     "Meshes, coarse to fine, of which each has four times the triangles of the one before"},
    {"material", "Young's modulus, Poisson's ratio, density"},
    {"wavelet", "How the Green's functions are stored"},
    {"compression",
     "Times smaller than all of the Green's functions; RMS: error of all entries over their size"},
    {"constraint levels", "How fine a set of Green's functions is, for palp solve"},
    {"reciprocity residual",
     "How far the Green's functions were from symmetric before they were made so"},
    {"equilibrium residual", "How far the reactions are from balancing the loads"},
    {"node stiffness", "Force along the normal of a node over its displacement, least and most"},
    {"mesh SHA-256", "Of the mesh that was baked"},
    {"contact", "Smooth functions on the surface that contact is computed with"},
    {"levels of contact", "How far the force on coarser levels is from the finest one"},
    {"bytes", "Of the blob, and of the Green's functions of all free nodes without compression"}};

static void put_lines(page *p, char *text) {
    for (char *line = text; line != NULL && *line != '\0';) {
        char *end = strchr(line, '\n'), name[NAME_COLUMNS + 1];
        if (end != NULL) *end = '\0';
        const size_t length = strlen(line);
        size_t n = length < NAME_COLUMNS ? length : NAME_COLUMNS;
        memcpy(name, line, n);
        while (n > 0 && name[n - 1] == ' ') n--;
        name[n] = '\0';
        const char *word = NULL;
        for (size_t i = 0; i < sizeof words / sizeof words[0]; i++)
            if (strcmp(words[i][0], name) == 0) word = words[i][1];
        if (length > 0) page_row(p, name, word, length > NAME_COLUMNS ? line + NAME_COLUMNS : "");
        line = end != NULL ? end + 1 : NULL;
    }
}

/* ---- what ticks may take ---- */

static void put_time(FILE *f, double us, double period_us) {
    fprintf(f, "<td class=\"n%s\">", us > SHARE * period_us ? " bad" : "");
    fprintf(f, us < 1000 ? "%.0f us" : "%.3g ms", us < 1000 ? us : 1e-3 * us);
    fprintf(f, ", %.0f %%</td>", 100 * us / period_us);
}

static double time_us(const machine *m, const wcet_row *r, const wcet_row *in_cycles) {
    const double work = m->cycles != NULL ? in_cycles->instructions * (double)m->ns_per_cycle
                                          : r->instructions * (double)m->ns_per_instruction;
    return 1e-3 * (work + r->bytes * (double)m->ns_per_byte);
}

static void put_target(FILE *f, const scene_setup *s, const char *name, double period_us) {
    machine m;
    wcet_table t = {.rows = 0}, of = {.rows = 0};
    machine_find(&m, name);
    scene_bounds(s, &m, &t);
    machine in_cycles = m;
    if (m.cycles != NULL) in_cycles.target = *m.cycles;
    scene_bounds(s, &in_cycles, &of);
    double least = 0;
    fprintf(f, "<tr><th>%s</th>", name);
    for (size_t i = 0; i < t.rows; i++)
        if (strcmp(t.row[i].step, "least") == 0) least = time_us(&m, &t.row[i], &of.row[i]);
    put_time(f, least, period_us);
    for (size_t i = 0; i < t.rows; i++)
        if (strcmp(t.row[i].step, "tick") == 0)
            put_time(f, time_us(&m, &t.row[i], &of.row[i]), period_us);
    fprintf(f, "<td class=\"n\">%.0f Hz</td><td>%s</td></tr>\n", 1e6 * SHARE / least,
            least <= SHARE * period_us ? "fits" : "<span class=\"bad\">refused</span>");
    free(t.row);
    free(of.row);
}

static void put_targets(FILE *f, const scene_setup *s, double rate_hz) {
    static const char *const targets[] = {"x86-64", "x86-64-avx2", "cortex-a53", "cortex-m7"};
    fprintf(f,
            "<h2><span tabindex=\"0\" data-word title=\"Bounds: no tick takes longer, by the "
            "machine code and the speed that is stated "
            "for each target (palp wcet)\">What a tick may take at %g Hz</span></h2>\n<div "
            "class=\"wide\"><table>\n"
            "<tr><th>target</th><th class=\"n\">least answer</th>",
            rate_hz);
    for (uint32_t l = 0; l <= PALP_CONTACT_FINEST; l++)
        fprintf(f, "<th class=\"n\">all of level %" PRIu32 "</th>", l);
    fputs("<th class=\"n\">highest rate</th><th>verdict</th></tr>\n", f);
    for (size_t i = 0; i < sizeof targets / sizeof targets[0]; i++)
        put_target(f, s, targets[i], 1e6 / rate_hz);
    fputs("</table></div>\n<p class=\"note\">With one ball on the device " CARD_DEVICE
          ". A tick does as much of its level as there is time for, and no less than the "
          "least answer, which decides whether a body is accepted. palp wcet knows other tools and "
          "machines.</p>\n",
          f);
}

/* ---- how it will feel ---- */

static void put_device(FILE *f, const palp_blob *b, const char *name, double rate_hz) {
    device_file d = device_load(name);
    d.device.drives.rate_hz = (float)rate_hz;
    const palp_bus_load load = palp_bus_load_of(&d.device);
    const double coupling = (double)palp_device_coupling(&d.device);
    fprintf(f,
            "<tr><th>%s</th><td class=\"n\">%.4g N/m</td><td class=\"n\">%.3g N</td><td "
            "class=\"n%s\">%.0f %%</td>",
            name, coupling, (double)d.device.force_max_N, load.load > 1 ? " bad" : "",
            100 * (double)load.load);
    if (b == NULL) {
        fputs("</tr>\n", f);
        return;
    }
    const touch_frame t = place_body(b, &d.device, UINT32_MAX, NULL, 0);
    const double scale = (double)t.placement.scale, k = scale * scale;
    const double softest = k * (double)b->meta->stiffness_min_N_per_m,
                 stiffest = k * (double)b->meta->stiffness_max_N_per_m;
    const char *verdict = softest > MOST_STIFF * coupling
                              ? "<span class=\"bad\">hardly anything but the coupling</span>"
                          : stiffest > coupling
                              ? "soft places as they are, stiff ones softened by the coupling"
                              : "as it is";
    fprintf(f, "<td class=\"n\">%.3g</td><td class=\"n\">%.0f to %.0f N/m</td><td>%s%s</td></tr>\n",
            scale, softest, stiffest, verdict,
            load.load > 1 ? "; <span class=\"bad\">its bus is too slow for this rate</span>" : "");
}

static void put_devices(FILE *f, const palp_blob *b, double rate_hz) {
    fputs("<h2><span tabindex=\"0\" data-word title=\"The coupling is the virtual spring between "
          "device and tool: nothing stiffer can be felt\">How it "
          "feels on which device</span></h2>\n<div class=\"wide\"><table>\n<tr><th>device</th><th "
          "class=\"n\">coupling</th><th class=\"n\">most "
          "force</th><th class=\"n\">bus</th>",
          f);
    fputs(b != NULL ? "<th class=\"n\">scale</th><th class=\"n\">nodes at the "
                      "hand</th><th>verdict</th></tr>\n"
                    : "</tr>\n",
          f);
    for (size_t i = 0; device_builtin(i) != NULL; i++) put_device(f, b, device_builtin(i), rate_hz);
    fputs("</table></div>\n", f);
}

/* ---- the body ---- */

/* Parts with a value at each node: stiffness where it is known. */
static void put_body(FILE *f, const film *k) {
    fputs("{\"parts\": [", f);
    for (uint32_t i = 0; i < k->parts; i++) {
        const film_part *p = &k->part[i];
        fputs(i > 0 ? ",\n{\"triangles\": \"" : "{\"triangles\": \"", f);
        base64_write_u32(f, p->triangle, 3 * (size_t)p->triangles);
        fputs("\", \"rest\": \"", f);
        base64_write_f32(f, p->rest_m, 3 * (size_t)p->nodes);
        fputs("\", \"fixed\": \"", f);
        base64_write(f, p->fixed, p->nodes);
        fputs("\"", f);
        if (p->blob != NULL && !palp_blob_has(p->blob, PALP_META_SCALAR)) {
            float *stiffness = allocate(p->nodes, sizeof *stiffness);
            node_stiffness(p->blob, stiffness);
            fputs(", \"value\": \"", f);
            base64_write_f32(f, stiffness, p->nodes);
            fputs("\"", f);
            free(stiffness);
        }
        fputs("}", f);
    }
    fputs("]}", f);
}

void card_write(const char *blob, const char *path, double rate_hz, page_writer *describe,
                const void *context) {
    char *text = NULL;
    size_t bytes = 0;
    FILE *lines = open_memory(&text, &bytes);
    describe(lines, context);
    fclose(lines);
    const film *body = film_of_blob(blob);
    scene_file *file = scene_empty(blob);
    scene_add_body(file, blob, blob);
    scene_add_device(file, blob, CARD_DEVICE);
    scene_add_tool(file, blob);
    file->rate_hz = rate_hz;
    const bool felt = body->part[0].blob == NULL || body->part[0].blob->meta->modes > 0;
    const scene_setup *setup = felt ? scene_set_up(file) : NULL;
    output out = open_output(path);
    FILE *f = out.file;
    page p;
    page_begin(&p, f, blob);
    put_lines(&p, text);
    page_close_table(&p);
    fputs("<h2 id=\"title\">The body</h2>\n<div id=\"body\"></div>\n", f);
    if (setup != NULL) put_targets(f, setup, rate_hz);
    if (setup != NULL) put_devices(f, body->parts == 1 ? body->part[0].blob : NULL, rate_hz);
    if (setup == NULL)
        fputs("<p class=\"bad\">It has no regular part, which contact needs: nothing can touch "
              "it.</p>\n",
              f);
    fputs("<script type=\"application/json\" id=\"data\">\n", f);
    put_body(f, body);
    fputs("\n</script>\n<script>\n", f);
    page_put_asset(f, ASSET_PLOT);
    page_put_asset(f, ASSET_BODY);
    page_put_asset(f, ASSET_CARD);
    fputs("</script>\n</main>\n</body>\n</html>\n", f);
    commit_output(&out);
    free(text);
}
