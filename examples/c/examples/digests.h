/* Digests of the caches of a world and of a picture from them, which must be the same on every machine and in every language. */
#ifndef DIGESTS_H
#define DIGESTS_H

#include <fogbow.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#define SIDE 64
#define SAMPLES 2
#define TAG 1

static void check(fogbow_status status) {
    if (status) {
        fprintf(stderr, "%s: %s\n", fogbow_status_text(status), fogbow_message());
        exit(1);
    }
}

/* Fowler, Noll and Vo's, of 64 bits. */
static uint64_t digest(const void *bytes, size_t count) {
    uint64_t hash = 0xcbf29ce484222325u;
    for (size_t i = 0; i < count; i++) hash = (hash ^ ((const unsigned char *)bytes)[i]) * 0x100000001b3u;
    return hash;
}

static float picture[SIDE][SIDE][3];

static void print_digests(const fogbow_world *world, const fogbow_settings *settings, const fogbow_camera *camera) {
    const fogbow_view view = {.size = sizeof view, .pixel = 0.01f, .context = camera, .ray = fogbow_camera_ray};
    fogbow_caches *caches;
    fogbow_work *work;
    check(fogbow_caches_new(world, settings, &caches));
    check(fogbow_fill_view(caches, world, &view, &work));
    check(fogbow_work_step(work, 0, NULL));
    check(fogbow_work_free(work));

    size_t size;
    check(fogbow_caches_save(caches, TAG, NULL, 0, &size));
    unsigned char *bytes = malloc(size);
    if (!bytes) exit(1);
    check(fogbow_caches_save(caches, TAG, bytes, size, NULL));
    check(fogbow_caches_load(caches, TAG, bytes, size));

    for (uint32_t sample = 0; sample < SAMPLES; sample++) {
        for (uint32_t y = 0; y < SIDE; y++) {
            fogbow_ray rays[SIDE];
            float radiance[SIDE][3];
            for (int x = 0; x < SIDE; x++) {
                const float at[2] = {((float)x + 0.5f) / SIDE, ((float)y + 0.5f) / SIDE};
                fogbow_camera_ray(camera, at, &rays[x]);
            }
            const fogbow_chance chance = {.first_key = (uint64_t)y << 32, .sample = sample};
            check(fogbow_radiance(caches, world, rays, SIDE, chance, &radiance[0][0], NULL));
            for (int i = 0; i < 3 * SIDE; i++) (&picture[y][0][0])[i] += (&radiance[0][0])[i];
        }
    }
    printf("caches %016llx, picture %016llx\n", (unsigned long long)digest(bytes, size),
           (unsigned long long)digest(picture, sizeof picture));
    free(bytes);
    check(fogbow_caches_free(caches));
}

/* 0, or 1 if the file cannot be written. */
static int write_picture(const char *name) {
    FILE *file = fopen(name, "wb");
    if (!file) return 1;
    fprintf(file, "P6 %d %d 255\n", SIDE, SIDE);
    for (size_t i = 0; i < sizeof picture / sizeof(float); i++) {
        float value = powf((&picture[0][0][0])[i] / SAMPLES, 1 / 2.2f);
        fputc(value < 1 ? (int)(255 * value + 0.5f) : 255, file);
    }
    return fclose(file) != 0;
}

#endif
