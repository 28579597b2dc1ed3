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

palp_bus_load palp_bus_load_of(const palp_drive_config *config, uint32_t axes, float bit_rate_bps,
                               float data_rate_bps) {
    palp_drive_traffic t = palp_drive_traffic_of(config);
    float fast = config->fd ? data_rate_bps : 0.0f;
    float one = palp_frame_time_s(t.command_bytes, t.extended, bit_rate_bps, fast) +
                palp_frame_time_s(t.answer_bytes, false, bit_rate_bps, fast);
    float slow = t.slow_hz / config->rate_hz * palp_frame_time_s(8, false, bit_rate_bps, 0.0f);
    palp_bus_load load = {.cycle_s =
                              (float)axes * (one + slow) +
                              (float)t.shared * palp_frame_time_s(0, false, bit_rate_bps, 0.0f)};
    load.load = load.cycle_s * config->rate_hz;
    return load;
}
