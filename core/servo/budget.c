/* SPDX-License-Identifier: MIT */
#include "budget.h"

bool palp_cost_table_is_sound(const palp_cost_table *table) {
    return table->target != NULL && table->ns_per_instruction > 0.0f &&
           table->ns_per_byte >= 0.0f && table->margin > 0.0f && table->margin <= 1.0f;
}

palp_prices palp_prices_of(const palp_cost_table *table) {
    palp_prices p;
    for (uint32_t k = 0; k < PALP_WORKS; k++)
        p.of[k] = table->target->instructions.of[k] * table->ns_per_instruction +
                  palp_bytes_touched.of[k] * table->ns_per_byte;
    return p;
}
