/* SPDX-License-Identifier: MIT */
#include "port/linux/operate.h"
#include <errno.h>
#include <inttypes.h>
#include <libgen.h>
#include <spawn.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#define SELF "/proc/self/exe"

/* ---- loading ---- */

/* Whether palpd in a process of its own takes the file: what is wrong with it ends that one. */
static bool check_apart(const char *file, const char *device, const char *tool, char *why,
                        size_t room) {
    char *argv[] = {(char[]){"palpd"},         (char[]){"--check"},
                    (char *)(uintptr_t)file,   (char[]){"--bus"},
                    (char[]){"loop"},          (char[]){"--device"},
                    (char *)(uintptr_t)device, (char[]){"--tool"},
                    (char *)(uintptr_t)tool,   NULL};
    if (tool[0] == '\0') argv[7] = NULL;
    if (device[0] == '\0') argv[5] = NULL;
    int ends[2], status = 1;
    pid_t child;
    posix_spawn_file_actions_t actions;
    if (pipe(ends) != 0) return false;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, ends[1], STDERR_FILENO);
    posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", 1, 0);
    posix_spawn_file_actions_addclose(&actions, ends[0]);
    char *none[] = {NULL};
    const int error = posix_spawn(&child, SELF, &actions, NULL, argv, none);
    posix_spawn_file_actions_destroy(&actions);
    close(ends[1]);
    size_t used = 0;
    why[0] = '\0';
    for (ssize_t n; error == 0 && used + 1 < room; used += (size_t)n) {
        n = read(ends[0], why + used, room - 1 - used);
        if (n <= 0) break;
        why[used + (size_t)n] = '\0';
    }
    close(ends[0]);
    why[strcspn(why, "\n")] = '\0';
    if (error != 0) {
        snprintf(why, room, "cannot check it: %s", strerror(error));
        return false;
    }
    while (waitpid(child, &status, 0) < 0 && errno == EINTR) continue;
    return status == 0;
}

/* The present scene with another body or tool in it. */
static scene_file *scene_with(const operation *o, const scene_setup *now) {
    char *text = NULL;
    size_t bytes = 0;
    FILE *m = open_memstream(&text, &bytes);
    if (m == NULL) return NULL;
    scene_write(m, now->file);
    fclose(m);
    scene_file *f = scene_read_text("control", NULL, text);
    free(text);
    const bool tool = has_extension(o->file, ".tool");
    snprintf(f->body[0].path, sizeof f->body[0].path, "%s",
             tool ? now->file->body[0].path : o->file);
    snprintf(f->tool[0].path, sizeof f->tool[0].path, "%s",
             tool ? o->file : now->file->tool[0].path);
    f->device[0].where = tool ? SCENE_STATED : SCENE_CHOSEN;
    return f;
}

static bool same_devices(const scene_file *a, const scene_file *b) {
    bool same = a->devices == b->devices;
    for (uint32_t d = 0; d < a->devices && same; d++) {
        char *text = device_text(a->device[d].name);
        same = strcmp(text, b->device[d].text) == 0;
        free(text);
    }
    return same;
}

static load_stage refuse(operation *o, const char *why) {
    snprintf(o->said, sizeof o->said, "%s", why);
    return LOAD_REFUSED;
}

static load_stage read_next(operation *o) {
    const scene_setup *now = o->follower->loop->setup;
    const bool scene = scene_is_here(o->file);
    const bool plain = now->config.bodies == 1 && now->config.hands == 1 && now->config.tools == 1;
    const bool tool = has_extension(o->file, ".tool");
    char why[sizeof o->said];
    if (!scene && !plain)
        return refuse(o, "only a scene can take the place of one with several bodies, tools or "
                         "devices");
    const char *device = scene ? "" : now->file->device[0].name;
    if (!check_apart(tool ? now->file->body[0].path : o->file, device, tool ? o->file : "", why,
                     sizeof why))
        return refuse(o, why);
    scene_file *f = scene ? scene_read(o->file) : scene_with(o, now);
    if (f == NULL) return refuse(o, "no memory");
    if (scene && !same_devices(f, now->file)) {
        scene_free(f);
        return refuse(
            o, "it has other devices: these go on, so they must be the same, in their order");
    }
    f->rate_hz = now->file->rate_hz;
    for (uint32_t d = 0; d < f->devices; d++) {
        snprintf(f->device[d].bus, sizeof f->device[d].bus, "%s", now->file->device[d].bus);
        free(f->device[d].text);
        f->device[d].text = copy_string(now->file->device[d].text);
    }
    o->next.setup = scene_set_up(f);
    o->next.setup->config.cost = now->config.cost;
    o->next.setup->config.port = now->config.port;
    for (uint32_t d = 0; d < f->devices; d++) o->next.setup->hand[d].resume = now->hand[d].resume;
    palp_status status;
    o->next.scene = scene_try_open(o->next.setup, &status, why, sizeof why);
    if (o->next.scene != NULL) return LOAD_READ;
    scene_tear_down(o->next.setup, NULL);
    return refuse(o, why);
}

static void *read_apart(void *context) {
    operation *o = context;
    atomic_store(&o->stage, read_next(o));
    return NULL;
}

static void begin_load(operation *o, const char *file, char *answer, size_t room) {
    const load_stage stage = atomic_load(&o->stage);
    if (stage != LOAD_NONE && stage != LOAD_REFUSED) {
        snprintf(answer, room, "error %s is being loaded", o->file);
        return;
    }
    if (strlen(file) >= sizeof o->file) {
        snprintf(answer, room, "error a path of more than %zu letters", sizeof o->file - 1);
        return;
    }
    if (access(file, R_OK) != 0) {
        snprintf(answer, room, "error cannot read %.200s: %s", file, strerror(errno));
        return;
    }
    snprintf(o->file, sizeof o->file, "%s", file);
    atomic_store(&o->stage, LOAD_READING);
    if (pthread_create(&o->reader, NULL, read_apart, o) == 0) return;
    atomic_store(&o->stage, LOAD_NONE);
    snprintf(answer, room, "error no thread to read with");
}

/* Lets in what the joints of one scene, or of two while the one goes into the other, listen to; false where the
 * kernel refuses. */
static bool filter_lines(const servo_loop *l, const scene_setup *a, const scene_setup *b) {
    bool done = true;
    for (uint32_t h = 0; h < a->config.hands && !l->simulated; h++) {
        palp_can_filter filter[2 * LOOP_FILTERS];
        uint32_t n = loop_filters(a, h, l->lockstep, filter);
        if (b != NULL) n += loop_filters(b, h, l->lockstep, filter + n);
        done = can_filter_to(&l->line[h].port, filter, n) && done;
    }
    return done;
}

/* What the loop and the reader have come to. */
static void go_on(operation *o) {
    servo_loop *l = o->follower->loop;
    switch (atomic_load(&o->stage)) {
    case LOAD_READ:
        (void)pthread_join(o->reader, NULL);
        o->reader = 0;
        if (!filter_lines(l, l->setup, o->next.setup)) {
            (void)filter_lines(l, l->setup, NULL);
            scene_tear_down(o->next.setup, o->next.scene);
            atomic_store(&o->stage, refuse(o, "the kernel refused filters for its frames"));
            break;
        }
        atomic_store(&l->next, &o->next);
        atomic_store(&o->stage, LOAD_FADING);
        break;
    case LOAD_FADING: {
        loop_scene *old = atomic_exchange(&l->old, NULL);
        if (old == NULL) break;
        (void)filter_lines(l, l->setup, NULL);
        scene_tear_down(old->setup, old->scene);
        snprintf(o->scene, sizeof o->scene, "%s", o->file);
        atomic_store(&o->stage, LOAD_NONE);
        break;
    }
    case LOAD_REFUSED:
        if (o->reader != 0) (void)pthread_join(o->reader, NULL);
        o->reader = 0;
        break;
    case LOAD_NONE:
    case LOAD_READING:
        break;
    }
}

/* ---- record ---- */

static void end_record(operation *o) {
    if (!o->recording) return;
    o->follower->log = NULL;
    o->recording = false;
    commit_output(&o->record);
}

static void begin_record(operation *o, const char *file, char *answer, size_t room) {
    char folder[CONTROL_LINE];
    snprintf(folder, sizeof folder, "%s", file);
    if (o->follower->log != NULL) {
        snprintf(answer, room,
                 "error a log is being written: record off ends one that was begun here");
        return;
    }
    if (access(dirname(folder), W_OK) != 0) {
        snprintf(answer, room, "error cannot write beside %.200s: %s", file, strerror(errno));
        return;
    }
    o->record = open_output(copy_string(file));
    record_write_session(o->record.file, o->follower->loop->setup);
    o->follower->log = o->record.file;
    o->recording = true;
}

/* ---- commands ---- */

static void say_joints(const follower *f, char *answer, size_t room, size_t used) {
    const scene_setup *s = f->loop->setup;
    for (uint32_t d = 0, j = 0; d < s->config.drives && j < f->joints && used < room; d++) {
        if (s->drive[d].by != PALP_DRIVEN_BY_FRAMES) continue;
        const palp_setpoint *p = &f->joint[j++];
        used += (size_t)snprintf(answer + used, room - used,
                                 " | joint %s at %.4g, %" PRIu64 " set-points, last %.3g s ago",
                                 s->file->follow[d].joint, (double)p->value, p->taken,
                                 (double)p->age / f->record.rate_hz);
    }
}

static void say_state(const operation *o, char *answer, size_t room) {
    static const char *const stages[] = {"none", "reading", "read", "fading", "refused"};
    const follower *f = o->follower;
    const run_record *r = &f->record;
    const load_stage stage = atomic_load(&o->stage);
    size_t used =
        (size_t)snprintf(answer, room, "ok tick %" PRIu64 " scene %s load %s%s%s record %s",
                         f->last_tick, o->scene, stages[stage], stage == LOAD_REFUSED ? ": " : "",
                         stage == LOAD_REFUSED ? o->said : "", f->log != NULL ? "on" : "off");
    for (uint32_t h = 0; h < r->hands && r->count > 0 && used < room; h++) {
        const palp_report *p = &r->hand[h].tick[(f->taken - 1) % f->capacity];
        char faults[128];
        report_faults(p->faults, faults, sizeof faults);
        used += (size_t)snprintf(answer + used, room - used,
                                 " | device %" PRIu32 " %s faults %s force %.4g N", h,
                                 report_state(p->state), faults[0] != '\0' ? faults : "none",
                                 (double)palp_norm(p->force_N));
    }
    say_joints(f, answer, room, used);
}

static void obey(void *context, char *command, char *answer, size_t room) {
    operation *o = context;
    servo_loop *l = o->follower->loop;
    char *rest = command + strcspn(command, " ");
    if (*rest != '\0') *rest++ = '\0';
    rest += strspn(rest, " ");
    const bool named = rest[0] != '\0';
    if (strcmp(command, "state") == 0 && !named) {
        say_state(o, answer, room);
    } else if (strcmp(command, "reset") == 0 && !named) {
        atomic_fetch_or(&l->operator_events, PALP_EVENT_RESET | PALP_EVENT_HOME);
    } else if (strcmp(command, "stop") == 0 && !named) {
        atomic_fetch_or(&l->operator_events, PALP_EVENT_ESTOP);
    } else if (strcmp(command, "hold") == 0 && !named) {
        l->hold = true;
    } else if (strcmp(command, "load") == 0 && named) {
        begin_load(o, rest, answer, room);
    } else if (strcmp(command, "record") == 0 && strcmp(rest, "off") == 0) {
        if (!o->recording) snprintf(answer, room, "error no record was begun here");
        end_record(o);
    } else if (strcmp(command, "record") == 0 && named) {
        begin_record(o, rest, answer, room);
    } else if (strcmp(command, "end") == 0 && !named) {
        l->stop = true;
    } else {
        snprintf(answer, room,
                 "error '%.100s': there are state, reset, stop, hold, load FILE, record FILE, "
                 "record off, end",
                 command);
    }
}

void operate_begin(operation *o, follower *f, const char *path, const char *scene) {
    o->follower = f;
    snprintf(o->scene, sizeof o->scene, "%s", scene);
    control_open(&o->control, path);
    f->serve = operate_poll;
    f->context = o;
}

void operate_poll(void *context) {
    operation *o = context;
    go_on(o);
    control_poll(&o->control, obey, o);
}

void operate_end(operation *o) {
    if (o->follower == NULL) return;
    end_record(o);
    control_close(&o->control);
    if (atomic_load(&o->stage) == LOAD_READING) (void)pthread_join(o->reader, NULL);
}
