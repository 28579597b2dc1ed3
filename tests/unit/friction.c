/* SPDX-License-Identifier: MIT */
/*
 * Friction of a sphere on a ball against Cattaneo and Mindlin: the curve of partial slip, what is
 * left of a force that is held while the load goes up and down, the loop, Coulomb's law, and the
 * two coefficients. A twist against Lubkin's contact, solved here ring by ring; shift and twist
 * together against Coulomb's law integrated over Hertz' pressure. A groove with a sphere on both of
 * its walls against statics.
 */
#include "core/contact/friction.h"
#include "tests/models.h"
#include "tests/tap.h"
#include "port/host/parallel.h"
#include "tools/press/press.h"
#include "port/host/util.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

static palp_friction_work work;

typedef struct {
    palp_contact *contact;
    palp_tool *tool;
    palp_friction friction;
    palp_vec3 top; /* where the tool just touches */
    double turned_rad;
} pressed;

static pressed open_at(const baked *b, float mu, float sliding, uint32_t level) {
    const float radius = 3 * b->blob.meta->mean_edge_m;
    pressed p = {.tool = allocate(1, sizeof *p.tool), .top = {0, 0, 1 + radius}};
    *p.tool = palp_tool_sphere(radius);
    p.tool->friction = mu;
    p.tool->sliding = sliding;
    p.contact = contact_open(&b->blob, p.tool, 1, level);
    return p;
}

static pressed open_on(const baked *b, float mu, float sliding) {
    return open_at(b, mu, sliding, PALP_CONTACT_FINEST);
}

static void close_on(pressed *p) {
    contact_close(p->contact);
    free(p->tool);
}

/* The tool held at a depth (radii) and an offset along x; T along x over mu N. */
static double hold_turned(pressed *p, double depth, double x_m, double turn_rad) {
    const float radius = p->tool->ball[0].radius_m;
    const palp_vec3 z = {0, 0, 1};
    palp_frame at = palp_frame_turn(z, p->top, (float)turn_rad);
    at.t = p->top;
    at.t.z -= (float)depth * radius;
    const palp_contact_spring held = {.held = at};
    palp_contact_solve(p->contact, &at, &held);
    at.t.x += (float)x_m;
    palp_friction_solve(&p->friction, &work, p->contact, 0, &at, 0);
    palp_friction_settle(&p->friction, &at);
    return -(double)p->friction.force_N.x / (double)(p->tool->friction * p->contact->normal_N[0]);
}

static double hold(pressed *p, double depth, double x_m) { return hold_turned(p, depth, x_m, 0); }

static double along_x(const palp_friction *f, palp_symmetric2 c) {
    const double x = (double)f->tangent[0].x, y = (double)f->tangent[1].x;
    return x * x * (double)c.xx + 2 * x * y * (double)c.xy + y * y * (double)c.yy;
}

/* mu N, and the offsets of the contact and of the body at large at which all slips. */
static double full_force(const pressed *p) {
    return (double)(p->tool->friction * p->friction.normal_N);
}

static double full_slip(const pressed *p) {
    return 1.5 * full_force(p) * along_x(&p->friction, p->friction.region[0].near_m_per_N);
}

static double full_give(const pressed *p) {
    return full_force(p) * along_x(&p->friction, p->friction.far_m_per_N);
}

static pressed settle_at(const baked *b, double depth, float mu, float sliding) {
    pressed p = open_on(b, mu, sliding);
    for (int i = 0; i < 40; i++) (void)hold(&p, depth * fmin((i + 1) / 20.0, 1), 0);
    return p;
}

static double mindlin(double share) { return share >= 1 ? 1 : 1 - pow(1 - share, 1.5); }

static void test_curve(const baked *b) {
    pressed p = settle_at(b, 0.05, 0.5f, 0);
    const double full = full_slip(&p), give = full_give(&p);
    double worst = 0, first_slip = 2;
    for (int i = 0; i <= 150; i++) {
        const double share = i / 100.0;
        const double t = hold(&p, 0.05, share * full + mindlin(share) * give);
        worst = fmax(worst, fabs(t - mindlin(share)));
        const float all =
            2 / (p.friction.region[0].near_m_per_N.xx + p.friction.region[0].near_m_per_N.yy +
                 p.friction.far_m_per_N.xx + p.friction.far_m_per_N.yy);
        if (p.friction.sticking_N_per_m < 0.999f * all && first_slip > 1) first_slip = share;
    }
    AT_MOST(worst, 0.003, "pushed aside: T over mu N against Mindlin's curve");
    CHECK(first_slip < 0.1, "the rim slips first: from %.2f of the way to full slip", first_slip);
    close_on(&p);
}

/* To and fro by 0.8 of the way to full slip. */
static void test_loop(const baked *b) {
    pressed p = settle_at(b, 0.05, 0.5f, 0);
    const double full = full_slip(&p), give = full_give(&p), top = mindlin(0.8);
    double loop = 0, exact = 0, last = 0, last_e = 0, before = 0, off = 0;
    for (int i = 0; i <= 500; i++) {
        const double phase = i / 100.0;
        const double share = 0.8 * (i <= 100 ? phase : fabs(fmod(phase - 1, 4) - 2) - 1);
        double e = mindlin(share);
        if (i > 100) e = top - 2 * mindlin((0.8 - share) / 2);
        if (i > 300) e = -top + 2 * mindlin((share + 0.8) / 2);
        const double t = hold(&p, 0.05, share * full + e * give);
        if (i > 100) {
            loop += 0.5 * (t + last) * (share - before);
            exact += 0.5 * (e + last_e) * (share - before);
            off = fmax(off, fabs(t - e));
        }
        last = t;
        last_e = e;
        before = share;
    }
    AT_MOST(off, 0.006, "to and fro by 0.8 of full slip: against Mindlin and Deresiewicz");
    AT_MOST(fabs(loop / exact - 1), 0.01, "and the area of the loop (%.3f of mu N times full slip)",
            exact);
    close_on(&p);
}

/*
 * The oracle for changing loads: a Hertz contact of many springs in double, in units of mu N and of
 * the offset of full slip at load 1, on a body that gives way by `give`.
 */
#define MANY 2000
typedef struct {
    double stretch[MANY], at, give;
} oracle;

static double oracle_force(const oracle *o, double z, double more) {
    double sum = 0;
    for (int i = 0; i < MANY; i++) {
        const double root = (i + 0.5) / MANY * 1.2, reach = z - root * root;
        if (reach > 0) sum += fmax(-reach, fmin(reach, o->stretch[i] + more));
    }
    return 1.5 * 1.2 / MANY * sum;
}

/* T with the tool at `x` and the load at `load`. */
static double oracle_move(oracle *o, double load, double x) {
    const double z = pow(load, 2.0 / 3);
    double low = -3, high = 3;
    for (int i = 0; i < MANY; i++) {
        const double root = (i + 0.5) / MANY * 1.2;
        if (!(z > root * root)) o->stretch[i] = 0;
    }
    for (int k = 0; k < 60; k++) { /* stretch of the material under the contact, in all */
        const double middle = 0.5 * (low + high);
        const double force = oracle_force(o, z, middle - o->at);
        if (middle + o->give * force < x)
            low = middle;
        else
            high = middle;
    }
    const double force = oracle_force(o, z, low - o->at);
    for (int i = 0; i < MANY; i++) {
        const double root = (i + 0.5) / MANY * 1.2, reach = z - root * root;
        if (reach > 0) o->stretch[i] = fmax(-reach, fmin(reach, o->stretch[i] + low - o->at));
    }
    o->at = low;
    return force;
}

#define CYCLE 100

static double load_at(int step, double swing) {
    return 1 + swing * sin(2 * 3.14159265358979 * step / CYCLE);
}

/* A tangential force of 0.3 of full slip, held at its offset while the load changes. */
static void test_held(const baked *b, double swing) {
    pressed p = settle_at(b, 0.05, 0.5f, 0);
    for (int i = 1; i <= CYCLE; i++) /* so that the contact points have been through it */
        (void)hold(&p, 0.05 * pow(load_at(i, swing), 2.0 / 3), 0);
    const double full = full_slip(&p), give = full_give(&p);
    const double share = 1 - pow(0.7, 2.0 / 3); /* of the way: T = 0.3 mu N */
    const double load = (double)p.friction.normal_N, x = share * full + 0.3 * give;
    static oracle o;
    memset(&o, 0, sizeof o);
    o.give = give / full;
    double first = 0, last = 0, low = 1e9, high = 0, off = 0;
    double begun = 0, begun_o = 0;
    for (int i = 0; i <= 30; i++) {
        (void)hold(&p, 0.05, x * i / 30.0);
        begun_o = oracle_move(&o, 1, x / full * i / 30.0);
    }
    begun = -(double)p.friction.force_N.x;
    for (int i = 1; i <= 100 * CYCLE; i++) {
        (void)hold(&p, 0.05 * pow(load_at(i, swing), 2.0 / 3), x);
        const double now = -(double)p.friction.force_N.x / begun;
        if (i <= 3 * CYCLE)
            off =
                fmax(off, fabs(now - oracle_move(&o, (double)p.friction.normal_N / load, x / full) /
                                         begun_o));
        if (i == CYCLE) first = now;
        if (i % CYCLE == 0) {
            last = now;
            low = fmin(low, last);
            high = fmax(high, last);
        }
    }
    AT_MOST(off, 0.01, "T held under +-%g %% of load (%.3f of it after a cycle): off the oracle",
            100 * swing, first);
    AT_MOST(high - low, 0.01, "and nothing more in 100 cycles: %.3f", last);
    close_on(&p);
}

/* The oracle itself: on a body that does not give way 91.5 % are left after +-20 %. */
static void test_oracle(void) {
    static oracle o;
    const double x = 1 - pow(0.7, 2.0 / 3);
    const double begun = oracle_move(&o, 1, x);
    double now = 0;
    for (int i = 1; i <= 20; i++) now = oracle_move(&o, load_at(CYCLE / 20 * i, 0.2), x) / begun;
    AT_MOST(fabs(now - 0.915), 5e-3, "the oracle after +-20 %% of load on a half-space");
}

static void test_two_coefficients(const baked *b) {
    pressed p = settle_at(b, 0.05, 0.5f, 0.3f);
    const double full = full_slip(&p);
    double most = 0, last = 0, again = 0;
    for (int i = 0; i <= 4000; i++) {
        last = hold(&p, 0.05, i * 0.02 * full);
        most = fmax(most, last);
    }
    const double end = 4000 * 0.02 * full;
    for (int i = 0; i <= 400; i++) again = fmin(again, hold(&p, 0.05, end - i * 0.02 * full));
    CHECK(most > 0.95 && most < 1.0001, "breaks loose at %.3f of the static force", most);
    AT_MOST(fabs(last - 0.6), 0.01, "slides at 0.3 of 0.5: T over mu N off by");
    CHECK(again < -0.95, "sticks as before when it turns round: %.3f", again);
    p.tool->sliding = 0.6f;
    CHECK(!palp_tool_is_sound(p.tool), "more than the static coefficient is refused");
    close_on(&p);
}

/* A tool that lifts forgets, one that is only pressed less does not. */
static void test_lift(const baked *b) {
    pressed p = settle_at(b, 0.05, 0.5f, 0);
    const double full = full_slip(&p);
    for (int i = 0; i <= 30; i++) (void)hold(&p, 0.05, 0.2 * full * i / 30.0);
    (void)hold(&p, -0.01, 0.2 * full);
    const double after = hold(&p, 0.05, 0.2 * full);
    AT_MOST(fabs(after), 1e-6, "lifted and put down again: no force left");
    close_on(&p);
}

/* ---- a twist ---- */

/* a of Hertz, by the load and the body's constants. */
static double hertz_radius(const pressed *p, const baked *b) {
    const double nu = (double)b->blob.meta->poisson, r = (double)p->tool->ball[0].radius_m;
    const double e = (double)b->blob.meta->young_Pa / (1 - nu * nu), round = r / (1 + r);
    return cbrt(0.75 * (double)p->friction.normal_N * round / e);
}

/*
 * Torsion of a half-space by rings in double: u = 1/(2 pi G) int tau s ds int cos f / |r - s| df.
 * What sticks turns as one, what slips carries mu p (Hertz); the stick radius is a ring's edge.
 */
#define RINGS 160
static double ring_edge(int k) { return sin(k * M_PI_2 / RINGS); }
static double ring_middle(int k) { return 0.5 * (ring_edge(k) + ring_edge(k + 1)); }

/* int_0^2pi cos f / sqrt(r^2 + s^2 - 2 r s cos f) df by the arithmetic-geometric mean. */
static double ring_kernel(double r, double s) {
    const double m = 4 * r * s / ((r + s) * (r + s));
    double a = 1, g = sqrt(fmax(1 - m, 1e-15)), sum = 0.5 * m, power = 0.5;
    for (int k = 0; k < 12; k++) {
        const double c = 0.5 * (a - g), next = 0.5 * (a + g);
        g = sqrt(a * g);
        a = next;
        power *= 2;
        sum += power * c * c;
    }
    const double first = M_PI_2 / a, second = first * (1 - sum);
    return 4 / (r + s) * ((2 / m - 1) * first - 2 / m * second);
}

/* Of a ring on a place, by points that crowd towards the place if it lies in the ring. */
static double ring_on(double r, int ring) {
    const double low = ring_edge(ring), high = ring_edge(ring + 1);
    const bool inside = r > low && r < high;
    double sum = 0;
    for (int half = 0; half < 2; half++) {
        const double end = half == 0 ? low : high, from = inside ? r : 0.5 * (low + high);
        for (int k = 0; k < 24; k++) {
            const double t = (k + 0.5) / 24;
            const double s = from + (end - from) * (inside ? t * t * t : t);
            sum += s * ring_kernel(r, s) * fabs(end - from) * (inside ? 3 * t * t : 1) / 24;
        }
    }
    return sum / (2 * M_PI);
}

static void eliminate(int n, double (*a)[RINGS], double (*x)[2]) {
    for (int k = 0; k < n; k++) {
        for (int i = k + 1; i < n; i++) {
            const double f = a[i][k] / a[k][k];
            for (int j = k; j < n; j++) a[i][j] -= f * a[k][j];
            for (int e = 0; e < 2; e++) x[i][e] -= f * x[k][e];
        }
    }
    for (int k = n; k-- > 0;) {
        for (int e = 0; e < 2; e++) {
            for (int j = k + 1; j < n; j++) x[k][e] -= a[k][j] * x[j][e];
            x[k][e] /= a[k][k];
        }
    }
}

/* G a^2 / (mu N) times the turn at which `stuck` rings stick, and the moment over mu N a. */
static double ring_moment(double (*on)[RINGS], int stuck, double *turn_rad) {
    static double a[RINGS][RINGS], x[RINGS][2];
    double moment = 0;
    for (int i = 0; i < stuck; i++) {
        memcpy(a[i], on[i], sizeof a[i]);
        x[i][0] = 0;
        x[i][1] = ring_middle(i);
        for (int j = stuck; j < RINGS; j++)
            x[i][0] -= on[i][j] * 1.5 / M_PI * sqrt(1 - ring_middle(j) * ring_middle(j));
    }
    eliminate(stuck, a, x);
    const double at_rim = 1.5 / M_PI * sqrt(1 - ring_middle(stuck - 1) * ring_middle(stuck - 1));
    *turn_rad = (at_rim - x[stuck - 1][0]) / x[stuck - 1][1];
    for (int i = 0; i < RINGS; i++) {
        const double r = ring_middle(i),
                     area = M_PI * (pow(ring_edge(i + 1), 2) - pow(ring_edge(i), 2));
        moment +=
            area * r * (i < stuck ? x[i][0] + *turn_rad * x[i][1] : 1.5 / M_PI * sqrt(1 - r * r));
    }
    return moment;
}

#define SHALLOW 0.015 /* where Hertz holds */

/* The tool turns about z by turn_rad and goes along x by x_m more in so many ticks. */
static void sweep(pressed *p, int ticks, double turn_rad, double x_m, double *at_m) {
    for (int i = 0; i < ticks; i++) {
        p->turned_rad += turn_rad / ticks;
        *at_m += x_m / ticks;
        (void)hold_turned(p, SHALLOW, *at_m, p->turned_rad);
    }
}

static pressed settle_shallow(const baked *b, uint32_t level) {
    pressed p = open_at(b, 0.5f, 0, level);
    for (int i = 0; i < 400; i++) (void)hold(&p, SHALLOW * fmin((i + 1) / 20.0, 1), 0);
    return p;
}

static void test_twist(const baked *b, uint32_t level, double bound) {
    static double on[RINGS][RINGS];
    pressed p = settle_shallow(b, level);
    const double a = hertz_radius(&p, b), full = full_force(&p) * a;
    const double g = 0.5 * (double)b->blob.meta->young_Pa / (1 + (double)b->blob.meta->poisson);
    double worst = 0, turned = 0, expected = 0, first = 0, none = 0;
    for (int i = 0; i < RINGS; i++) {
        for (int j = 0; j < RINGS; j++) on[i][j] = ring_on(ring_middle(i), j);
    }
    for (int stuck = RINGS - 8; stuck > 4; stuck -= 8) {
        double to;
        expected = ring_moment(on, stuck, &to);
        to *= full / (g * a * a * a);
        sweep(&p, 60, to - turned, 0, &none);
        turned = to;
        worst = fmax(worst, fabs(-(double)p.friction.moment_Nm.z / full - expected));
        if (stuck == RINGS - 16) first = (double)p.friction.sticking_N_per_m;
    }
    AT_MOST(worst / expected, bound,
            "level %u, twisted: moment against Lubkin's contact, over that of full slip", level);
    AT_MOST(fabs(expected / (3 * M_PI / 16) - 1), 0.001,
            "which is 3 pi / 16 mu N a in the rings, too: off by");
    CHECK((double)p.friction.sticking_N_per_m < 0.7 * first,
          "it slips from the rim: sticking stiffness %.0f N/m, at first %.0f",
          (double)p.friction.sticking_N_per_m, first);
    close_on(&p);
}

/* T and moment over mu N and mu N a while the contact slides by one along x for `spin` a-radians:
 * Coulomb's law over Hertz' pressure. */
static void slide_exact(double spin, double out[2]) {
    out[0] = out[1] = 0;
    for (int i = 0; i < 400; i++) {
        for (int k = 0; k < 400; k++) {
            const double x = (i - 199.5) / 200, y = (k - 199.5) / 200, r2 = x * x + y * y;
            const double u = 1 - spin * y, v = spin * x, speed = sqrt(u * u + v * v);
            if (r2 >= 1 || speed <= 0) continue;
            const double p = 1.5 / M_PI * sqrt(1 - r2) / 40000;
            out[0] += p * u / speed;
            out[1] += p * (x * v - y * u) / speed;
        }
    }
}

static void test_slide_and_spin(const baked *b) {
    pressed p = settle_shallow(b, PALP_CONTACT_LEVELS - 1u);
    const double a = hertz_radius(&p, b), full = full_force(&p), far = 30 * full_slip(&p);
    double worst = 0, at = 0;
    for (double spin = 0.25; spin < 9; spin *= 2) {
        double exact[2];
        slide_exact(spin, exact);
        sweep(&p, 400, spin * far / a, far, &at);
        sweep(&p, 400, -spin * far / a, -far, &at);
        const double t = (double)p.friction.force_N.x / full;
        const double m = (double)p.friction.moment_Nm.z / (full * a);
        worst = fmax(worst, fmax(fabs(t - exact[0]), fabs(m - exact[1]) * 16 / (3 * M_PI)));
    }
    AT_MOST(worst, 0.13, "sliding and spinning: against Coulomb's law over Hertz' pressure");
    close_on(&p);
}

/* ---- several regions ---- */

#define GROOVE 0.25 /* half its width and its depth: walls of 45 degrees along y */
static mesh groove(void) {
    mesh m = model_box(1, 12);
    for (uint32_t i = 0; i < m.vertices; i++)
        m.x[i][2] *= 1 - fmax(0, GROOVE - fabs(m.x[i][0] - 0.5));
    return m;
}

/* Rounder than the ball at its bottom, which lies on its sides first. */
static mesh valley(void) {
    mesh m = model_box(1, 12);
    for (uint32_t i = 0; i < m.vertices; i++) {
        const double x = fmin(fabs(m.x[i][0] - 0.5) / GROOVE, 1);
        m.x[i][2] *= 1 - 0.08 * 0.5 * (1 + cos(M_PI * x));
    }
    return m;
}

/* A ball in the groove, held at a place above its bottom line. */
static pressed open_in_groove(const baked *b, float mu) {
    const float radius = 0.15f;
    pressed p = {.tool = allocate(1, sizeof *p.tool),
                 .top = {0.5f, 0.5f, 1 - (float)GROOVE + radius * sqrtf(2)}};
    *p.tool = palp_tool_sphere(radius);
    p.tool->friction = mu;
    p.contact = contact_open(&b->blob, p.tool, 1, PALP_CONTACT_FINEST);
    return p;
}

static palp_vec3 move_in_groove(pressed *p, double x, double y, double down) {
    const float radius = p->tool->ball[0].radius_m;
    const palp_frame at =
        palp_frame_at((palp_vec3){p->top.x + radius * (float)x, p->top.y + radius * (float)y,
                                  p->top.z - radius * (float)down});
    const palp_contact_spring held = {.held = at};
    palp_contact_solve(p->contact, &at, &held);
    palp_friction_solve(&p->friction, &work, p->contact, 0, &at, 0);
    palp_friction_settle(&p->friction, &at);
    return palp_scale(1 / (p->tool->friction * p->friction.normal_N), p->friction.force_N);
}

/* Slipping along all walls upwards: T up, over mu N. */
static double up_the_walls(const palp_friction *f) {
    double sum = 0;
    for (uint32_t k = 0; k < f->regions; k++) {
        const double z = (double)f->region[k].at.axis.z;
        sum += (double)f->region[k].at.normal_N * sqrt(1 - z * z);
    }
    return sum / (double)f->normal_N;
}

static void test_groove(const baked *b) {
    const double mu = 0.3, wedge = sqrt(0.5);
    pressed p = open_in_groove(b, (float)mu);
    palp_vec3 t = {0, 0, 0};
    double worst = 0;
    for (int i = 0; i <= 300; i++) {
        t = move_in_groove(&p, 0, 0, 0.1 * i / 300.0);
        if (i > 100) worst = fmax(worst, fabs((double)t.z - up_the_walls(&p.friction)));
    }
    CHECK(p.friction.regions == 2, "a ball in a groove lies on %u regions", p.friction.regions);
    AT_MOST(worst, 0.01, "pressed in, both walls slip: friction up, over mu N = %.3f, off by",
            (double)t.z);
    for (int i = 0; i <= 400; i++) t = move_in_groove(&p, 0, 0, 0.1 - 0.07 * i / 400.0);
    AT_MOST(fabs((double)t.z + up_the_walls(&p.friction)), 0.01,
            "drawn out, the same down: off by");
    for (int i = 0; i <= 400; i++) t = move_in_groove(&p, 0, 0.3 * i / 400.0, 0.03);
    AT_MOST(fabs((double)t.y + 1), 0.01,
            "along the groove: mu times the force on both walls, off by");
    AT_MOST(fabs((double)t.z), 0.03, "and nothing of it up or down");
    const double moment = (double)p.friction.moment_Nm.x;
    const double depth = 0.03 * wedge; /* of the walls in the ball */
    const double arm =
        (double)p.tool->ball[0].radius_m * (1 - depth) * wedge * mu * (double)p.friction.normal_N;
    AT_MOST(fabs(moment / arm + 1), 0.02, "its moment, by the places of the walls: off by");
    close_on(&p);
}

/* Pressed into the valley, down and up once, with a force held along it: the largest step of
 * friction in a tick over mu times that of the normal force; *most, *least: regions meanwhile. */
static double steps_in_valley(const baked *b, bool from_below, uint32_t *most, uint32_t *least) {
    pressed p = open_in_groove(b, 0.4f);
    palp_vec3 before = {0, 0, 0};
    double step = 0, normal = 0, normal_before = 0;
    contact_close(p.contact);
    *p.tool = palp_tool_sphere(0.22f);
    p.tool->friction = 0.4f;
    p.contact = contact_open(&b->blob, p.tool, 1, PALP_CONTACT_FINEST);
    p.top.z = 1.22f;
    *most = 0;
    *least = 9;
    for (int i = 0; i <= 2000; i++) {
        const double turn = M_PI * i / 1000.0, swing = from_below ? cos(turn) : -cos(turn);
        (void)move_in_groove(&p, 0, 0.006 * fmin(i / 300.0, 1), 0.385 + 0.028 * swing);
        const double force = (double)p.friction.normal_N;
        if (i > 20) {
            step = fmax(step, (double)palp_norm(palp_sub(p.friction.force_N, before)));
            normal = fmax(normal, fabs(force - normal_before));
            *most = p.friction.regions > *most ? p.friction.regions : *most;
            *least = p.friction.regions < *least ? p.friction.regions : *least;
        }
        before = p.friction.force_N;
        normal_before = force;
    }
    close_on(&p);
    return step / (0.4 * normal);
}

static void test_valley(const baked *b) {
    uint32_t most, least;
    const double together = steps_in_valley(b, false, &most, &least);
    CHECK(together < 1 && most == 2,
          "regions that grow together: largest step %.2f mu dN, %u to %u", together, least, most);
    const double apart = steps_in_valley(b, true, &most, &least);
    CHECK(apart < 1 && most == 2 && least == 1,
          "a region that comes apart: largest step %.2f mu dN, %u to %u", apart, least, most);
}

int main(void) {
    progress_quiet(1);
    const baked ball = model_bake(model_sphere(3), -0.7, 0, false, false);
    test_curve(&ball);
    test_loop(&ball);
    test_oracle();
    test_held(&ball, 0.2);
    test_held(&ball, 0.1);
    test_two_coefficients(&ball);
    test_lift(&ball);
    test_twist(&ball, PALP_CONTACT_LEVELS - 1u, 0.01);
    test_twist(&ball, PALP_CONTACT_FINEST, 0.03);
    test_slide_and_spin(&ball);
    const baked v = model_bake(groove(), 1e-6, 0, false, false);
    test_groove(&v);
    const baked round = model_bake(valley(), 1e-6, 0, false, false);
    test_valley(&round);
    return tap_done();
}
