/* SPDX-License-Identifier: MIT */
/*
 * Friction of a sphere on a ball against Cattaneo and Mindlin: the curve of partial slip, what is
 * left of a force that is held while the load goes up and down, the loop, Coulomb's law, and the
 * two coefficients.
 */
#include "core/contact/friction.h"
#include "tests/models.h"
#include "tests/tap.h"
#include "tools/parallel.h"
#include "tools/press.h"
#include "tools/util.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    palp_contact *contact;
    palp_tool *tool;
    palp_friction friction;
    palp_vec3 top; /* where the tool just touches */
} pressed;

static pressed open_on(const baked *b, float mu, float sliding) {
    const float radius = 3 * b->blob.meta->mean_edge_m;
    pressed p = {.tool = allocate(1, sizeof *p.tool), .top = {0, 0, 1 + radius}};
    *p.tool = palp_tool_sphere(radius);
    p.tool->friction = mu;
    p.tool->sliding = sliding;
    p.contact = press_open(&b->blob, p.tool, 1, PALP_CONTACT_FINEST);
    return p;
}

static void close_on(pressed *p) {
    press_close(p->contact);
    free(p->tool);
}

/* The tool held at a depth (radii) and an offset along x; T along x over mu N. */
static double hold(pressed *p, double depth, double x_m) {
    const float radius = p->tool->ball[0].radius_m;
    palp_vec3 at = p->top;
    at.z -= (float)depth * radius;
    const palp_contact_spring held = {.held_m = at};
    palp_contact_solve(p->contact, &at, &held);
    at.x += (float)x_m;
    palp_friction_solve(&p->friction, p->contact, 0, at, 0);
    palp_friction_settle(&p->friction, at);
    return -(double)p->friction.force_N.x / (double)(p->tool->friction * p->contact->normal_N[0]);
}

static double along_x(const palp_friction *f, palp_symmetric2 c) {
    const double x = (double)f->tangent[0].x, y = (double)f->tangent[1].x;
    return x * x * (double)c.xx + 2 * x * y * (double)c.xy + y * y * (double)c.yy;
}

/* mu N, and the offsets of the contact and of the body at large at which all slips. */
static double full_force(const pressed *p) {
    return (double)(p->tool->friction * p->friction.normal_N);
}

static double full_slip(const pressed *p) {
    return 1.5 * full_force(p) * along_x(&p->friction, p->friction.near_m_per_N);
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
        const float all = 2 / (p.friction.near_m_per_N.xx + p.friction.near_m_per_N.yy +
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
    return tap_done();
}
