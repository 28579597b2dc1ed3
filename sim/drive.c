/* SPDX-License-Identifier: MIT */
#include "sim/drive.h"
#include "core/device/moteus.h"
#include "core/device/odrive.h"
#include "core/device/profile.h"
#include <math.h>

#define ESTIMATOR_SHARE 0.3 /* of a new rate in the drive's velocity estimate */
#define RAD_PER_REV 6.283185307179586

void sim_drive_init(sim_drive *d, const palp_drive_config *config, uint8_t node) {
    *d = (sim_drive){.config = config,
                     .node = node,
                     .watchdog_s = (double)config->watchdog_s,
                     .axis_state = PALP_ODRIVE_IDLE,
                     .state = PALP_CIA402_DISABLED,
                     .nmt = PALP_NMT_STATE_PREOPERATIONAL,
                     .heartbeat_s = config->protocol == PALP_PROTOCOL_ODRIVE ? 0.1 : 0};
}

static void command(sim_drive *d, float torque_Nm) {
    d->torque_Nm = isfinite((double)torque_Nm) ? (double)torque_Nm : 0;
    d->since_command_s = 0;
}

static void answer(sim_drive *d, palp_can_frame frame) {
    if (d->answers < SIM_DRIVE_QUEUE) d->answer[d->answers++] = frame;
}

/* ---- ODrive ---- */

static void odrive_receive(sim_drive *d, const palp_can_frame *frame) {
    palp_odrive_message m;
    if (!palp_odrive_decode(frame, &m) || m.node != d->node) return;
    if (m.command == PALP_ODRIVE_SET_CONTROLLER_MODE) {
        d->torque_mode =
            m.control_mode == PALP_ODRIVE_TORQUE_CONTROL && m.input_mode == PALP_ODRIVE_PASSTHROUGH;
    } else if (m.command == PALP_ODRIVE_SET_AXIS_STATE) {
        d->axis_state = m.state;
        d->torque_Nm = 0;
    } else if (m.command == PALP_ODRIVE_ESTOP) {
        d->axis_state = PALP_ODRIVE_IDLE;
    } else if (m.command == PALP_ODRIVE_SET_INPUT_TORQUE) {
        command(d, m.torque_Nm);
    }
    if (d->error != 0) d->axis_state = PALP_ODRIVE_IDLE;
    d->live = d->axis_state == PALP_ODRIVE_CLOSED_LOOP && d->torque_mode;
}

static uint32_t odrive_transmit(sim_drive *d, bool heartbeat, palp_can_frame *frames) {
    palp_odrive_message m = {.node = d->node,
                             .command = PALP_ODRIVE_ENCODER_ESTIMATES,
                             .position_rev = (float)d->turns,
                             .velocity_rev_s = (float)d->turns_per_s};
    frames[0] = palp_odrive_encode(&m);
    if (!heartbeat) return 1;
    m = (palp_odrive_message){.node = d->node,
                              .command = PALP_ODRIVE_HEARTBEAT,
                              .error = d->error,
                              .state = d->axis_state};
    frames[1] = palp_odrive_encode(&m);
    return 2;
}

/* ---- CiA 402 ---- */

static void sdo_write(sim_drive *d, const palp_sdo *s) {
    if (s->index == 0x1017) d->heartbeat_s = s->value * 1e-3;
    if (s->index == 0x1016) d->watchdog_s = (s->value & 0xffff) * 1e-3;
    if (s->index == 0x6060) d->mode = (uint8_t)s->value;
    if (s->index == 0x1600 && s->sub == 0) d->rpdo_entries = (uint8_t)s->value;
    if (s->index == 0x1a00 && s->sub == 0) d->tpdo_entries = (uint8_t)s->value;
    if (s->index == 0x1400 && s->sub == 1) d->rpdo_on = (s->value >> 31) == 0;
    if (s->index == 0x1800 && s->sub == 1) d->tpdo_on = (s->value >> 31) == 0;
    if (s->index == 0x1800 && s->sub == 2) d->tpdo_type = (uint8_t)s->value;
    if (s->index == 0x6007) d->lets_go = s->value != 0;
}

static void sdo_serve(sim_drive *d, const palp_sdo *s) {
    palp_sdo a = {.index = s->index, .sub = s->sub};
    if (s->index == d->mutes) return;
    if (s->index == d->refuses) {
        a = (palp_sdo){PALP_SDO_ABORT, s->index, s->sub, 0x06020000}; /* no such object */
    } else if (s->command == PALP_SDO_READ) {
        a.command = PALP_SDO_VALUE(4);
        if (s->index == 0x6502)
            a.value = 1u << 9;
        else if (s->index == 0x6076)
            a.value = (uint32_t)(1000 * d->config->rated_torque_Nm + 0.5f);
        else if (s->index == 0x6061)
            a.value = d->mode;
        else
            a = (palp_sdo){PALP_SDO_ABORT, s->index, s->sub, 0x06020000}; /* no such object */
    } else if (s->index == 0x60c2) {
        a = (palp_sdo){PALP_SDO_ABORT, s->index, s->sub, 0x06020000};
    } else {
        a.command = PALP_SDO_WRITTEN;
        if (s->index != d->ignores) sdo_write(d, s);
    }
    answer(d, palp_sdo_encode(PALP_COB_SDO_ANSWER + d->node, a));
}

/* The power state machine, by a controlword that has just come. */
static void cia402_control(sim_drive *d, uint32_t word) {
    bool reset_edge = (word & 0x80u) != 0 && (d->controlword & 0x80u) == 0;
    d->controlword = (uint16_t)word;
    if (d->error != 0 || d->timed_out) d->state = PALP_CIA402_FAULT;
    if (reset_edge) d->timed_out = false;
    if (d->state == PALP_CIA402_FAULT) {
        if (reset_edge && d->error == 0) d->state = PALP_CIA402_DISABLED;
        return;
    }
    switch (word & 0x8fu) {
    case 0x06:
        d->state = PALP_CIA402_READY;
        break;
    case 0x07:
        if (d->state != PALP_CIA402_DISABLED) d->state = PALP_CIA402_SWITCHED_ON;
        break;
    case 0x0f:
        if (d->state == PALP_CIA402_SWITCHED_ON) d->state = PALP_CIA402_ENABLED;
        break;
    default:
        d->state = PALP_CIA402_DISABLED;
        break;
    }
}

static void cia402_sync(sim_drive *d) {
    bool mapped = d->rpdo_entries == 2 && d->tpdo_entries == 3 && d->rpdo_on && d->tpdo_on &&
                  d->tpdo_type == 1;
    if (d->nmt != PALP_NMT_STATE_OPERATIONAL || !mapped) return;
    cia402_control(d, d->controlword);
    d->live = d->state == PALP_CIA402_ENABLED && d->mode == PALP_CIA402_CST;
    d->torque_Nm = 1e-3 * d->target * (double)d->config->rated_torque_Nm;
    double counts = d->turns * (double)d->config->counts_per_rev;
    answer(d, palp_tpdo_encode(
                  d->node, palp_cia402_statusword(d->state),
                  fabs(counts) < INT32_MAX ? (int32_t)lrint(counts) : INT32_MIN,
                  (int32_t)lrint(1000 * d->actual_Nm / (double)d->config->rated_torque_Nm)));
}

static void cia402_receive(sim_drive *d, const palp_can_frame *f) {
    palp_sdo sdo;
    if (f->flags != 0) return;
    if (f->id == PALP_COB_SYNC && f->length == 0) cia402_sync(d);
    if (f->id == PALP_COB_NMT && f->length == 2 && (f->data[1] == d->node || f->data[1] == 0)) {
        if (f->data[0] == PALP_NMT_START) d->nmt = PALP_NMT_STATE_OPERATIONAL;
        if (f->data[0] == PALP_NMT_PREOPERATIONAL) d->nmt = PALP_NMT_STATE_PREOPERATIONAL;
        d->live = d->live && d->nmt == PALP_NMT_STATE_OPERATIONAL;
    }
    if (palp_sdo_decode(f, PALP_COB_SDO_REQUEST + d->node, &sdo)) sdo_serve(d, &sdo);
    if (f->id == PALP_COB_HEARTBEAT + PALP_CANOPEN_HOST) d->since_command_s = 0;
    if (palp_can_is(f, PALP_COB_RPDO1 + d->node, 0, 4) && d->nmt == PALP_NMT_STATE_OPERATIONAL) {
        uint32_t word = palp_get_u16(f->data);
        if (word != d->controlword) cia402_control(d, word);
        d->target = palp_get_i16(f->data + 2);
    }
}

/* ---- moteus ---- */

static void moteus_receive(sim_drive *d, const palp_can_frame *f) {
    palp_moteus_command c;
    if (!palp_moteus_decode_command(f, d->node, &c)) return;
    if (c.mode == PALP_MOTEUS_STOPPED) {
        d->timed_out = false;
        d->live = false;
    } else if (c.mode == PALP_MOTEUS_POSITION && !d->timed_out && d->error == 0) {
        d->live = true;
        d->watchdog_s = (double)c.timeout_s;
        command(d, fmaxf(fminf(c.torque_Nm, c.torque_max_Nm), -c.torque_max_Nm));
    }
    palp_moteus_answer a = {.mode = d->error != 0  ? PALP_MOTEUS_FAULT
                                    : d->live      ? PALP_MOTEUS_POSITION
                                    : d->timed_out ? PALP_MOTEUS_TIMEOUT
                                                   : PALP_MOTEUS_STOPPED,
                            .fault = (int32_t)d->error,
                            .position_rev = (float)d->turns,
                            .velocity_rev_s = (float)d->turns_per_s,
                            .torque_Nm = (float)d->actual_Nm};
    answer(d, palp_moteus_encode_answer(d->node, &a));
}

/* ---- MIT ---- */

static void mit_receive(sim_drive *d, const palp_can_frame *f) {
    palp_mit_command c;
    const palp_drive_config *k = d->config;
    uint8_t flags = k->fd ? PALP_CAN_FD : 0;
    if (!palp_mit_decode_command(f, d->node, flags, &k->range, &c)) return;
    if (c.kind == PALP_MIT_ENTER && d->error == 0) d->live = true;
    if (c.kind == PALP_MIT_EXIT) d->live = false;
    command(d, c.kind == PALP_MIT_COMMAND ? c.torque_Nm : 0);
    bool has_state = k->form == PALP_MIT_FORM_AUTO || k->form == PALP_MIT_FORM_STATE;
    palp_mit_answer a = {.node = d->node,
                         .state = (uint8_t)(!has_state      ? 0
                                            : d->error != 0 ? 8
                                            : d->live       ? 1
                                                            : 0),
                         .last = (uint8_t)(has_state       ? 30
                                           : d->error != 0 ? 2
                                                           : 0),
                         .is_long = k->form != PALP_MIT_FORM_SHORT,
                         .position_rad = (float)(d->turns * RAD_PER_REV),
                         .velocity_rad_s = (float)(d->turns_per_s * RAD_PER_REV),
                         .torque_Nm = (float)d->actual_Nm};
    answer(d, palp_mit_encode_answer(k->master_id, flags, &k->range, &a));
}

/* ---- Palp ---- */

static void profile_receive(sim_drive *d, const palp_can_frame *f) {
    palp_profile_command c;
    palp_e2e_verdict verdict;
    if (!palp_profile_decode_command(&d->received, f, d->node, d->config->fd, &c, &verdict)) return;
    if (verdict != PALP_E2E_OK && verdict != PALP_E2E_SOME_LOST) return;
    d->live = c.mode == PALP_MODE_TORQUE && d->error == 0;
    d->watchdog_s = c.watchdog_ms * 1e-3;
    command(d, c.mode == PALP_MODE_TORQUE ? c.torque_Nm : 0);
}

static palp_can_frame profile_status(sim_drive *d) {
    palp_profile_status s = {.state = d->error != 0 ? PALP_DRIVE_IS_FAULTED
                                      : d->live     ? PALP_DRIVE_IS_ON
                                                    : PALP_DRIVE_IS_OFF,
                             .error = d->error,
                             .position_rev = (float)d->turns,
                             .velocity_rev_s = (float)d->turns_per_s,
                             .torque_Nm = (float)d->actual_Nm};
    return palp_profile_encode_status(&d->sent, d->node, d->config->fd, &s);
}

/* ---- all of them ---- */

void sim_drive_receive(sim_drive *d, const palp_can_frame *frame) {
    switch (d->config->protocol) {
    case PALP_PROTOCOL_ODRIVE:
        odrive_receive(d, frame);
        break;
    case PALP_PROTOCOL_CIA402:
        cia402_receive(d, frame);
        break;
    case PALP_PROTOCOL_MOTEUS:
        moteus_receive(d, frame);
        break;
    case PALP_PROTOCOL_MIT:
        mit_receive(d, frame);
        break;
    case PALP_PROTOCOL_PALP:
        profile_receive(d, frame);
        break;
    }
}

void sim_drive_move(sim_drive *d, double h_s) {
    d->since_command_s += h_s;
    bool watches = d->config->protocol != PALP_PROTOCOL_CIA402 || d->lets_go;
    if (d->live && watches && d->since_command_s >= d->watchdog_s) {
        d->live = false;
        d->timed_out = true;
    }
    if (d->error != 0) d->live = false;
    double limit = (double)d->config->torque_max_Nm;
    double wanted = d->live ? fmin(fmax(d->torque_Nm, -limit), limit) : 0;
    double lag = (double)d->config->torque_lag_s;
    d->actual_Nm += (wanted - d->actual_Nm) * (lag > 0 ? 1 - exp(-h_s / lag) : 1);
}

void sim_drive_read(sim_drive *d, double turns, double dt_s) {
    double counts = (double)d->config->counts_per_rev;
    if (!isfinite(turns) || !isfinite(d->turns)) { /* a broken encoder, or one that is mended */
        d->turns = turns;
        d->turns_per_s = 0;
        return;
    }
    double read = floor(turns * counts) / counts;
    double rate = dt_s > 0 ? (read - d->turns) / dt_s : 0;
    d->turns_per_s += ESTIMATOR_SHARE * (rate - d->turns_per_s);
    d->turns = read;
}

uint32_t sim_drive_transmit(sim_drive *d, double time_s, palp_can_frame *frames) {
    palp_protocol p = d->config->protocol;
    bool heartbeat = d->heartbeat_s > 0 && time_s >= d->next_heartbeat_s;
    uint32_t n = 0;
    if (heartbeat) d->next_heartbeat_s = time_s + d->heartbeat_s;
    if (p == PALP_PROTOCOL_ODRIVE) n = odrive_transmit(d, heartbeat, frames);
    if (p == PALP_PROTOCOL_PALP) frames[n++] = profile_status(d);
    if (p == PALP_PROTOCOL_CIA402 && heartbeat)
        frames[n++] = palp_heartbeat_encode(d->node, d->nmt);
    if (p == PALP_PROTOCOL_CIA402 && d->error != d->announced) {
        d->announced = d->error;
        frames[n] = (palp_can_frame){.id = PALP_COB_EMCY + d->node, .length = 8};
        palp_put_u16(frames[n++].data, d->error);
    }
    for (uint32_t i = 0; i < d->answers; i++) frames[n++] = d->answer[i];
    d->answers = 0;
    return n;
}
