/* SPDX-License-Identifier: MIT */
#include "drive.h"
#include "core/base/apart.h"
#include "core/base/real.h"
#include "core/device/cia402.h"
#include "core/device/moteus.h"
#include "core/device/odrive.h"
#include "core/device/profile.h"

#define RAD_PER_REV 6.28318530718f
#define REPEAT_S 0.1f /* what is not answered is said again */
#define SDO_TRIES 10u
#define IDLE_TICKS 8u
#define RESET_TICKS 16u /* in which a CiA 402 fault is reset, by two edges */
#define AGE_LIMIT 0x7fffffffu

static const float not_a_number = __builtin_nanf("");

uint32_t palp_drive_frame_bytes(const palp_drive_config *c) {
    if (c->protocol == PALP_PROTOCOL_MOTEUS) return PALP_CAN_MAX_DATA;
    return c->fd && c->protocol == PALP_PROTOCOL_PALP ? PALP_PROFILE_FD_STATUS
                                                      : PALP_CAN_CLASSIC_DATA;
}

void palp_drive_init(palp_drive *drive, uint8_t node) {
    palp_e2e sent = drive->sent; /* its counter goes on, or the drive would refuse what follows */
    *drive = (palp_drive){.node = node, .velocity_rev_s = not_a_number, .sent = sent};
}

static palp_rx_event heard(palp_drive *d, palp_rx_event event) {
    d->heard = true;
    d->status_age = 0;
    return event;
}

static palp_rx_event estimate(palp_drive *d, float position_rev, float velocity_rev_s) {
    d->position_rev = position_rev;
    d->velocity_rev_s = velocity_rev_s;
    return PALP_RX_ESTIMATE;
}

static uint8_t kind_of(const palp_drive_config *c) { return c->fd ? PALP_CAN_FD : 0; }

static uint32_t repeat_ticks(const palp_drive_config *c) {
    return (uint32_t)(REPEAT_S * c->rate_hz) + 1u;
}

/* ---- ODrive ---- */

/* A remote frame is a question to the drive. */
static bool odrive_is_for(const palp_drive *d, const palp_can_frame *f) {
    return f->id >> 5 == d->node && f->flags != PALP_CAN_REMOTE;
}

static palp_rx_event odrive_receive(palp_drive *d, const palp_can_frame *frame) {
    palp_odrive_message m;
    if (palp_odrive_is_telemetry(frame)) return PALP_RX_STATUS;
    if (!palp_odrive_decode(frame, &m)) return PALP_RX_BAD;
    if (m.command == PALP_ODRIVE_ENCODER_ESTIMATES)
        return estimate(d, m.position_rev, m.velocity_rev_s);
    if (m.command != PALP_ODRIVE_HEARTBEAT && m.command != PALP_ODRIVE_GET_ERROR)
        return PALP_RX_BAD;
    d->error = m.error == 0u && m.parts != 0u ? PALP_DRIVE_ERROR_PARTS | m.parts : m.error;
    if (m.command == PALP_ODRIVE_GET_ERROR) return PALP_RX_STATUS; /* but no heartbeat */
    d->enabled = m.state == PALP_ODRIVE_CLOSED_LOOP;
    d->configured = true;
    return heard(d, PALP_RX_STATUS);
}

static palp_can_frame odrive_frame(const palp_drive *d, palp_odrive_message m) {
    m.node = d->node;
    return palp_odrive_encode(&m);
}

/* Zero torque but in TORQUE, so that no old set-point acts, whatever state the drive was found in.
 */
static uint32_t odrive_send(const palp_drive *d, const palp_drive_config *c,
                            palp_drive_request request, float torque, palp_can_frame *out) {
    const palp_odrive_message mode = {.command = PALP_ODRIVE_SET_CONTROLLER_MODE,
                                      .control_mode = PALP_ODRIVE_TORQUE_CONTROL,
                                      .input_mode = PALP_ODRIVE_PASSTHROUGH};
    const palp_odrive_message clear = {.command = PALP_ODRIVE_CLEAR_ERRORS};
    const palp_odrive_message close = {.command = PALP_ODRIVE_SET_AXIS_STATE,
                                       .state = PALP_ODRIVE_CLOSED_LOOP};
    const palp_odrive_message idle = {.command = PALP_ODRIVE_SET_AXIS_STATE,
                                      .state = PALP_ODRIVE_IDLE};
    bool on = request == PALP_REQUEST_ENABLE || request == PALP_REQUEST_TORQUE;
    bool again = d->since_request % repeat_ticks(c) == 0u;
    uint32_t n = 0;
    if (request == PALP_REQUEST_ENABLE && again) {
        out[n++] = odrive_frame(d, mode);
        /* errors are cleared once: one that comes back is for the operator */
        if (d->since_request == 0u) out[n++] = odrive_frame(d, clear);
        out[n++] = odrive_frame(d, close);
        return n;
    }
    /* one that says it is still on is told every few ticks */
    if (!on && (again || (d->enabled && d->since_request % IDLE_TICKS == 0u)))
        out[n++] = odrive_frame(d, idle);
    out[n++] = odrive_frame(
        d, (palp_odrive_message){.command = PALP_ODRIVE_SET_INPUT_TORQUE, .torque_Nm = torque});
    return n;
}

/* ---- CiA 402 ---- */

static palp_cia402_step cia402_step(const palp_drive *d, const palp_drive_config *c) {
    return palp_cia402_configure(d->step, d->node, c->rate_hz,
                                 (uint32_t)(1000.0f * c->rated_torque_Nm + 0.5f),
                                 (uint32_t)(1000.0f * c->watchdog_s));
}

/* An SDO answer: the step that waits for it is done, or the drive is not the one described. */
static palp_rx_event cia402_answer(palp_drive *d, const palp_drive_config *c, palp_sdo sdo) {
    if (d->step >= PALP_CIA402_STEPS) return heard(d, PALP_RX_STATUS);
    palp_cia402_step step = cia402_step(d, c);
    bool probing = d->request == PALP_REQUEST_PROBE;
    if (probing || sdo.index != step.index || sdo.sub != step.sub) return heard(d, PALP_RX_STATUS);
    bool read = step.size == 0u, aborted = sdo.command == PALP_SDO_ABORT;
    bool answered = read ? (sdo.command & 0xe2u) == 0x42u : sdo.command == PALP_SDO_WRITTEN;
    bool right = !read || (sdo.value & step.mask) == step.value;
    if ((answered && right) || (step.optional && aborted)) {
        d->step++;
        d->waited = d->tries = 0;
        d->stuck = PALP_TROUBLE_NONE;
    } else if (aborted) {
        d->error = d->answer = sdo.value;
        d->misconfigured = true;
        d->stuck = PALP_TROUBLE_REFUSED;
    } else {
        d->stuck = PALP_TROUBLE_DIFFERENT; /* some show a new mode only later: it is read again */
        d->answer = sdo.value;
    }
    return heard(d, PALP_RX_STATUS);
}

static bool cia402_is_for(const palp_drive *d, const palp_can_frame *f) {
    const uint32_t cob = f->id - d->node;
    return cob == PALP_COB_TPDO1 || cob == PALP_COB_SDO_ANSWER || cob == PALP_COB_HEARTBEAT ||
           cob == PALP_COB_EMCY;
}

static palp_rx_event cia402_receive(palp_drive *d, const palp_drive_config *c,
                                    const palp_can_frame *f) {
    palp_sdo sdo;
    if (f->id == PALP_COB_SDO_ANSWER + d->node)
        return palp_sdo_decode(f, f->id, &sdo) ? cia402_answer(d, c, sdo) : PALP_RX_BAD;
    if (f->id == PALP_COB_HEARTBEAT + d->node) {
        if (!palp_can_is(f, f->id, 0, 1)) return PALP_RX_BAD;
        /* A drive that has restarted has forgotten its configuration; the high bit is node
         * guarding. */
        if ((f->data[0] & 0x7fu) != PALP_NMT_STATE_OPERATIONAL) d->configured = d->enabled = false;
        return heard(d, PALP_RX_STATUS);
    }
    if (f->id == PALP_COB_EMCY + d->node) {
        if (!palp_can_is(f, f->id, 0, 8)) return PALP_RX_BAD;
        d->error = palp_get_u16(f->data);
        return heard(d, PALP_RX_STATUS);
    }
    if (!palp_can_is(f, f->id, 0, 8)) return PALP_RX_BAD;
    d->statusword = palp_get_u16(f->data);
    palp_cia402_state state = palp_cia402_state_of(d->statusword);
    d->enabled = state == PALP_CIA402_ENABLED;
    if (state == PALP_CIA402_FAULT) {
        if (d->error == PALP_DRIVE_NO_ERROR) d->error = d->statusword;
    } else if (d->request == PALP_REQUEST_ENABLE) {
        d->error = PALP_DRIVE_NO_ERROR; /* the reset has worked */
    }
    if (d->step >= PALP_CIA402_STEPS) d->configured = true;
    return estimate(d, (float)palp_get_i32(f->data + 2) / c->counts_per_rev, not_a_number);
}

/* The next SDO request of the configuration, again when it is not answered. */
static uint32_t cia402_configure(palp_drive *d, const palp_drive_config *c, palp_can_frame *out) {
    if (d->step >= PALP_CIA402_STEPS) {
        uint32_t n = 0;
        if (d->waited++ % repeat_ticks(c) == 0u)
            out[n++] = palp_nmt_encode(PALP_NMT_START, d->node);
        out[n++] = palp_rpdo_encode(d->node, 0, 0); /* before the first SYNC that counts */
        return n;
    }
    if (d->misconfigured || d->waited++ % repeat_ticks(c) != 0u) return 0;
    if (d->tries++ >= SDO_TRIES) {
        if (d->stuck == PALP_TROUBLE_NONE) d->stuck = PALP_TROUBLE_SILENT;
        d->error = d->stuck == PALP_TROUBLE_SILENT ? PALP_DRIVE_ERROR_SILENT
                                                   : PALP_DRIVE_ERROR_MISCONFIGURED;
        d->misconfigured = true;
        return 0;
    }
    palp_cia402_step step = cia402_step(d, c);
    out[0] = palp_sdo_encode(
        PALP_COB_SDO_REQUEST + d->node,
        (palp_sdo){.command = step.size > 0u ? PALP_SDO_WRITE(step.size) : PALP_SDO_READ,
                   .index = step.index,
                   .sub = step.sub,
                   .value = step.size > 0u ? step.value : 0u});
    return 1;
}

/* A drive that was left operational takes a controlword and a torque of 0 before it leaves that. */
static uint32_t cia402_probe(const palp_drive *d, const palp_drive_config *c, palp_can_frame *out) {
    out[0] = palp_rpdo_encode(d->node, 0, 0);
    if (d->since_request % repeat_ticks(c) != repeat_ticks(c) / 2u) return 1;
    out[1] = palp_nmt_encode(PALP_NMT_PREOPERATIONAL, d->node);
    out[2] = palp_sdo_encode(PALP_COB_SDO_REQUEST + d->node,
                             (palp_sdo){.command = PALP_SDO_READ, .index = 0x6502});
    return 3;
}

static uint32_t cia402_send(palp_drive *d, const palp_drive_config *c, palp_drive_request request,
                            float torque, palp_can_frame *out) {
    palp_cia402_state state = palp_cia402_state_of(d->statusword);
    uint32_t controlword = 0;
    int32_t thousandths = 0;
    if (request == PALP_REQUEST_PROBE) return cia402_probe(d, c, out);
    if (request == PALP_REQUEST_CONFIGURE) return cia402_configure(d, c, out);
    if (request == PALP_REQUEST_ENABLE) {
        /* one step, or one edge of the fault reset, per four periods: status comes a period late */
        bool resets = state == PALP_CIA402_FAULT && d->since_request > RESET_TICKS;
        controlword = resets ? 0u : palp_cia402_controlword(state, d->since_request / 4u);
    } else if (request == PALP_REQUEST_TORQUE) {
        controlword = 0x0f;
        thousandths = palp_saturate(1000.0f * torque / c->rated_torque_Nm, INT16_MIN, INT16_MAX);
    }
    out[0] = palp_rpdo_encode(d->node, controlword, thousandths);
    return 1;
}

/* What the configuration is stuck at. */
static palp_drive_trouble cia402_trouble(const palp_drive *d, const palp_drive_config *c) {
    const palp_cia402_step step = cia402_step(d, c);
    return (palp_drive_trouble){.kind = d->stuck,
                                .node = d->node,
                                .written = step.size > 0u,
                                .index = step.index,
                                .sub = step.sub,
                                .value = step.value,
                                .answer = d->answer};
}

palp_drive_trouble palp_drive_trouble_of(const palp_drive *drive, const palp_drive_config *config) {
    if (!drive->heard)
        return (palp_drive_trouble){.kind = PALP_TROUBLE_SILENT, .node = drive->node};
    if (config->protocol == PALP_PROTOCOL_CIA402 && drive->misconfigured &&
        drive->step < PALP_CIA402_STEPS)
        return cia402_trouble(drive, config);
    return (palp_drive_trouble){.kind = drive->error == PALP_DRIVE_NO_ERROR ? PALP_TROUBLE_NONE
                                                                            : PALP_TROUBLE_ERROR,
                                .node = drive->node,
                                .answer = drive->error};
}

/* ---- moteus ---- */

static palp_rx_event moteus_receive(palp_drive *d, const palp_can_frame *frame) {
    palp_moteus_answer a;
    if (!palp_moteus_decode_answer(frame, d->node, &a)) return PALP_RX_BAD;
    d->enabled = a.mode == PALP_MOTEUS_POSITION;
    d->error = a.mode == PALP_MOTEUS_FAULT     ? 0x100u | ((uint32_t)a.fault & 0xffu)
               : a.mode == PALP_MOTEUS_TIMEOUT ? PALP_MOTEUS_TIMEOUT
                                               : PALP_DRIVE_NO_ERROR;
    d->configured = true;
    (void)heard(d, PALP_RX_STATUS);
    return estimate(d, a.position_rev, a.velocity_rev_s);
}

static uint32_t moteus_send(const palp_drive *d, const palp_drive_config *c,
                            palp_drive_request request, float torque, palp_can_frame *out) {
    bool on = request == PALP_REQUEST_ENABLE || request == PALP_REQUEST_TORQUE;
    /* A latched fault or timeout is cleared by a stop before anything else. */
    if (request == PALP_REQUEST_ENABLE && d->error != PALP_DRIVE_NO_ERROR) on = false;
    palp_moteus_command m = {.mode = on ? PALP_MOTEUS_POSITION : PALP_MOTEUS_STOPPED,
                             .torque_Nm = torque,
                             .torque_max_Nm = c->torque_max_Nm,
                             .timeout_s = c->watchdog_s};
    out[0] = palp_moteus_encode_command(d->node, &m);
    return 1;
}

/* ---- MIT ---- */

#define MIT_PATIENCE 10u /* ticks after "enter" in which a motor with a state says that it is on */
#define MIT_ERRORS 8u    /* codes of the AK series are below; a temperature in their place is not */

/* What form an answer has. A state that is not 0 is one; where none shows after "enter" and the
 * last byte can be an error, it is that; until then the state is believed. */
static palp_mit_form mit_form(palp_drive *d, const palp_drive_config *c, const palp_mit_answer *a) {
    if (!a->is_long) return PALP_MIT_FORM_SHORT;
    if (c->form == PALP_MIT_FORM_STATE || c->form == PALP_MIT_FORM_ERROR) return c->form;
    bool entered = d->request == PALP_REQUEST_ENABLE && d->since_request > MIT_PATIENCE;
    if (a->state != 0u)
        d->form = PALP_MIT_FORM_STATE;
    else if (d->form == PALP_MIT_FORM_AUTO && entered && a->last < MIT_ERRORS)
        d->form = PALP_MIT_FORM_ERROR;
    return d->form == PALP_MIT_FORM_ERROR ? d->form : PALP_MIT_FORM_STATE;
}

/* All answer under one id; what is no answer is bad whoever is asked. */
static bool mit_is_for(const palp_drive *d, const palp_drive_config *c, const palp_can_frame *f) {
    if (f->id != c->master_id) return false;
    const uint32_t node = palp_mit_answer_node(f);
    return node == d->node || node == PALP_MIT_NO_ANSWER || f->flags != kind_of(c);
}

static palp_rx_event mit_receive(palp_drive *d, const palp_drive_config *c,
                                 const palp_can_frame *f) {
    palp_mit_answer a;
    if (!palp_mit_decode_answer(f, c->master_id, kind_of(c), &c->range, &a)) return PALP_RX_BAD;
    /* Without a state the motor is on when it answers after "enter". */
    bool on = d->request == PALP_REQUEST_TORQUE ||
              (d->request == PALP_REQUEST_ENABLE && d->since_request > 2u);
    palp_mit_form form = mit_form(d, c, &a);
    d->enabled = form == PALP_MIT_FORM_STATE ? a.state == 1u : on;
    d->error = PALP_DRIVE_NO_ERROR;
    if (form == PALP_MIT_FORM_STATE && a.state > 1u) d->error = a.state;
    if (form == PALP_MIT_FORM_ERROR) d->error = a.last;
    d->configured = true;
    (void)heard(d, PALP_RX_STATUS);
    return estimate(d, a.position_rad / RAD_PER_REV, a.velocity_rad_s / RAD_PER_REV);
}

static uint32_t mit_send(const palp_drive *d, const palp_drive_config *c,
                         palp_drive_request request, float torque, palp_can_frame *out) {
    palp_mit_command m = {.kind = PALP_MIT_EXIT, .torque_Nm = torque};
    if (request == PALP_REQUEST_TORQUE) m.kind = PALP_MIT_COMMAND;
    if (request == PALP_REQUEST_ENABLE)
        m.kind = d->since_request % repeat_ticks(c) == 0u ? PALP_MIT_ENTER : PALP_MIT_COMMAND;
    out[0] = palp_mit_encode_command(d->node, kind_of(c), &c->range, m);
    return 1;
}

/* ---- Palp's own profile ---- */

static palp_rx_event profile_receive(palp_drive *d, const palp_drive_config *c,
                                     const palp_can_frame *f) {
    palp_profile_status s;
    palp_e2e_verdict verdict;
    if (!palp_profile_decode_status(&d->received, f, d->node, c->fd, &s, &verdict))
        return PALP_RX_BAD;
    if (verdict == PALP_E2E_REPEATED) return PALP_RX_REPEATED;
    if (verdict != PALP_E2E_OK && verdict != PALP_E2E_SOME_LOST) return PALP_RX_BAD;
    d->enabled = s.state == PALP_DRIVE_IS_ON;
    d->error = s.error != 0u                      ? s.error
               : s.state == PALP_DRIVE_IS_FAULTED ? (uint32_t)PALP_DRIVE_IS_FAULTED
                                                  : PALP_DRIVE_NO_ERROR;
    d->configured = true;
    (void)heard(d, PALP_RX_STATUS);
    (void)estimate(d, s.position_rev, s.velocity_rev_s);
    return verdict == PALP_E2E_OK ? PALP_RX_ESTIMATE : PALP_RX_GAP;
}

static uint32_t profile_send(palp_drive *d, const palp_drive_config *c, palp_drive_request request,
                             float torque, palp_can_frame *out) {
    palp_profile_command m = {.mode = PALP_MODE_OFF,
                              .watchdog_ms = (uint32_t)(1000.0f * c->watchdog_s),
                              .torque_Nm = torque};
    if (request == PALP_REQUEST_TORQUE) m.mode = PALP_MODE_TORQUE;
    if (request == PALP_REQUEST_ENABLE)
        m.mode = d->error != PALP_DRIVE_NO_ERROR ? PALP_MODE_CLEAR : PALP_MODE_TORQUE;
    out[0] = palp_profile_encode_command(&d->sent, d->node, c->fd, &m);
    return 1;
}

/* ---- all of them ---- */

static bool is_for(const palp_drive *d, const palp_drive_config *c, const palp_can_frame *f) {
    switch (c->protocol) {
    case PALP_PROTOCOL_ODRIVE:
        return odrive_is_for(d, f);
    case PALP_PROTOCOL_CIA402:
        return cia402_is_for(d, f);
    case PALP_PROTOCOL_MOTEUS:
        return f->id >> 8 == d->node;
    case PALP_PROTOCOL_MIT:
        return mit_is_for(d, c, f);
    case PALP_PROTOCOL_PALP:
        return f->id == PALP_PROFILE_STATUS + d->node;
    }
    return false;
}

/* What is for a drive is for no other one: their nodes differ. */
PALP_APART static palp_rx_event take(palp_drive *drive, const palp_drive_config *config,
                                     const palp_can_frame *frame) {
    switch (config->protocol) {
    case PALP_PROTOCOL_ODRIVE:
        return odrive_receive(drive, frame);
    case PALP_PROTOCOL_CIA402:
        return cia402_receive(drive, config, frame);
    case PALP_PROTOCOL_MOTEUS:
        return moteus_receive(drive, frame);
    case PALP_PROTOCOL_MIT:
        return mit_receive(drive, config, frame);
    case PALP_PROTOCOL_PALP:
        return profile_receive(drive, config, frame);
    }
    return PALP_RX_NONE;
}

palp_rx_event palp_drive_receive(palp_drive *drive, const palp_drive_config *config,
                                 const palp_can_frame *frame) {
    return is_for(drive, config, frame) ? take(drive, config, frame) : PALP_RX_NONE;
}

static uint32_t send_by_protocol(palp_drive *drive, const palp_drive_config *config,
                                 palp_drive_request request, float torque, palp_can_frame *out) {
    switch (config->protocol) {
    case PALP_PROTOCOL_ODRIVE:
        return odrive_send(drive, config, request, torque, out);
    case PALP_PROTOCOL_CIA402:
        return cia402_send(drive, config, request, torque, out);
    case PALP_PROTOCOL_MOTEUS:
        return moteus_send(drive, config, request, torque, out);
    case PALP_PROTOCOL_MIT:
        return mit_send(drive, config, request, torque, out);
    case PALP_PROTOCOL_PALP:
        return profile_send(drive, config, request, torque, out);
    }
    return 0;
}

uint32_t palp_drive_send(palp_drive *drive, const palp_drive_config *config,
                         palp_drive_request request, float commanded_Nm, palp_can_frame *out) {
    if (request != drive->request) {
        drive->request = request;
        drive->since_request = drive->waited = drive->tries = 0;
        if (request == PALP_REQUEST_CONFIGURE)
            drive->step = 0; /* and all that was set up counts for nothing */
        if (request == PALP_REQUEST_CONFIGURE && config->protocol == PALP_PROTOCOL_CIA402)
            drive->configured = false;
    }
    bool sound = request == PALP_REQUEST_TORQUE && palp_is_finite(commanded_Nm);
    float limit = config->torque_max_Nm;
    float torque = sound ? palp_clamp(commanded_Nm, -limit, limit) : 0.0f;
    uint32_t n = send_by_protocol(drive, config, request, torque, out);
    if (drive->since_request < AGE_LIMIT) drive->since_request++;
    if (drive->status_age < AGE_LIMIT) drive->status_age++;
    return n;
}

uint32_t palp_drive_listen(palp_drive *drive, const palp_drive_config *config,
                           palp_drive_request request, palp_can_frame *out) {
    const bool setting_up = request == PALP_REQUEST_PROBE || request == PALP_REQUEST_CONFIGURE;
    const bool again = drive->since_request % repeat_ticks(config) == 0u;
    const palp_drive_request now = setting_up ? request : PALP_REQUEST_IDLE;
    const uint32_t n = palp_drive_send(drive, config, now, 0.0f, out);
    /* those that do not answer frames speak by themselves */
    return setting_up || again || palp_drive_delay(config->protocol) > 0u ? n : 0u;
}

uint32_t palp_drives_send_shared(const palp_drive_config *config, uint64_t tick,
                                 palp_can_frame *out) {
    if (config->protocol != PALP_PROTOCOL_CIA402) return 0;
    uint32_t n = 0;
    uint32_t every = (uint32_t)(0.25f * config->watchdog_s * config->rate_hz);
    if ((uint32_t)tick % (every > 0u ? every : 1u) == 0u)
        out[n++] = palp_heartbeat_encode(PALP_CANOPEN_HOST, PALP_NMT_STATE_OPERATIONAL);
    out[n++] = (palp_can_frame){.id = PALP_COB_SYNC}; /* behind the set-points that it applies */
    return n;
}

uint32_t palp_drive_delay(palp_protocol protocol) {
    return protocol == PALP_PROTOCOL_ODRIVE || protocol == PALP_PROTOCOL_PALP ? 0u : 1u;
}

float palp_drive_heartbeat_s(palp_protocol protocol) {
    if (protocol == PALP_PROTOCOL_ODRIVE) return 0.1f;
    return protocol == PALP_PROTOCOL_CIA402 ? 1e-3f * (float)PALP_CIA402_HEARTBEAT_MS : 0.0f;
}

bool palp_drive_config_is_sound(const palp_drive_config *c) {
    bool sound = c->counts_per_rev > 0.0f && c->torque_max_Nm > 0.0f && c->rate_hz > 0.0f &&
                 c->watchdog_s >= 0.0099f && c->watchdog_s <= 0.101f && c->torque_lag_s >= 0.0f &&
                 c->torque_lag_s < 0.1f;
    switch (c->protocol) {
    case PALP_PROTOCOL_ODRIVE:
        return sound && !c->fd;
    case PALP_PROTOCOL_CIA402:
        return sound && !c->fd && c->rated_torque_Nm > 0.0f;
    case PALP_PROTOCOL_MOTEUS:
        return sound && c->fd;
    case PALP_PROTOCOL_MIT:
        return sound && c->range.position_rad > 0.0f && c->range.velocity_rad_s > 0.0f &&
               c->range.torque_Nm > 0.0f && c->master_id <= 0x7ffu;
    case PALP_PROTOCOL_PALP:
        return sound;
    }
    return false;
}

uint32_t palp_drive_filters(const palp_drive_config *config, uint8_t node,
                            palp_can_filter filter[PALP_DRIVE_FILTERS]) {
    uint32_t moteus = (uint32_t)node << 8;
    switch (config->protocol) {
    case PALP_PROTOCOL_ODRIVE:
        filter[0] = (palp_can_filter){.id = (uint32_t)node << 5, .mask = 0x7e0};
        return 1;
    case PALP_PROTOCOL_CIA402:
        filter[0] = (palp_can_filter){.id = PALP_COB_EMCY + node, .mask = 0x7ff};
        filter[1] = (palp_can_filter){.id = PALP_COB_TPDO1 + node, .mask = 0x7ff};
        filter[2] = (palp_can_filter){.id = PALP_COB_SDO_ANSWER + node, .mask = 0x7ff};
        filter[3] = (palp_can_filter){.id = PALP_COB_HEARTBEAT + node, .mask = 0x7ff};
        return 4;
    case PALP_PROTOCOL_MOTEUS:
        filter[0] =
            (palp_can_filter){.id = moteus, .mask = 0x1fffffff, .flags = palp_can_id_flags(moteus)};
        return 1;
    case PALP_PROTOCOL_MIT:
        filter[0] = (palp_can_filter){.id = config->master_id, .mask = 0x7ff};
        return 1;
    case PALP_PROTOCOL_PALP:
        filter[0] = (palp_can_filter){.id = PALP_PROFILE_STATUS + node, .mask = 0x7ff};
        return 1;
    }
    return 0;
}

palp_drive_traffic palp_drive_traffic_of(const palp_drive_config *c, uint8_t highest_node) {
    switch (c->protocol) {
    case PALP_PROTOCOL_ODRIVE:
        return (palp_drive_traffic){.command_bytes = 4, .answer_bytes = 8, .slow_hz = 10};
    case PALP_PROTOCOL_CIA402:
        return (palp_drive_traffic){
            .command_bytes = 4, .answer_bytes = 8, .shared = 1, .slow_hz = 20 + 4 / c->watchdog_s};
    case PALP_PROTOCOL_MOTEUS:
        return (palp_drive_traffic){.command_extended = true,
                                    .answer_extended = highest_node > 7u,
                                    .command_bytes = 48,
                                    .answer_bytes = 24};
    case PALP_PROTOCOL_MIT:
        return (palp_drive_traffic){.command_bytes = 8, .answer_bytes = 8};
    case PALP_PROTOCOL_PALP:
        return (palp_drive_traffic){.command_bytes = 8, .answer_bytes = c->fd ? 16 : 8};
    }
    return (palp_drive_traffic){0};
}
