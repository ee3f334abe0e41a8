/* Fog around a lamp in a room, with the host's own ray caster: cc -std=c99 -O2 fog.c $(pkg-config --cflags --libs fogbow) -lm */
#include <fogbow.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { SIDE = 128, SAMPLES = 4 };

static void check(fogbow_status status) { if (status) exit((fprintf(stderr, "%s\n", fogbow_message()), 1)); }

/* A room from -1 to 1, red on the left and green on the right, seen from within. */
static int32_t closest_hit(void *context, const fogbow_ray *ray, fogbow_hit *hit) {
    (void)context;
    hit->distance = INFINITY;
    for (int axis = 0; axis < 3; axis++) {
        float side = ray->direction[axis] < 0 ? -1.0f : 1.0f;
        float t = (side - ray->origin[axis]) / ray->direction[axis];
        if (!(t >= 0 && t < hit->distance)) continue;
        hit->distance = t;
        for (int k = 0; k < 3; k++) hit->normal[k] = k == axis ? -side : 0;
        for (int k = 0; k < 3; k++) hit->reflectance[k] = axis ? 0.7f : k == (side > 0) ? 0.6f : 0.1f;
    }
    return hit->distance < ray->length;
}

int main(void) {
    fogbow_properties fog = {.absorption = {0.1f, 0.1f, 0.1f}, .scattering = {0.9f, 0.9f, 0.9f}, .phase = {FOGBOW_PHASE_RAYLEIGH, 0, 0}};
    fogbow_light lamp = {.kind = FOGBOW_LIGHT_POINT, .position = {-0.3f, 0.4f, 0}, .emission = {0.3f, 0.27f, 0.2f}};
    fogbow_host_scene room = {.size = sizeof room, .closest_hit = closest_hit};
    fogbow_camera camera = {.eye = {0, 0, 0.95f}, .target = {0, 0, 0}, .up = {0, 1, 0}, .field_of_view = 1.2f, .aspect = 1};
    fogbow_view view = {.size = sizeof view, .pixel = 1.2f / SIDE, .context = &camera, .ray = fogbow_camera_ray};
    fogbow_settings settings = {.size = sizeof settings, .error = 0.1f};
    fogbow_medium *medium;
    fogbow_world *world;
    fogbow_caches *caches;
    fogbow_work *work;
    check(fogbow_medium_homogeneous(&fog, &medium));
    fogbow_world_parts parts = {.size = sizeof parts, .medium = medium, .scene = &room, .lights = &lamp, .light_count = 1,
                                .bounds = {{-1, -1, -1}, {1, 1, 1}}};
    check(fogbow_world_new(&parts, &world));
    check(fogbow_caches_new(world, &settings, &caches));
    check(fogbow_fill_view(caches, world, &view, &work));
    check(fogbow_work_step(work, 0, NULL)); /* or some jobs a frame, or on threads: jobs.cpp */
    fogbow_work_free(work);
    FILE *file = fopen("fog.ppm", "wb");
    if (file) fprintf(file, "P6 %d %d 255\n", SIDE, SIDE);
    for (int i = 0; file && i < SIDE * SIDE; i++) {
        float sum[3] = {0}, light[3];
        for (uint32_t s = 0; s < SAMPLES; s++) {
            fogbow_ray ray;
            fogbow_camera_ray(&camera, (float[]){(i % SIDE + 0.25f + s % 2 * 0.5f) / SIDE, (i / SIDE + 0.25f + s / 2 * 0.5f) / SIDE}, &ray);
            check(fogbow_radiance(caches, world, &ray, 1, (fogbow_chance){.first_key = i, .sample = s}, light, NULL));
            for (int k = 0; k < 3; k++) sum[k] += light[k] / SAMPLES;
        }
        for (int k = 0; k < 3; k++) fputc((int)(255 * fminf(1, powf(sum[k], 1 / 2.2f))), file);
    }
    return file ? fogbow_caches_free(caches) | fogbow_world_free(world) | fogbow_medium_free(medium) | fclose(file) : 1;
}
