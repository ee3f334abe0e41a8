/* The smoke box: a Cornell box with two mirror balls, full of even fog, and a ray caster for it. The scene
 * examples/scenes/smoke-box-homogeneous-isotropic.xml, in the host's own hands. */
#ifndef SMOKE_BOX_H
#define SMOKE_BOX_H

#include <fogbow.h>
#include <math.h>

/* A rectangle across an axis: where, which way its normal points, half its side, its colour. */
struct wall {
    int axis;
    float at, normal, half;
    float colour[3];
    int is_lamp;
};

static const struct wall walls[] = {
    {1, -1.0f, 1.0f, 1.0f, {0.725f, 0.71f, 0.68f}, 0}, /* floor */
    {1, 1.0f, -1.0f, 1.0f, {0.725f, 0.71f, 0.68f}, 0}, /* ceiling */
    {2, -1.0f, 1.0f, 1.0f, {0.725f, 0.71f, 0.68f}, 0}, /* back */
    {0, -1.0f, 1.0f, 1.0f, {0.63f, 0.065f, 0.05f}, 0}, /* left */
    {0, 1.0f, -1.0f, 1.0f, {0.14f, 0.45f, 0.091f}, 0}, /* right */
    {1, 0.998f, -1.0f, 0.3f, {0.0f, 0.0f, 0.0f}, 1},   /* the lamp, below the ceiling */
};

struct ball {
    float centre[3], radius;
    float colour[3];
};

static const struct ball balls[] = {
    {{-0.42f, -0.6f, -0.3f}, 0.4f, {0.95f, 0.93f, 0.88f}}, /* silver */
    {{0.45f, -0.68f, 0.3f}, 0.32f, {0.93f, 0.62f, 0.5f}},  /* copper */
};

static float dot(const float a[3], const float b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* The nearest surface: a fogbow_host_scene.closest_hit. Nearer than NEAREST is the one that the ray starts on. */
#define NEAREST 1e-4f

static int32_t closest_hit(void *context, const fogbow_ray *ray, fogbow_hit *hit) {
    const float *o = ray->origin, *d = ray->direction;
    float nearest = ray->length;
    int32_t found = 0;
    (void)context;
    for (size_t i = 0; i < sizeof walls / sizeof *walls; i++) {
        const struct wall *wall = &walls[i];
        int u = (wall->axis + 1) % 3, v = (wall->axis + 2) % 3;
        float t = (wall->at - o[wall->axis]) / d[wall->axis];
        if (!(t > NEAREST && t < nearest)) continue;
        if (!(fabsf(o[u] + t * d[u]) <= wall->half && fabsf(o[v] + t * d[v]) <= wall->half)) continue;
        nearest = t;
        found = 1;
        for (int k = 0; k < 3; k++) hit->normal[k] = k == wall->axis ? wall->normal : 0.0f;
        for (int k = 0; k < 3; k++) hit->reflectance[k] = wall->colour[k];
        hit->surface = FOGBOW_SURFACE_LAMBERT;
        hit->light = wall->is_lamp ? 0 : FOGBOW_NO_LIGHT;
    }
    for (size_t i = 0; i < sizeof balls / sizeof *balls; i++) {
        const struct ball *ball = &balls[i];
        float from[3] = {o[0] - ball->centre[0], o[1] - ball->centre[1], o[2] - ball->centre[2]};
        float half = dot(from, d);
        float square = half * half - dot(from, from) + ball->radius * ball->radius;
        if (!(square > 0.0f)) continue;
        float root = sqrtf(square);
        float t = -half - root > NEAREST ? -half - root : -half + root;
        if (!(t > NEAREST && t < nearest)) continue;
        nearest = t;
        found = 1;
        for (int k = 0; k < 3; k++) hit->normal[k] = (from[k] + t * d[k]) / ball->radius;
        for (int k = 0; k < 3; k++) hit->reflectance[k] = ball->colour[k];
        hit->surface = FOGBOW_SURFACE_MIRROR;
        hit->light = FOGBOW_NO_LIGHT;
    }
    hit->distance = nearest;
    return found;
}

/* The world; 0, or the first status that is an error. */
static fogbow_status smoke_box(fogbow_world **world) {
    const fogbow_properties smoke = {.absorption = {0.03f, 0.03f, 0.03f}, .scattering = {0.57f, 0.57f, 0.57f}};
    const fogbow_box inside = {{-1.001f, -1.001f, -1.001f}, {1.001f, 1.001f, 1.001f}};
    const fogbow_light lamp = {.kind = FOGBOW_LIGHT_QUAD, .position = {-0.3f, 0.998f, -0.3f}, .edge_u = {0.6f, 0, 0},
                               .edge_v = {0, 0, 0.6f}, .emission = {15, 13, 10}};
    const fogbow_host_scene scene = {.size = sizeof scene, .closest_hit = closest_hit};
    fogbow_medium *fog = NULL, *placed = NULL;
    fogbow_status status = fogbow_medium_homogeneous(&smoke, &fog);
    if (!status) status = fogbow_medium_in_box(fog, &inside, &placed);
    if (!status) {
        const fogbow_world_parts parts = {.size = sizeof parts, .medium = placed, .scene = &scene, .lights = &lamp,
                                          .light_count = 1, .bounds = inside};
        status = fogbow_world_new(&parts, world);
    }
    fogbow_medium_free(fog);
    fogbow_medium_free(placed);
    return status;
}

static const fogbow_camera smoke_box_camera = {{0, 0, 4}, {0, 0, 0}, {0, 1, 0}, 0.62831853f, 1};

#endif
