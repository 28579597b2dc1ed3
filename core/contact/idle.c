/* SPDX-License-Identifier: MIT */
/* Before a tool that does not press, how those that do have moved the body: about the node that now
 * lies nearest to the tool, which is followed from neighbour to neighbour. */
#include "core/contact/contact_internal.h"

#define NEARBY 3.0f /* edges from the tool within which a node speaks for what is before it */

typedef struct {
    palp_contact *c;
    palp_contact_patch *patch;
    palp_far_field_sums sums;
    uint32_t body, nearest;
    float least_m2;
} idle_search;

/* A node where the last forces have moved it; counts for the fit where it is a neighbour. */
static void look_at(idle_search *s, uint32_t body, uint32_t node, bool counts) {
    palp_contact *c = s->c;
    const palp_surface *surface = &c->surface[body];
    palp_vec3 x = palp_vec3_at(surface->blob->rest_m + 3u * (size_t)node);
    if (c->frame != NULL) x = palp_carry(&c->frame[body], x);
    const palp_vec3 u =
        palp_contact_outward(c, body, palp_surface_corner(surface, node, c->level.modes, c->load));
    const palp_vec3 from = palp_sub(x, s->patch->at.t), d = palp_add(from, u);
    const float edge = surface->blob->meta->mean_edge_m;
    if (counts) palp_far_field_add(&s->sums, 1.0f, from, u, edge);
    if (palp_dot(d, d) >= s->least_m2) return;
    s->least_m2 = palp_dot(d, d);
    s->body = body;
    s->nearest = node;
}

void palp_contact_idle(palp_contact *c, palp_contact_patch *patch) {
    const palp_blob *b = c->surface[patch->near_body].blob;
    const palp_lattice *l = &patch->lattice;
    idle_search s = {.c = c, .patch = patch, .least_m2 = 1e30f};
    look_at(&s, patch->near_body, patch->near, true);
    for (uint32_t k = b->ring_offset[patch->near]; k < b->ring_offset[patch->near + 1u]; k++)
        look_at(&s, patch->near_body, b->ring[k], true);
    for (uint32_t w = 0; w < l->watched; w++)
        look_at(&s, l->watch[w].body, l->watch[w].node, false);
    patch->near_body = s.body;
    patch->near = s.nearest;
    const float size = palp_tool_size(&c->tools[patch->tool]);
    const float reach = c->extent_m[patch->tool] + NEARBY * b->meta->mean_edge_m;
    if (s.least_m2 < reach * reach)
        patch->far_field = palp_far_field_fit(&s.sums, patch->at.t);
    else /* nothing is known yet where the tool is */
        patch->far_field = (palp_far_field){.at_m = patch->at.t, .fade = 16.0f / (size * size)};
}
