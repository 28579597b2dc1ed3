/* SPDX-License-Identifier: MIT */
#include "core/servo/setpoint.h"
#include "core/base/real.h"

#define VALUE_BYTES 4u
#define IDS 0x1fffffffu
#define FARTHEST 1e3f     /* rad or m */
#define DRIVE_FRAMES 2.0f /* a drive's tick costs less than so many frames taken */

bool palp_scene_drive_is_sound(const palp_scene_drive *d) {
    const bool finite = palp_abs(d->offset) <= FARTHEST && palp_abs(d->scale) <= FARTHEST;
    if (d->by == PALP_DRIVEN_BY_AXIS) return finite;
    return finite && d->id <= IDS && d->byte <= PALP_CAN_MAX_DATA - VALUE_BYTES &&
           d->fastest > 0.0f && d->fastest <= FARTHEST;
}

float palp_scene_drives_cost(const palp_prices *price, uint32_t drives) {
    return (float)drives * DRIVE_FRAMES * price->of[PALP_WORK_FRAME];
}

void palp_setpoint_init(palp_setpoint *s, const palp_scene_drive *d) {
    *s = (palp_setpoint){.value = d->offset, .goal = d->offset};
}

bool palp_setpoint_take(palp_setpoint *s, const palp_scene_drive *d, const palp_joint_entry *joint,
                        const palp_can_frame *frame) {
    const uint8_t kinds = PALP_CAN_EXTENDED | PALP_CAN_ERROR | PALP_CAN_REMOTE;
    const uint8_t flags = palp_can_id_flags(d->id);
    if (frame->id != d->id || (frame->flags & kinds) != flags ||
        frame->length < d->byte + VALUE_BYTES)
        return false;
    const float value = palp_get_f32(frame->data + d->byte);
    if (!palp_is_finite(value)) {
        s->left++;
        return true;
    }
    s->goal = palp_clamp(value, joint->low, joint->high);
    s->taken++;
    s->age = 0;
    return true;
}

void palp_setpoint_step(palp_setpoint *s, const palp_scene_drive *d, float dt_s) {
    const float most = d->fastest * dt_s, share = palp_min(dt_s / PALP_SETPOINT_LAG_S, 1.0f);
    s->value += palp_clamp(share * (s->goal - s->value), -most, most);
    s->age += s->age < UINT32_MAX ? 1u : 0u;
}
