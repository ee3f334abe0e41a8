/* An atrium: a hall of stone with columns and a roof of beams, thin haze, the sun and the sky; and a ray caster for it. */
#ifndef ATRIUM_H
#define ATRIUM_H

#include <fogbow.h>
#include <math.h>

/* A parallelogram: a corner, two edges, the unit normal on the side of u x v, its colour. */
struct panel {
    float corner[3], u[3], v[3], normal[3];
    const float *colour;
};

static const float stone[3] = {0.6f, 0.55f, 0.45f}, tiles[3] = {0.35f, 0.3f, 0.28f}, glaze[3] = {0.2f, 0.35f, 0.6f};
static const float ball_centre[3] = {4.0f, 0.8f, 6.0f}, ball_radius = 0.8f;

#define PANELS (5 + 6 + 6 * 8)
static struct panel panels[PANELS];
static int panel_count;

static float dot(const float a[3], const float b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void cross(const float a[3], const float b[3], float c[3]) {
    for (int k = 0; k < 3; k++) c[k] = a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3];
}

static void add_panel(float x, float y, float z, float ux, float uy, float uz, float vx, float vy, float vz, const float *colour) {
    struct panel panel = {{x, y, z}, {ux, uy, uz}, {vx, vy, vz}, {0, 0, 0}, colour};
    float normal[3];
    cross(panel.u, panel.v, normal);
    float length = sqrtf(dot(normal, normal));
    for (int k = 0; k < 3; k++) panel.normal[k] = normal[k] / length;
    panels[panel_count++] = panel;
}

static void build(void) {
    /* Corners of a column of eight sides, and of the next one along. */
    static const float ring[9][2] = {{0.3f, 0},        {0.2125f, 0.2125f},   {0, 0.3f},  {-0.2125f, 0.2125f}, {-0.3f, 0},
                                     {-0.2125f, -0.2125f}, {0, -0.3f}, {0.2125f, -0.2125f}, {0.3f, 0}};
    panel_count = 0;
    add_panel(0, 0, 0, 0, 0, 12, 8, 0, 0, tiles);
    add_panel(0, 0, 0, 0, 5, 0, 0, 0, 12, stone);
    add_panel(8, 0, 0, 0, 0, 12, 0, 5, 0, stone);
    add_panel(0, 0, 0, 8, 0, 0, 0, 5, 0, stone);
    add_panel(0, 0, 12, 0, 5, 0, 8, 0, 0, stone);
    for (int z = 0; z < 12; z += 2) add_panel(0, 5, (float)z, 8, 0, 0, 0, 0, 1.25f, stone);
    for (int x = 2; x < 8; x += 4) {
        for (int z = 2; z < 12; z += 4) {
            for (int i = 0; i < 8; i++) {
                const float *a = ring[i], *b = ring[i + 1];
                add_panel((float)x + a[0], 0, (float)z + a[1], 0, 5, 0, b[0] - a[0], 0, b[1] - a[1], stone);
            }
        }
    }
}

/* The nearest surface: a fogbow_host_scene.closest_hit. Nearer than NEAREST is the one that the ray starts on. */
#define NEAREST 1e-4f

static int32_t closest_hit(void *context, const fogbow_ray *ray, fogbow_hit *hit) {
    const float *o = ray->origin, *d = ray->direction;
    const struct panel *panel = NULL;
    float nearest = ray->length;
    (void)context;
    for (int i = 0; i < panel_count; i++) {
        /* Moeller and Trumbore 1997. */
        const struct panel *at = &panels[i];
        const float from[3] = {o[0] - at->corner[0], o[1] - at->corner[1], o[2] - at->corner[2]};
        float p[3], q[3];
        cross(d, at->v, p);
        cross(from, at->u, q);
        float determinant = dot(at->u, p);
        float t = dot(at->v, q) / determinant, u = dot(from, p) / determinant, v = dot(d, q) / determinant;
        if (!(t > NEAREST && t < nearest && u >= 0 && u <= 1 && v >= 0 && v <= 1)) continue;
        nearest = t;
        panel = at;
    }
    const float from[3] = {o[0] - ball_centre[0], o[1] - ball_centre[1], o[2] - ball_centre[2]};
    float half = dot(from, d);
    float root = sqrtf(half * half - dot(from, from) + ball_radius * ball_radius);
    float t = -half - root > NEAREST ? -half - root : -half + root;
    /* No root is no number, which is not greater than anything. */
    int is_ball = t > NEAREST && t < nearest;
    if (is_ball) nearest = t;
    hit->surface = FOGBOW_SURFACE_LAMBERT;
    hit->light = FOGBOW_NO_LIGHT;
    hit->distance = nearest;
    for (int k = 0; k < 3; k++) {
        hit->normal[k] = is_ball ? (from[k] + t * d[k]) / ball_radius : panel ? panel->normal[k] : 0.0f;
        hit->reflectance[k] = is_ball ? glaze[k] : panel ? panel->colour[k] : 0.0f;
    }
    return is_ball || panel;
}

/* The world; 0, or the first status that is an error. */
static fogbow_status atrium(fogbow_world **world) {
    const fogbow_properties haze = {.absorption = {0.01f, 0.01f, 0.01f},
                                    .scattering = {0.08f, 0.08f, 0.08f},
                                    .phase = {.kind = FOGBOW_PHASE_HENYEY_GREENSTEIN, .g = 0.6f}};
    const fogbow_box inside = {{0, 0, 0}, {8, 5, 12}};
    const fogbow_light lights[] = {{.kind = FOGBOW_LIGHT_SUN, .direction = {-0.36f, -0.8f, -0.48f}, .emission = {30, 27, 22}},
                                   {.kind = FOGBOW_LIGHT_SKY, .emission = {0.4f, 0.6f, 1}}};
    const fogbow_host_scene scene = {.size = sizeof scene, .closest_hit = closest_hit};
    fogbow_medium *fog = NULL, *placed = NULL;
    build();
    fogbow_status status = fogbow_medium_homogeneous(&haze, &fog);
    if (!status) status = fogbow_medium_in_box(fog, &inside, &placed);
    if (!status) {
        const fogbow_world_parts parts = {.size = sizeof parts, .medium = placed, .scene = &scene, .lights = lights,
                                          .light_count = 2, .bounds = inside};
        status = fogbow_world_new(&parts, world);
    }
    fogbow_medium_free(fog);
    fogbow_medium_free(placed);
    return status;
}

static const fogbow_camera atrium_camera = {{4, 1.7f, 11}, {4, 2, 0}, {0, 1, 0}, 1.1f, 1};

#endif
