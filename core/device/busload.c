/* SPDX-License-Identifier: MIT */
#include "busload.h"

float palp_frame_time_s(uint32_t bytes, bool extended, float bit_rate_bps, float data_rate_bps) {
    uint32_t payload = 8u * bytes, long_id = extended ? 25u : 0u;
    if (!(data_rate_bps > 0.0f))
        return (float)(47u + payload + (34u + payload - 1u) / 4u + long_id) / bit_rate_bps;
    uint32_t nominal = 17u + 4u + 12u + long_id;
    uint32_t crc = bytes > 16u ? 21u + 7u : 17u + 6u;
    uint32_t data = 5u + payload + (5u + payload) / 4u + 4u + crc + 1u;
    return (float)nominal / bit_rate_bps + (float)data / data_rate_bps;
}

palp_bus_load palp_bus_load_of(const palp_device *device) {
    const palp_drive_config *c = &device->drives;
    uint32_t axes = palp_axes(&device->kinematics);
    uint8_t highest = 0;
    for (uint32_t i = 0; i < axes; i++) {
        if (device->node_id[i] > highest) highest = device->node_id[i];
    }
    palp_drive_traffic t = palp_drive_traffic_of(c, highest);
    float bit = device->bit_rate_bps, fast = c->fd ? device->data_rate_bps : 0.0f;
    float one = palp_frame_time_s(t.command_bytes, t.command_extended, bit, fast) +
                palp_frame_time_s(t.answer_bytes, t.answer_extended, bit, fast);
    float slow = t.slow_hz / c->rate_hz * palp_frame_time_s(8, false, bit, 0.0f);
    palp_bus_load load = {.cycle_s = (float)axes * (one + slow) +
                                     (float)t.shared * palp_frame_time_s(0, false, bit, 0.0f)};
    /* encoders without a motor that speak by themselves are sent nothing */
    const uint32_t unsent = palp_drive_delay(c->protocol) > 0u ? 0u : palp_bits(device->passive);
    load.cycle_s -=
        (float)unsent * palp_frame_time_s(t.command_bytes, t.command_extended, bit, fast);
    load.load = load.cycle_s * c->rate_hz;
    return load;
}
