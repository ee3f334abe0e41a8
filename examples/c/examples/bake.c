/* Probes of baked light in a foggy room with a pillar, by the host's own ray caster: baked in jobs, saved, loaded, looked up.
 *   cc -std=c99 -O2 bake.c $(pkg-config --cflags --libs fogbow) -lm && ./a.out */
#include <fogbow.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

static void check(fogbow_status status) {
    if (status) {
        fprintf(stderr, "%s: %s\n", fogbow_status_text(status), fogbow_message());
        exit(1);
    }
}

/* Boxes: the room is seen from within, the pillar from outside. */
struct level {
    fogbow_box room, pillar;
};

/* Distance at which a ray enters and leaves a box, and the axes of the faces that it does so through. */
static int slabs(const fogbow_box *box, const fogbow_ray *ray, float at[2], int axes[2]) {
    at[0] = -INFINITY, at[1] = INFINITY;
    for (int axis = 0; axis < 3; axis++) {
        float a = (box->lower[axis] - ray->origin[axis]) / ray->direction[axis];
        float b = (box->upper[axis] - ray->origin[axis]) / ray->direction[axis];
        float near = a < b ? a : b, far = a < b ? b : a;
        if (near > at[0]) at[0] = near, axes[0] = axis;
        if (far < at[1]) at[1] = far, axes[1] = axis;
    }
    return at[0] < at[1];
}

static int32_t closest_hit(void *context, const fogbow_ray *ray, fogbow_hit *hit) {
    const struct level *level = context;
    float at[2];
    int axes[2] = {0, 0}, axis = -1;
    if (slabs(&level->room, ray, at, axes) && at[1] >= 0) hit->distance = at[1], axis = axes[1];
    if (slabs(&level->pillar, ray, at, axes) && at[0] >= 0 && at[0] < hit->distance) hit->distance = at[0], axis = axes[0];
    if (axis < 0 || !(hit->distance <= ray->length)) return 0;
    for (int k = 0; k < 3; k++) hit->normal[k] = k == axis ? (ray->direction[k] > 0 ? -1.0f : 1.0f) : 0.0f;
    for (int k = 0; k < 3; k++) hit->reflectance[k] = 0.6f;
    return 1;
}

int main(void) {
    struct level level = {{{-2, 0, -2}, {2, 2.5f, 2}}, {{-0.3f, 0, -0.3f}, {0.3f, 2.5f, 0.3f}}};
    const fogbow_properties smoke = {.absorption = {0.05f, 0.05f, 0.05f}, .scattering = {0.3f, 0.3f, 0.3f}};
    const fogbow_light lamp = {.kind = FOGBOW_LIGHT_POINT, .position = {-1.2f, 2, 0}, .emission = {10, 9, 7}};
    const fogbow_host_scene scene = {.size = sizeof scene, .context = &level, .closest_hit = closest_hit};
    fogbow_world_parts parts = {.size = sizeof parts, .scene = &scene, .lights = &lamp, .light_count = 1, .bounds = level.room};
    fogbow_medium *fog;
    fogbow_world *world;
    check(fogbow_medium_homogeneous(&smoke, &fog));
    parts.medium = fog;
    check(fogbow_world_new(&parts, &world));

    /* The bake, a few jobs in every frame. */
    const fogbow_bake_settings settings = {.size = sizeof settings, .spacing = 0.5f, .error = 0.1f, .photons = 1};
    fogbow_work *work;
    fogbow_probes *baked, *probes;
    check(fogbow_bake(world, NULL, &settings, &work));
    int32_t left = 1;
    for (int frame = 1; left; frame++) {
        float share;
        check(fogbow_work_step(work, 8, &left));
        check(fogbow_work_share(work, &share));
        if (frame % 4 == 0 || !left) printf("frame %d: %.0f %%\n", frame, 100 * (double)share);
    }
    check(fogbow_bake_take(work, &baked));
    check(fogbow_work_free(work));

    /* To bytes and back, as a game would do it. */
    size_t size;
    check(fogbow_probes_save(baked, 7, NULL, 0, &size));
    unsigned char *bytes = malloc(size);
    if (!bytes) return 1;
    check(fogbow_probes_save(baked, 7, bytes, size, NULL));
    check(fogbow_probes_load(7, bytes, size, &probes));
    free(bytes);

    fogbow_probes_state state = {.size = sizeof state};
    check(fogbow_probes_look(probes, &state));
    printf("%u x %u x %u probes, %zu bytes, off by %.3f\n", state.counts[0], state.counts[1], state.counts[2], size,
           (double)state.relative_error);

    /* In-scattered light across the room, towards the reader: bright beside the lamp, dark behind the pillar. */
    float first = 0, last = 0;
    for (int i = 0; i < 8; i++) {
        const float point[3] = {-1.75f + 0.5f * (float)i, 1.2f, 0}, towards[3] = {0, 0, 1};
        float light[3];
        check(fogbow_probes_value(probes, point, towards, 1, light));
        printf("x = %5.2f  %.4f\n", (double)point[0], (double)light[1]);
        if (i == 1) first = light[1];
        if (i == 6) last = light[1];
    }
    check(fogbow_probes_free(baked));
    check(fogbow_probes_free(probes));
    check(fogbow_world_free(world));
    check(fogbow_medium_free(fog));
    return first > 4 * last ? 0 : 1;
}
