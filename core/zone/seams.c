/* SPDX-License-Identifier: MIT */
#include "seams.h"
#include "core/base/linalg.h"

/* ---- layout ---- */

uint32_t palp_seam_modes(const palp_seams *seams, uint32_t s, uint32_t level) {
    uint32_t l = level == PALP_DIAGONAL ? PALP_DIAGONAL_LEVEL : level;
    if (l > seams->finest) l = seams->finest;
    return seams->zones->seam[s].level_modes[l];
}

static uint32_t unknowns(const palp_seams *q, uint32_t s, uint32_t level) {
    return 3u * palp_seam_modes(q, s, level);
}

static bool meet(const palp_zones *z, uint32_t s, uint32_t t) {
    const uint32_t *a = z->seam[s].zone, *b = z->seam[t].zone;
    return a[0] == b[0] || a[0] == b[1] || a[1] == b[0] || a[1] == b[1];
}

static uint32_t count_of(uint64_t mask) {
    uint32_t n = 0;
    /* at most 64: one bit a turn */
    for (; mask != 0u; mask &= mask - 1u) n++;
    return n;
}

/* Which later seams each seam meets once those before it are gone, a bit each; false if they are
 * too many. */
static bool find_later(const palp_zones *z, uint64_t later[PALP_MAX_SEAMS]) {
    uint32_t n = z->meta->seams;
    for (uint32_t s = 0; s < n; s++) {
        later[s] = 0;
        for (uint32_t t = s + 1u; t < n; t++) later[s] |= meet(z, s, t) ? 1ull << t : 0u;
    }
    for (uint32_t s = 0; s < n; s++) {
        if (count_of(later[s]) > PALP_MAX_PARTNERS) return false;
        for (uint32_t t = s + 1u; t < n; t++) { /* what its elimination fills */
            if ((later[s] >> t & 1u) != 0u) later[t] |= later[s] >> t >> 1u << t << 1u;
        }
    }
    return true;
}

/* Floats of all blocks on a level; `link` gets where each begins, unless it is NULL. */
static size_t place_blocks(const palp_seams *q, const uint64_t later[PALP_MAX_SEAMS],
                           uint32_t level, palp_seam_links *link) {
    size_t blocks = 0;
    for (uint32_t s = 0; s < q->zones->meta->seams; s++) {
        uint32_t k = 0;
        for (uint32_t t = s; t < q->zones->meta->seams; t++) {
            if (t > s && (later[s] >> t & 1u) == 0u) continue;
            if (link != NULL) {
                link[s].offset[k] = (uint32_t)blocks;
                if (k > 0u) link[s].other[k - 1u] = (uint8_t)t;
                link[s].count = (uint8_t)k;
            }
            k++;
            size_t size = (size_t)unknowns(q, s, level) * unknowns(q, t, level);
            blocks += (size + 15u) / 16u * 16u;
        }
    }
    return blocks;
}

static void lay_out_factor(palp_seams *q, const uint64_t later[PALP_MAX_SEAMS], uint32_t level,
                           palp_seam_factor *f, palp_arena *arena) {
    const uint32_t n = q->zones->meta->seams;
    f->link = palp_take(arena, n, sizeof *f->link);
    f->block = palp_take(arena, place_blocks(q, later, level, f->link), sizeof(float));
    f->relative = palp_take(arena, n, sizeof(palp_frame));
}

/* Level of the rest factor k. */
static uint32_t rest_level(uint32_t k) { return k == PALP_SEAM_LEVELS ? PALP_DIAGONAL : k; }

static void lay_out(palp_seams *q, const uint64_t later[PALP_MAX_SEAMS], palp_arena *arena) {
    const palp_zones *z = q->zones;
    uint32_t n = z->meta->seams, most = 0;
    q->modes = 0;
    for (uint32_t s = 0; s < n; s++) {
        q->first_mode[s] = q->modes;
        q->modes += palp_seam_modes(q, s, q->finest);
        size_t side = unknowns(q, s, PALP_DIAGONAL);
        q->sample[s] = palp_take_rows(arena, PALP_DIAGONAL_SAMPLES * side, side, sizeof(float));
    }
    for (uint32_t i = 0; i < z->meta->zones; i++)
        most = z->zone[i].modes > most ? z->zone[i].modes : most;
    q->spare = palp_take(arena, 1, sizeof *q->spare);
    for (uint32_t k = 0; k < 2; k++) lay_out_factor(q, later, q->finest, &q->factor[k], arena);
    for (uint32_t k = 0; k <= PALP_SEAM_LEVELS; k++) {
        if (k <= q->finest || k == PALP_SEAM_LEVELS)
            lay_out_factor(q, later, rest_level(k), &q->rest[k], arena);
    }
    for (uint32_t k = 0; k < 4; k++) q->work[k] = palp_take(arena, 3u * q->modes, sizeof(float));
    q->zone_modes = palp_take(arena, 3u * most, sizeof(float));
    q->zone_forces = palp_take(arena, 3u * most, sizeof(float));
}

size_t palp_seams_memsize(const palp_zones *zones, uint32_t finest) {
    palp_seams q = {.zones = zones, .finest = finest};
    uint64_t later[PALP_MAX_SEAMS];
    palp_arena arena = {0};
    if (finest >= PALP_SEAM_LEVELS || !find_later(zones, later)) return 0;
    if (place_blocks(&q, later, finest, NULL) > UINT32_MAX) return 0;
    lay_out(&q, later, &arena);
    return arena.used;
}

/* ---- assembly ---- */

static const float unit[9] = {1.0f, 0.0f, 0.0f, 0.0f, 1.0f, 0.0f, 0.0f, 0.0f, 1.0f};

/* T of a zone at a seam. */
static const float *turn(const palp_seams *q, const palp_frame *relative, uint32_t s,
                         uint32_t zone) {
    return palp_zone_is_second(q->zones, s, zone) ? relative[s].r : unit;
}

/* out := a b for 3x3 blocks, b transposed if asked. */
static void multiply(const float a[9], const float b[9], bool transposed, float out[9]) {
    for (uint32_t i = 0; i < 3; i++) {
        for (uint32_t j = 0; j < 3; j++) {
            float sum = 0.0f;
            for (uint32_t k = 0; k < 3; k++)
                sum += a[3u * i + k] * b[transposed ? 3u * j + k : 3u * k + j];
            out[3u * i + j] = sum;
        }
    }
}

/* Adds T K T'^T of one zone to the block (s, t), s <= t, of which only the upper triangle is needed
 * if s == t. */
static void add_zone(palp_seams *q, const palp_seam_factor *f, uint32_t zone, uint32_t s,
                     uint32_t a, uint32_t t, uint32_t b, float *block) {
    const palp_zone_part *part = &q->zones->part[zone];
    uint32_t rows = palp_seam_modes(q, s, f->level), columns = palp_seam_modes(q, t, f->level);
    const float *left = turn(q, f->relative, s, zone), *right = turn(q, f->relative, t, zone);
    for (uint32_t i = 0; i < rows; i++) {
        for (uint32_t j = s == t ? i : 0u; j < columns; j++) {
            float k[9], half[9];
            palp_zone_stiffness(part, part->first[a] + i, part->first[b] + j, k);
            if (left != unit) {
                multiply(left, k, false, half);
                for (uint32_t e = 0; e < 9; e++) k[e] = half[e];
            }
            if (right != unit) {
                multiply(k, right, true, half);
                for (uint32_t e = 0; e < 9; e++) k[e] = half[e];
            }
            float *at = block + (size_t)(3u * i) * 3u * columns + 3u * j;
            for (uint32_t e = 0; e < 9; e++) at[e / 3u * 3u * columns + e % 3u] += k[e];
        }
    }
    q->work_done += (s == t ? 36ull : 63ull) * rows * columns;
}

/* Assembles the blocks of row s. */
static void assemble_row(palp_seams *q, palp_seam_factor *f, uint32_t s) {
    const palp_zones *z = q->zones;
    for (uint32_t k = 0; k <= f->link[s].count; k++) {
        uint32_t t = k == 0u ? s : f->link[s].other[k - 1u];
        float *block = f->block + f->link[s].offset[k];
        size_t size = (size_t)unknowns(q, s, f->level) * unknowns(q, t, f->level);
        for (size_t e = 0; e < size; e++) block[e] = 0.0f;
        for (uint32_t side = 0; side < 2; side++) {
            uint32_t zone = z->seam[s].zone[side], a = 0, b = PALP_MAX_ZONE_SEAMS;
            const palp_zone_part *part = &z->part[zone];
            for (uint32_t i = 0; i < part->seams; i++) {
                if (part->seam[i] == s) a = i;
                if (part->seam[i] == t) b = i;
            }
            if (b < PALP_MAX_ZONE_SEAMS) add_zone(q, f, zone, s, a, t, b, block);
        }
    }
}

/* ---- factorisation ---- */

static size_t block_of(const palp_seam_factor *f, uint32_t s, uint32_t t) {
    for (uint32_t k = 0; k < f->link[s].count; k++) {
        if (f->link[s].other[k] == t) return f->link[s].offset[k + 1u];
    }
    return f->link[s].offset[0];
}

static void eliminate(palp_seams *q, palp_seam_factor *f, uint32_t s) {
    size_t n = unknowns(q, s, f->level);
    float *own = f->block + f->link[s].offset[0];
    if (palp_chol_factor(own, n, n) != PALP_OK) {
        f->sound = false;
        return;
    }
    q->work_done += n * n * n / 6u;
    for (uint32_t k = 0; k < f->link[s].count; k++) {
        size_t m = unknowns(q, f->link[s].other[k], f->level);
        palp_chol_forward_many(own, n, n, f->block + f->link[s].offset[k + 1u], m, m);
        q->work_done += n * n * m / 2u;
    }
    for (uint32_t k = 0; k < f->link[s].count; k++) {
        uint32_t t = f->link[s].other[k];
        size_t rows = unknowns(q, t, f->level);
        for (uint32_t i = k; i < f->link[s].count; i++) {
            size_t columns = unknowns(q, f->link[s].other[i], f->level);
            size_t at = i == k ? f->link[t].offset[0] : block_of(f, t, f->link[s].other[i]);
            const palp_product product = {.a = f->block + f->link[s].offset[k + 1u],
                                          .b = f->block + f->link[s].offset[i + 1u],
                                          .a_stride = rows,
                                          .b_stride = columns,
                                          .k = n,
                                          .n = rows,
                                          .m = columns};
            if (i == k)
                palp_subtract_product_upper(f->block + at, columns, &product);
            else
                palp_subtract_product(f->block + at, columns, &product);
            q->work_done += n * rows * columns / (i == k ? 2u : 1u);
        }
    }
}

/* Where the joint's value lies among the samples: below it, and the share of the one above. */
static uint32_t sample_at(const palp_joint_entry *j, float value, float *share) {
    float span = j->high - j->low;
    *share = 0.0f;
    if (!(span > 0.0f)) return 0;
    float at = (value - j->low) / span * (float)(PALP_DIAGONAL_SAMPLES - 1u);
    at = palp_clamp(at, 0.0f, (float)(PALP_DIAGONAL_SAMPLES - 1u));
    uint32_t below = (uint32_t)palp_min(at, (float)(PALP_DIAGONAL_SAMPLES - 2u));
    *share = at - (float)below;
    return below;
}

/* The approximation's own block: U of U^T U = the interpolated inverse. */
static void interpolate(palp_seams *q, palp_seam_factor *f, uint32_t s, const float *value) {
    uint32_t joint = q->zones->seam[s].joint;
    size_t n = unknowns(q, s, PALP_DIAGONAL), size = n * n;
    float *block = f->block + f->link[s].offset[0];
    float share = 0.0f;
    uint32_t below = 0;
    if (joint != PALP_NONE) below = sample_at(&q->zones->joint[joint], value[joint], &share);
    const float *a = q->sample[s] + below * size, *b = a + (share > 0.0f ? size : 0u);
    for (size_t e = 0; e < size; e++) block[e] = a[e] + share * (b[e] - a[e]);
    if (palp_chol_factor(block, n, n) != PALP_OK) f->sound = false;
    q->work_done += 2u * size + n * n * n / 6u;
}

static void begin(palp_seams *seams, palp_seam_factor *f, const palp_configuration *configuration,
                  uint32_t level) {
    uint32_t n = seams->zones->meta->seams;
    f->diagonal = level == PALP_DIAGONAL;
    f->level = f->diagonal ? PALP_DIAGONAL_LEVEL : level;
    if (f->level > seams->finest) f->level = seams->finest;
    f->sound = true;
    f->step = 0;
    f->steps = 2u * n;
    for (uint32_t s = 0; s < n; s++) f->relative[s] = configuration->relative[s];
    if (!f->diagonal) return;
    for (uint32_t s = 0; s < n; s++) interpolate(seams, f, s, configuration->value);
    f->step = f->steps;
}

void palp_seams_begin(palp_seams *seams, const palp_configuration *configuration, uint32_t level) {
    begin(seams, &seams->factor[1u - seams->now], configuration, level);
}

static bool step(palp_seams *seams, palp_seam_factor *f) {
    uint32_t n = seams->zones->meta->seams;
    if (f->step == f->steps || !f->sound) return false;
    if (f->step < n) {
        assemble_row(seams, f, f->step);
    } else {
        eliminate(seams, f, f->step - n);
    }
    f->step++;
    return f->step < f->steps && f->sound;
}

bool palp_seams_step(palp_seams *seams) { return step(seams, &seams->factor[1u - seams->now]); }

bool palp_seams_take(palp_seams *seams) {
    const palp_seam_factor *f = &seams->factor[1u - seams->now];
    if (f->step < f->steps || !f->sound) return false;
    seams->now = 1u - seams->now;
    return true;
}

palp_status palp_seams_refresh(palp_seams *seams, const palp_configuration *configuration,
                               uint32_t level) {
    palp_seams_begin(seams, configuration, level);
    /* at most 2 * seams */
    while (palp_seams_step(seams)) {}
    return palp_seams_take(seams) ? PALP_OK : PALP_ERR_NOT_SPD;
}

/* ---- solution ---- */

/* y := U y, row by row from above: no row needs what it has overwritten. */
static void apply_upper(const float *u, size_t n, float *y) {
    for (size_t i = 0; i < n; i++) {
        float sum = 0.0f;
        for (size_t j = i; j < n; j++) sum += u[i * n + j] * y[j];
        y[i] = sum;
    }
}

/* y := U^T y, from below. */
static void apply_upper_transposed(const float *u, size_t n, float *y) {
    for (size_t i = n; i-- > 0u;) {
        float sum = 0.0f;
        for (size_t j = 0; j <= i; j++) sum += u[j * n + i] * y[j];
        y[i] = sum;
    }
}

/* y -= B^T x for the n x m block b. */
static void subtract_transposed(const float *b, size_t n, size_t m, const float *x, float *y) {
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j < m; j++) y[j] -= b[i * m + j] * x[i];
    }
}

const palp_seam_factor *palp_seams_at_rest(const palp_seams *seams) {
    const palp_seam_factor *f = &seams->factor[seams->now];
    return &seams->rest[f->diagonal ? PALP_SEAM_LEVELS : f->level];
}

void palp_seams_forward(palp_seams *q, const palp_seam_factor *f, float *y, uint64_t *touched) {
    for (uint32_t s = 0; s < q->zones->meta->seams; s++) {
        if ((*touched >> s & 1u) == 0u) continue;
        size_t n = unknowns(q, s, f->level);
        float *own = y + 3u * q->first_mode[s];
        if (f->diagonal) {
            apply_upper(f->block + f->link[s].offset[0], n, own);
            q->work_done += n * n / 2u;
            continue;
        }
        palp_chol_forward(f->block + f->link[s].offset[0], n, n, own);
        q->work_done += n * n / 2u;
        for (uint32_t k = 0; k < f->link[s].count; k++) {
            uint32_t t = f->link[s].other[k];
            size_t m = unknowns(q, t, f->level);
            subtract_transposed(f->block + f->link[s].offset[k + 1u], n, m, own,
                                y + 3u * q->first_mode[t]);
            *touched |= 1ull << t;
            q->work_done += n * m;
        }
    }
}

/* apply_upper to `count` vectors. */
static void apply_upper_many(const float *u, size_t n, float *y, size_t stride, size_t count) {
    for (size_t i = 0; i < n; i++) {
        float *restrict to = y + i * stride;
        for (size_t k = 0; k < count; k++) to[k] *= u[i * n + i];
        for (size_t j = i + 1u; j < n; j++) {
            const float *restrict from = y + j * stride, w = u[i * n + j];
            for (size_t k = 0; k < count; k++) to[k] += w * from[k];
        }
    }
}

void palp_seams_forward_many(palp_seams *q, const palp_seam_factor *f, float *y, size_t stride,
                             size_t count, uint64_t *touched) {
    for (uint32_t s = 0; s < q->zones->meta->seams; s++) {
        if ((*touched >> s & 1u) == 0u) continue;
        const size_t n = unknowns(q, s, f->level);
        float *own = y + 3u * (size_t)q->first_mode[s] * stride;
        q->work_done += n * n / 2u * count;
        if (f->diagonal) {
            apply_upper_many(f->block + f->link[s].offset[0], n, own, stride, count);
            continue;
        }
        palp_chol_forward_many(f->block + f->link[s].offset[0], n, n, own, count, stride);
        for (uint32_t k = 0; k < f->link[s].count; k++) {
            const uint32_t t = f->link[s].other[k];
            const size_t m = unknowns(q, t, f->level);
            const palp_product product = {.a = f->block + f->link[s].offset[k + 1u],
                                          .b = own,
                                          .a_stride = m,
                                          .b_stride = stride,
                                          .k = n,
                                          .n = m,
                                          .m = count};
            palp_subtract_product(y + 3u * (size_t)q->first_mode[t] * stride, stride, &product);
            *touched |= 1ull << t;
            q->work_done += n * m * count;
        }
    }
}

void palp_seams_backward(palp_seams *q, const palp_seam_factor *f, float *x) {
    for (uint32_t s = q->zones->meta->seams; s-- > 0u;) {
        size_t n = unknowns(q, s, f->level);
        float *own = x + 3u * q->first_mode[s];
        q->work_done += n * n / 2u;
        if (f->diagonal) {
            apply_upper_transposed(f->block + f->link[s].offset[0], n, own);
            continue;
        }
        for (uint32_t k = 0; k < f->link[s].count; k++) {
            uint32_t t = f->link[s].other[k];
            size_t m = unknowns(q, t, f->level);
            const float *b = f->block + f->link[s].offset[k + 1u],
                        *other = x + 3u * q->first_mode[t];
            for (size_t i = 0; i < n; i++) {
                float sum = 0.0f;
                for (size_t j = 0; j < m; j++) sum += b[i * m + j] * other[j];
                own[i] -= sum;
            }
            q->work_done += n * m;
        }
        palp_chol_backward(f->block + f->link[s].offset[0], n, n, own);
    }
}

void palp_seams_solve(palp_seams *seams, float *x) {
    uint64_t all = ~0ull;
    const palp_seam_factor *f = palp_seams_factor(seams);
    palp_seams_forward(seams, f, x, &all);
    palp_seams_backward(seams, f, x);
}

/* ---- costs ---- */

#define PRICE(kind) (price->of[PALP_WORK_##kind])

/* Assembling row s: both zones' part of the diagonal block, turned, and up to two shared zones in
 * each other one; eliminating it. */
static float cost_row(const palp_seams *q, const palp_prices *price, uint32_t s, uint32_t level) {
    float n = (float)unknowns(q, s, level), entries = n * n;
    for (uint32_t k = 0; k < q->factor[0].link[s].count; k++)
        entries += n * (float)unknowns(q, q->factor[0].link[s].other[k], level);
    return PRICE(SEAM) + PRICE(SEAM_TURN) * entries;
}

static float cost_eliminate(const palp_seams *q, const palp_prices *price, uint32_t s,
                            uint32_t level) {
    float n = (float)unknowns(q, s, level), cubic = n * n * n / 6.0f, square = 2.0f * n * n;
    for (uint32_t k = 0; k < q->factor[0].link[s].count && level != PALP_DIAGONAL; k++) {
        float m = (float)unknowns(q, q->factor[0].link[s].other[k], level);
        cubic += 0.5f * n * n * m;
        square += n * m;
        for (uint32_t i = k; i < q->factor[0].link[s].count; i++)
            cubic += n * m * (float)unknowns(q, q->factor[0].link[s].other[i], level);
    }
    return PRICE(SEAM) + PRICE(SEAM_PRODUCT) * cubic + PRICE(SEAM_ROW) * square;
}

float palp_seams_cost_factor(const palp_seams *seams, const palp_prices *price, uint32_t level) {
    float sum = 0.0f;
    for (uint32_t s = 0; s < seams->zones->meta->seams; s++) {
        sum += cost_eliminate(seams, price, s, level);
        if (level != PALP_DIAGONAL) sum += cost_row(seams, price, s, level);
    }
    return sum;
}

float palp_seams_cost_step(const palp_seams *seams, const palp_prices *price, uint32_t level) {
    float most = 0.0f;
    for (uint32_t s = 0; s < seams->zones->meta->seams; s++)
        most = palp_max(most, palp_max(cost_row(seams, price, s, level),
                                       cost_eliminate(seams, price, s, level)));
    return most;
}

float palp_seams_cost_forward(const palp_seams *q, const palp_prices *price, uint32_t level) {
    float products = 0.0f;
    for (uint32_t s = 0; s < q->zones->meta->seams; s++) {
        float n = (float)unknowns(q, s, level);
        products += 0.5f * n * (n + 1.0f);
        for (uint32_t k = 0; k < q->factor[0].link[s].count && level != PALP_DIAGONAL; k++)
            products += n * (float)unknowns(q, q->factor[0].link[s].other[k], level);
    }
    return PRICE(SEAM) * (float)q->zones->meta->seams + PRICE(SEAM_PRODUCT) * products;
}

float palp_seams_cost_solve(const palp_seams *q, const palp_prices *price, uint32_t level) {
    float products = 0.0f;
    for (uint32_t s = 0; s < q->zones->meta->seams; s++) {
        float n = (float)unknowns(q, s, level);
        products += n * n;
        for (uint32_t k = 0; k < q->factor[0].link[s].count; k++)
            products += 2.0f * n * (float)unknowns(q, q->factor[0].link[s].other[k], level);
    }
    for (uint32_t z = 0; z < q->zones->meta->zones; z++) {
        const palp_zone_part *part = &q->zones->part[z];
        float n = 0.0f;
        for (uint32_t k = 0; k < part->seams; k++) n += (float)unknowns(q, part->seam[k], level);
        products += n * n + 30.0f * n;
    }
    return PRICE(SEAM) * (float)q->zones->meta->seams + PRICE(SEAM_MODE) * (float)q->modes +
           PRICE(SEAM_DOT) * products;
}

/* ---- opening ---- */

/* Inverses of the diagonal block of seam s at each sample of its joint. */
static bool make_samples(palp_seams *q, uint32_t s) {
    palp_seam_factor *f = &q->factor[1];
    uint32_t joint = q->zones->seam[s].joint;
    size_t n = unknowns(q, s, PALP_DIAGONAL);
    float value[PALP_MAX_JOINTS] = {0}, *block = f->block + f->link[s].offset[0];
    palp_configuration *configuration = q->spare;
    palp_configuration_rest(configuration, q->zones);
    f->level = PALP_DIAGONAL_LEVEL < q->finest ? PALP_DIAGONAL_LEVEL : q->finest;
    for (uint32_t k = 0; k < PALP_DIAGONAL_SAMPLES; k++) {
        float *inverse = q->sample[s] + k * n * n;
        if (joint != PALP_NONE) {
            const palp_joint_entry *j = &q->zones->joint[joint];
            float share = (float)k / (float)(PALP_DIAGONAL_SAMPLES - 1u);
            value[joint] = j->low + share * (j->high - j->low);
            palp_configuration_set(configuration, q->zones, value, &configuration->root);
        }
        for (uint32_t t = 0; t < q->zones->meta->seams; t++)
            f->relative[t] = configuration->relative[t];
        assemble_row(q, f, s);
        if (palp_chol_factor(block, n, n) != PALP_OK) return false;
        for (size_t i = 0; i < n; i++) {
            for (size_t j = 0; j < n; j++) inverse[i * n + j] = i == j ? 1.0f : 0.0f;
            palp_chol_solve(block, n, n, inverse + i * n);
        }
    }
    return true;
}

palp_status palp_seams_init(palp_seams *q, const palp_zones *zones, uint32_t finest, void *memory,
                            size_t bytes) {
    palp_arena arena = {.base = memory};
    uint64_t later[PALP_MAX_SEAMS];
    size_t need = palp_seams_memsize(zones, finest);
    if (need == 0u) return PALP_ERR_LIMITS;
    const palp_status status = palp_check_block(memory, bytes, need);
    if (status != PALP_OK) return status;
    *q = (palp_seams){.zones = zones, .finest = finest};
    (void)find_later(zones, later);
    lay_out(q, later, &arena);
    for (uint32_t s = 0; s < zones->meta->seams; s++) {
        if (!make_samples(q, s)) return PALP_ERR_NOT_SPD;
    }
    palp_configuration_rest(q->spare, zones);
    for (uint32_t k = 0; k <= PALP_SEAM_LEVELS; k++) {
        if (k > finest && k < PALP_SEAM_LEVELS) continue;
        begin(q, &q->rest[k], q->spare, rest_level(k));
        /* at most 2 * seams */
        while (step(q, &q->rest[k])) {}
        if (!q->rest[k].sound) return PALP_ERR_NOT_SPD;
    }
    return palp_seams_refresh(q, q->spare, finest);
}
