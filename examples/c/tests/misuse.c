/* Every function with null pointers, wrong handles, sizes of zero and beyond all memory, and numbers that are none: an error each, and
 * no crash. Run under valgrind by the step `c` of .ci/run. */
#include <fogbow.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int wrong = 0, calls = 0;

static void expect(const char *call, fogbow_status found, fogbow_status due, int line) {
    calls += due != FOGBOW_OK;
    const int says = fogbow_message()[0] != '\0';
    if (found != due || says != (found != FOGBOW_OK)) {
        fprintf(stderr, "%d: %s is %d (%s), not %d\n", line, call, (int)found, fogbow_message(), (int)due);
        wrong++;
    }
}

#define OK(call) expect(#call, call, FOGBOW_OK, __LINE__)
#define FAILS(status, call) expect(#call, call, FOGBOW_ERROR_##status, __LINE__)

/* A handle argument: null, foreign, freed, of another kind. `call` uses the name `handle`. */
#define HANDLE(type, good, freed, other, call)                                                                        \
    do {                                                                                                               \
        double local_[4] = {0};                                                                                        \
        type *handle = NULL;                                                                                           \
        FAILS(NULL, call);                                                                                             \
        handle = (type *)(void *)local_;                                                                               \
        FAILS(HANDLE, call);                                                                                           \
        handle = (type *)(void *)&((char *)local_)[1];                                                                 \
        FAILS(HANDLE, call);                                                                                           \
        handle = (type *)(uintptr_t)UINTPTR_MAX;                                                                       \
        FAILS(HANDLE, call);                                                                                           \
        handle = (type *)(freed);                                                                                      \
        FAILS(HANDLE, call);                                                                                           \
        handle = (type *)(void *)(other);                                                                              \
        FAILS(HANDLE, call);                                                                                           \
        handle = good;                                                                                                 \
        (void)handle;                                                                                                  \
    } while (0)

/* A structure argument with a size: null, misaligned, not set, too small, too large, with unknown fields set. */
#define SIZED(type, value, call)                                                                                       \
    do {                                                                                                               \
        union {                                                                                                        \
            type of;                                                                                                   \
            uint64_t room[1024];                                                                                       \
        } larger_;                                                                                                     \
        type *structure = NULL;                                                                                        \
        FAILS(NULL, call);                                                                                             \
        structure = (type *)(void *)&((char *)&larger_)[1];                                                            \
        FAILS(ARGUMENT, call);                                                                                         \
        structure = &larger_.of;                                                                                       \
        memset(&larger_, 0, sizeof larger_);                                                                           \
        larger_.of = value;                                                                                            \
        larger_.of.size = 0;                                                                                           \
        FAILS(SIZE, call);                                                                                             \
        larger_.of.size = 4;                                                                                           \
        FAILS(SIZE, call);                                                                                             \
        larger_.of.size = UINT32_MAX;                                                                                  \
        FAILS(SIZE, call);                                                                                             \
    } while (0)

#define UNKNOWN_FIELDS(type, value, call)                                                                              \
    do {                                                                                                               \
        union {                                                                                                        \
            type of;                                                                                                   \
            unsigned char bytes[1024];                                                                                 \
        } larger_;                                                                                                     \
        type *structure = &larger_.of;                                                                                 \
        memset(&larger_, 0, sizeof larger_);                                                                           \
        larger_.of = value;                                                                                            \
        larger_.of.size = sizeof(type) + 8;                                                                            \
        larger_.bytes[sizeof(type) + 3] = 1;                                                                           \
        FAILS(SIZE, call);                                                                                             \
    } while (0)

static const float none[3] = {NAN, 0, 0};
static const size_t huge = SIZE_MAX / 2;

/* What the host answers next. */
static fogbow_hit answer;
static fogbow_properties told;
static fogbow_segment bounded;
static float told_extinction;

static int32_t closest_hit(void *context, const fogbow_ray *ray, fogbow_hit *hit) {
    (void)context;
    (void)ray;
    *hit = answer;
    return 1;
}

static void properties_of(void *context, const float *point, fogbow_properties *properties) {
    (void)context;
    (void)point;
    *properties = told;
}

static void bounds_of(void *context, const fogbow_ray *ray, float from, fogbow_segment *segment) {
    (void)context;
    (void)ray;
    (void)from;
    *segment = bounded;
}

static void extinction_of(void *context, const float *point, float *extinction) {
    (void)context;
    (void)point;
    for (int k = 0; k < 3; k++) extinction[k] = told_extinction;
}

static void bad_ray(const void *context, const float *at, fogbow_ray *ray) {
    (void)context;
    (void)at;
    ray->direction[0] = NAN;
}

int main(void) {
    const fogbow_box box = {{-1, -1, -1}, {1, 1, 1}}, flat = {{0, 0, 0}, {1, 0, 1}}, endless = {{-INFINITY, 0, 0}, {1, 1, 1}};
    const fogbow_properties smoke = {.absorption = {0.5f, 0.5f, 0.5f}, .scattering = {0.5f, 0.5f, 0.5f}};
    fogbow_medium *endless_fog = NULL, *fog = NULL, *freed_medium = NULL, *medium = NULL;
    fogbow_world *world = NULL, *freed_world = NULL, *made_world = NULL;
    fogbow_caches *caches = NULL, *freed_caches = NULL, *made_caches = NULL;
    fogbow_work *work = NULL, *freed_work = NULL, *made_work = NULL;
    fogbow_result *result = NULL, *freed_result = NULL;
    fogbow_probes *probes = NULL, *freed_probes = NULL, *made_probes = NULL;

    /* Versions and texts. */
    if (fogbow_version() != ((uint32_t)FOGBOW_VERSION_MAJOR << 16 | FOGBOW_VERSION_MINOR << 8 | FOGBOW_VERSION_PATCH)) wrong++;
    if (!fogbow_status_text(0) || !fogbow_status_text(-7) || !fogbow_status_text(1 << 30)) wrong++;

    /* Media. */
    OK(fogbow_world_new(&(fogbow_world_parts){.size = sizeof(fogbow_world_parts), .bounds = box}, &freed_world));
    OK(fogbow_medium_homogeneous(&smoke, &endless_fog));
    OK(fogbow_medium_in_box(endless_fog, &box, &fog));
    OK(fogbow_medium_free(endless_fog));
    OK(fogbow_medium_homogeneous(&smoke, &freed_medium));
    OK(fogbow_medium_free(freed_medium));
    FAILS(HANDLE, fogbow_medium_free(freed_medium));
    OK(fogbow_medium_free(NULL));
    FAILS(NULL, fogbow_medium_homogeneous(NULL, &medium));
    FAILS(NULL, fogbow_medium_homogeneous(&smoke, NULL));
    for (int i = 0; i < 4; i++) {
        const float numbers[4] = {NAN, INFINITY, -1, 3e38f};
        fogbow_properties bad = smoke;
        bad.scattering[1] = numbers[i];
        bad.absorption[1] = i == 3 ? 3e38f : 0;
        FAILS(ARGUMENT, fogbow_medium_homogeneous(&bad, &medium));
        bad = smoke;
        bad.emission[2] = i == 3 ? -1 : numbers[i];
        FAILS(ARGUMENT, fogbow_medium_homogeneous(&bad, &medium));
    }
    for (uint32_t kind = 1; kind < 8; kind++) {
        const float gs[3] = {NAN, 1, -2};
        for (int i = 0; i < 3; i++) {
            fogbow_properties bad = smoke;
            bad.phase = (fogbow_phase){kind, gs[i], kind == FOGBOW_PHASE_DROPLETS ? 500.0f : -1.0f};
            if (kind != FOGBOW_PHASE_RAYLEIGH) FAILS(ARGUMENT, fogbow_medium_homogeneous(&bad, &medium));
        }
    }
    const float densities[8] = {1, 1, 1, 1, 1, 1, 1, 1}, bad_densities[8] = {1, 1, NAN, 1, 1, 1, 1, 1};
    const fogbow_grid grid = {.size = sizeof grid, .counts = {2, 2, 2}, .densities = densities, .density_count = 8, .properties = smoke,
                              .world_from_grid_rows = {2, 0, 0, -1, 0, 2, 0, -1, 0, 0, 2, -1}};
    SIZED(fogbow_grid, grid, fogbow_medium_grid(structure, &medium));
    UNKNOWN_FIELDS(fogbow_grid, grid, fogbow_medium_grid(structure, &medium));
    FAILS(NULL, fogbow_medium_grid(&grid, NULL));
    {
        fogbow_grid bad = grid;
        bad.densities = NULL;
        FAILS(NULL, fogbow_medium_grid(&bad, &medium));
        bad = grid, bad.densities = bad_densities;
        FAILS(ARGUMENT, fogbow_medium_grid(&bad, &medium));
        bad = grid, bad.density_count = 0;
        FAILS(ARGUMENT, fogbow_medium_grid(&bad, &medium));
        bad = grid, bad.counts[0] = 0, bad.density_count = 0;
        FAILS(ARGUMENT, fogbow_medium_grid(&bad, &medium));
        bad = grid, bad.counts[0] = bad.counts[1] = bad.counts[2] = UINT32_MAX, bad.density_count = huge;
        FAILS(ARGUMENT, fogbow_medium_grid(&bad, &medium));
        bad = grid, bad.world_from_grid_rows[0] = NAN;
        FAILS(ARGUMENT, fogbow_medium_grid(&bad, &medium));
        memset(bad.world_from_grid_rows, 0, sizeof bad.world_from_grid_rows);
        FAILS(ARGUMENT, fogbow_medium_grid(&bad, &medium));
        OK(fogbow_medium_grid(&grid, &medium));
        OK(fogbow_medium_free(medium));
    }
    const fogbow_noise noise = {.size = sizeof noise, .octaves = 3, .frequency = 1, .offset = 0.2f, .amplitude = 1, .properties = smoke};
    SIZED(fogbow_noise, noise, fogbow_medium_noise(structure, &medium));
    FAILS(NULL, fogbow_medium_noise(&noise, NULL));
    {
        fogbow_noise bad = noise;
        bad.frequency = NAN;
        FAILS(ARGUMENT, fogbow_medium_noise(&bad, &medium));
        bad = noise, bad.octaves = UINT32_MAX;
        FAILS(ARGUMENT, fogbow_medium_noise(&bad, &medium));
        bad = noise, bad.amplitude = INFINITY;
        FAILS(ARGUMENT, fogbow_medium_noise(&bad, &medium));
        OK(fogbow_medium_noise(&noise, &medium));
        OK(fogbow_medium_free(medium));
    }
    const fogbow_host_medium host = {.size = sizeof host, .majorant = {1, 1, 1}, .properties = properties_of, .bounds = bounds_of,
                                     .extinction = extinction_of};
    SIZED(fogbow_host_medium, host, fogbow_medium_host(structure, &medium));
    FAILS(NULL, fogbow_medium_host(&host, NULL));
    {
        fogbow_host_medium bad = host;
        bad.properties = NULL;
        FAILS(NULL, fogbow_medium_host(&bad, &medium));
        bad = host, bad.majorant[0] = NAN;
        FAILS(ARGUMENT, fogbow_medium_host(&bad, &medium));
        bad = host, bad.resolution = NAN;
        FAILS(ARGUMENT, fogbow_medium_host(&bad, &medium));
        bad = host, bad.bounds = NULL, memset(bad.majorant, 0, sizeof bad.majorant);
        FAILS(ARGUMENT, fogbow_medium_host(&bad, &medium));
    }
    HANDLE(fogbow_medium, fog, freed_medium, freed_world, fogbow_medium_in_box(handle, &box, &medium));
    FAILS(NULL, fogbow_medium_in_box(fog, NULL, &medium));
    FAILS(NULL, fogbow_medium_in_box(fog, &box, NULL));
    FAILS(ARGUMENT, fogbow_medium_in_box(fog, &flat, &medium));
    FAILS(ARGUMENT, fogbow_medium_in_box(fog, &endless, &medium));
    const float centre[3] = {0, 0, 0};
    HANDLE(fogbow_medium, fog, freed_medium, freed_world, fogbow_medium_in_ball(handle, centre, 1, &medium));
    FAILS(NULL, fogbow_medium_in_ball(fog, NULL, 1, &medium));
    FAILS(NULL, fogbow_medium_in_ball(fog, centre, 1, NULL));
    FAILS(ARGUMENT, fogbow_medium_in_ball(fog, none, 1, &medium));
    for (int i = 0; i < 4; i++) FAILS(ARGUMENT, fogbow_medium_in_ball(fog, centre, ((float[]){NAN, 0, -1, INFINITY})[i], &medium));
    {
        const fogbow_medium *both[2] = {fog, NULL};
        FAILS(NULL, fogbow_medium_overlap(both, 2, &medium));
        FAILS(NULL, fogbow_medium_overlap(NULL, 1, &medium));
        FAILS(NULL, fogbow_medium_overlap(both, 1, NULL));
        FAILS(ARGUMENT, fogbow_medium_overlap(both, huge, &medium));
        both[1] = freed_medium;
        FAILS(HANDLE, fogbow_medium_overlap(both, 2, &medium));
        OK(fogbow_medium_overlap(NULL, 0, &medium));
        OK(fogbow_medium_free(medium));
        /* Within each other until nobody could follow. */
        fogbow_medium *inner = NULL;
        OK(fogbow_medium_in_box(fog, &box, &inner));
        for (int depth = 2; depth < 32; depth++) {
            OK(fogbow_medium_in_box(inner, &box, &medium));
            OK(fogbow_medium_free(inner));
            inner = medium;
        }
        FAILS(ARGUMENT, fogbow_medium_in_box(inner, &box, &medium));
        OK(fogbow_medium_free(inner));
    }
    fogbow_properties found;
    HANDLE(fogbow_medium, fog, freed_medium, freed_world, fogbow_medium_properties(handle, centre, &found));
    FAILS(NULL, fogbow_medium_properties(fog, NULL, &found));
    FAILS(NULL, fogbow_medium_properties(fog, centre, NULL));
    FAILS(ARGUMENT, fogbow_medium_properties(fog, none, &found));

    /* Worlds. */
    const fogbow_light lamp = {.kind = FOGBOW_LIGHT_POINT, .position = {0, 0.5f, 0}, .emission = {1, 1, 1}};
    const fogbow_host_scene scene = {.size = sizeof scene, .closest_hit = closest_hit};
    const fogbow_world_parts parts = {.size = sizeof parts, .medium = fog, .lights = &lamp, .light_count = 1, .bounds = box};
    OK(fogbow_world_new(&parts, &world));
    OK(fogbow_world_free(freed_world));
    FAILS(HANDLE, fogbow_world_free(freed_world));
    OK(fogbow_world_free(NULL));
    FAILS(HANDLE, fogbow_medium_free((fogbow_medium *)(void *)world));
    SIZED(fogbow_world_parts, parts, fogbow_world_new(structure, &made_world));
    UNKNOWN_FIELDS(fogbow_world_parts, parts, fogbow_world_new(structure, &made_world));
    FAILS(NULL, fogbow_world_new(&parts, NULL));
    {
        fogbow_world_parts bad = parts;
        bad.medium = freed_medium;
        FAILS(HANDLE, fogbow_world_new(&bad, &made_world));
        bad = parts, bad.lights = NULL;
        FAILS(NULL, fogbow_world_new(&bad, &made_world));
        bad = parts, bad.light_count = huge;
        FAILS(ARGUMENT, fogbow_world_new(&bad, &made_world));
        bad = parts, bad.bounds = flat;
        FAILS(ARGUMENT, fogbow_world_new(&bad, &made_world));
        bad = parts, bad.bounds.lower[0] = NAN;
        FAILS(ARGUMENT, fogbow_world_new(&bad, &made_world));
        SIZED(fogbow_host_scene, scene, (bad = parts, bad.scene = structure, fogbow_world_new(structure ? &bad : NULL, &made_world)));
        fogbow_host_scene deaf = scene;
        deaf.closest_hit = NULL;
        bad = parts, bad.scene = &deaf;
        FAILS(NULL, fogbow_world_new(&bad, &made_world));
        for (uint32_t kind = 0; kind < 8; kind++) {
            /* All that a kind may use is no number; then dark in a way that no light is; then without extent. */
            fogbow_light light;
            memset(&light, 0xff, sizeof light);
            light.kind = kind;
            bad = parts, bad.lights = &light;
            FAILS(ARGUMENT, fogbow_world_new(&bad, &made_world));
            light = lamp, light.kind = kind, light.emission[0] = -1;
            FAILS(ARGUMENT, fogbow_world_new(&bad, &made_world));
            memset(&light, 0, sizeof light), light.kind = kind;
            if (kind != FOGBOW_LIGHT_POINT && kind != FOGBOW_LIGHT_SKY) FAILS(ARGUMENT, fogbow_world_new(&bad, &made_world));
        }
    }
    fogbow_outline outline = {.size = sizeof outline};
    HANDLE(fogbow_world, world, freed_world, fog, fogbow_world_outline(handle, &outline));
    SIZED(fogbow_outline, outline, fogbow_world_outline(world, structure));

    /* Rays. */
    const fogbow_ray ray = {{0, 0, -3}, {0, 0, 1}, INFINITY};
    const fogbow_chance chance = {.seed = UINT64_MAX, .first_key = UINT64_MAX, .sample = UINT32_MAX};
    float rgb[3 * 16];
    HANDLE(fogbow_world, world, freed_world, fog, fogbow_path_trace(handle, &ray, 1, chance, rgb));
    FAILS(NULL, fogbow_path_trace(world, NULL, 1, chance, rgb));
    FAILS(NULL, fogbow_path_trace(world, &ray, 1, chance, NULL));
    FAILS(ARGUMENT, fogbow_path_trace(world, &ray, huge, chance, rgb));
    OK(fogbow_path_trace(world, NULL, 0, chance, NULL));
    OK(fogbow_path_trace(world, &ray, 1, chance, rgb));
    for (int i = 0; i < 5; i++) {
        fogbow_ray bad = ray;
        if (i == 0) bad.origin[1] = NAN;
        if (i == 1) bad.direction[1] = NAN;
        if (i == 2) bad.direction[2] = 0;
        if (i == 3) bad.length = NAN;
        if (i == 4) bad.length = -1;
        FAILS(ARGUMENT, fogbow_path_trace(world, &bad, 1, chance, rgb));
    }

    /* Cameras give rays that are refused where they cannot be. */
    const float middle[2] = {0.5f, 0.5f};
    fogbow_ray seen;
    fogbow_camera camera = {{0, 0, 3}, {0, 0, 0}, {0, 1, 0}, 1, 1};
    fogbow_camera_ray(&camera, middle, &seen);
    if (!(seen.direction[2] < -0.99f)) wrong++;
    fogbow_camera_ray(NULL, middle, &seen);
    fogbow_camera_ray(&camera, NULL, &seen);
    fogbow_camera_ray(&camera, middle, NULL);
    if (seen.length != 0) wrong++;
    for (int i = 0; i < 4; i++) {
        fogbow_camera bad = camera;
        if (i == 0) bad.eye[0] = NAN;
        if (i == 1) bad.target[2] = 3;
        if (i == 2) bad.up[1] = 0;
        if (i == 3) bad.field_of_view = NAN;
        fogbow_camera_ray(&bad, middle, &seen);
        if (seen.length != 0) wrong++;
    }

    /* Caches. */
    const fogbow_settings settings = {.size = sizeof settings, .error = 0.5f, .rays = 16, .walks = 4};
    const fogbow_view view = {.size = sizeof view, .pixel = 0.1f, .context = &camera, .ray = fogbow_camera_ray};
    OK(fogbow_caches_new(world, &settings, &caches));
    OK(fogbow_caches_new(world, &settings, &freed_caches));
    OK(fogbow_caches_free(freed_caches));
    FAILS(HANDLE, fogbow_caches_free(freed_caches));
    OK(fogbow_caches_free(NULL));
    HANDLE(fogbow_world, world, freed_world, caches, fogbow_caches_new(handle, &settings, &made_caches));
    SIZED(fogbow_settings, settings, fogbow_caches_new(world, structure, &made_caches));
    FAILS(NULL, fogbow_caches_new(world, &settings, NULL));
    for (int i = 0; i < 4; i++) {
        fogbow_settings bad = settings;
        bad.error = ((float[]){NAN, -1, 1e-9f, INFINITY})[i];
        FAILS(ARGUMENT, fogbow_caches_new(world, &bad, &made_caches));
    }
    HANDLE(fogbow_caches, caches, freed_caches, world, fogbow_fill_view(handle, world, &view, &made_work));
    HANDLE(fogbow_world, world, freed_world, caches, fogbow_fill_view(caches, handle, &view, &made_work));
    SIZED(fogbow_view, view, fogbow_fill_view(caches, world, structure, &made_work));
    FAILS(NULL, fogbow_fill_view(caches, world, &view, NULL));
    for (int i = 0; i < 4; i++) {
        fogbow_view bad = view;
        bad.pixel = ((float[]){NAN, 0, -1, INFINITY})[i];
        FAILS(ARGUMENT, fogbow_fill_view(caches, world, &bad, &made_work));
    }
    HANDLE(fogbow_caches, caches, freed_caches, world, fogbow_fill_box(handle, world, &box, &made_work));
    HANDLE(fogbow_world, world, freed_world, caches, fogbow_fill_box(caches, handle, &box, &made_work));
    FAILS(NULL, fogbow_fill_box(caches, world, NULL, &made_work));
    FAILS(NULL, fogbow_fill_box(caches, world, &box, NULL));
    FAILS(ARGUMENT, fogbow_fill_box(caches, world, &flat, &made_work));

    /* Work. */
    uint32_t first, end;
    const char *stage;
    float share;
    OK(fogbow_fill_box(caches, world, &box, &work));
    FAILS(BUSY, fogbow_fill_view(caches, world, &view, &made_work));
    FAILS(BUSY, fogbow_caches_save(caches, 0, NULL, 0, &(size_t){0}));
    FAILS(BUSY, fogbow_caches_load(caches, 0, (const uint8_t *)"x", 1));
    FAILS(BUSY, fogbow_audit(caches, world, &view, 64, &made_work));
    OK(fogbow_fill_box(caches, world, &box, &freed_work) == FOGBOW_ERROR_BUSY ? fogbow_work_free(NULL) : FOGBOW_ERROR_PANIC);
    {
        fogbow_caches *others = NULL;
        OK(fogbow_caches_new(world, &settings, &others));
        OK(fogbow_fill_box(others, world, &box, &freed_work));
        OK(fogbow_work_run(freed_work, 0, &result));
        FAILS(JOB, fogbow_work_accept(work, result));
        FAILS(HANDLE, fogbow_work_accept(work, result));
        OK(fogbow_work_free(freed_work));
        FAILS(HANDLE, fogbow_work_free(freed_work));
        OK(fogbow_caches_free(others));
    }
    HANDLE(fogbow_work, work, freed_work, world, fogbow_work_jobs(handle, &first, &end));
    FAILS(NULL, fogbow_work_jobs(work, NULL, &end));
    FAILS(NULL, fogbow_work_jobs(work, &first, NULL));
    OK(fogbow_work_jobs(work, &first, &end));
    HANDLE(fogbow_work, work, freed_work, world, fogbow_work_run(handle, first, &result));
    FAILS(NULL, fogbow_work_run(work, first, NULL));
    FAILS(JOB, fogbow_work_run(work, end, &result));
    FAILS(JOB, fogbow_work_run(work, UINT32_MAX, &result));
    OK(fogbow_work_run(work, first, &freed_result));
    OK(fogbow_result_free(freed_result));
    FAILS(HANDLE, fogbow_result_free(freed_result));
    OK(fogbow_result_free(NULL));
    HANDLE(fogbow_work, work, freed_work, world, (fogbow_work_run(work, first, &result), fogbow_work_accept(handle, result)));
    FAILS(HANDLE, fogbow_work_accept(work, freed_result));
    FAILS(HANDLE, fogbow_work_accept(work, (fogbow_result *)(void *)world));
    OK(fogbow_work_accept(work, NULL));
    HANDLE(fogbow_work, work, freed_work, world, fogbow_work_step(handle, 1, NULL));
    HANDLE(fogbow_work, work, freed_work, world, fogbow_work_stage(handle, &stage));
    FAILS(NULL, fogbow_work_stage(work, NULL));
    OK(fogbow_work_stage(work, &stage));
    HANDLE(fogbow_work, work, freed_work, world, fogbow_work_share(handle, &share));
    FAILS(NULL, fogbow_work_share(work, NULL));
    OK(fogbow_work_step(work, 0, NULL));
    OK(fogbow_work_run(work, 0, &result));
    if (result) wrong++;
    fogbow_findings findings = {.size = sizeof findings};
    FAILS(ARGUMENT, fogbow_audit_findings(work, &findings));
    FAILS(ARGUMENT, fogbow_bake_take(work, &made_probes));
    FAILS(ARGUMENT, fogbow_audit_drop_wrong(work, 0.1f, &(int32_t){0}));
    OK(fogbow_work_free(work));

    /* Readers. */
    fogbow_light_parts light_parts;
    size_t missing;
    HANDLE(fogbow_caches, caches, freed_caches, world, fogbow_radiance(handle, world, &ray, 1, chance, rgb, &light_parts));
    HANDLE(fogbow_world, world, freed_world, caches, fogbow_radiance(caches, handle, &ray, 1, chance, rgb, &light_parts));
    FAILS(NULL, fogbow_radiance(caches, world, NULL, 1, chance, rgb, NULL));
    FAILS(NULL, fogbow_radiance(caches, world, &ray, 1, chance, NULL, NULL));
    FAILS(ARGUMENT, fogbow_radiance(caches, world, &ray, huge, chance, rgb, NULL));
    OK(fogbow_radiance(caches, world, NULL, 0, chance, NULL, NULL));
    OK(fogbow_radiance(caches, world, &ray, 1, chance, rgb, &light_parts));
    HANDLE(fogbow_caches, caches, freed_caches, world, fogbow_in_scattered(handle, world, centre, ray.direction, 1, chance, rgb));
    HANDLE(fogbow_world, world, freed_world, caches, fogbow_in_scattered(caches, handle, centre, ray.direction, 1, chance, rgb));
    FAILS(NULL, fogbow_in_scattered(caches, world, NULL, ray.direction, 1, chance, rgb));
    FAILS(NULL, fogbow_in_scattered(caches, world, centre, NULL, 1, chance, rgb));
    FAILS(NULL, fogbow_in_scattered(caches, world, centre, ray.direction, 1, chance, NULL));
    FAILS(ARGUMENT, fogbow_in_scattered(caches, world, none, ray.direction, 1, chance, rgb));
    FAILS(ARGUMENT, fogbow_in_scattered(caches, world, centre, centre, 1, chance, rgb));
    FAILS(ARGUMENT, fogbow_in_scattered(caches, world, centre, ray.direction, huge, chance, rgb));
    HANDLE(fogbow_caches, caches, freed_caches, world, fogbow_in_scattered_sh(handle, centre, 1, 2, rgb, &missing));
    FAILS(NULL, fogbow_in_scattered_sh(caches, NULL, 1, 2, rgb, NULL));
    FAILS(NULL, fogbow_in_scattered_sh(caches, centre, 1, 2, NULL, NULL));
    FAILS(ARGUMENT, fogbow_in_scattered_sh(caches, centre, 1, 9, rgb, NULL));
    FAILS(ARGUMENT, fogbow_in_scattered_sh(caches, centre, 1, UINT32_MAX, rgb, NULL));
    FAILS(ARGUMENT, fogbow_in_scattered_sh(caches, centre, huge, 2, rgb, NULL));
    FAILS(ARGUMENT, fogbow_in_scattered_sh(caches, none, 1, 2, rgb, NULL));
    HANDLE(fogbow_caches, caches, freed_caches, world, fogbow_fluence(handle, centre, 1, rgb, &missing));
    FAILS(NULL, fogbow_fluence(caches, NULL, 1, rgb, NULL));
    FAILS(NULL, fogbow_fluence(caches, centre, 1, NULL, NULL));
    FAILS(ARGUMENT, fogbow_fluence(caches, none, 1, rgb, NULL));
    FAILS(ARGUMENT, fogbow_fluence(caches, centre, huge, rgb, NULL));
    HANDLE(fogbow_caches, caches, freed_caches, world, fogbow_irradiance(handle, centre, ray.direction, 1, rgb, &missing));
    FAILS(NULL, fogbow_irradiance(caches, NULL, ray.direction, 1, rgb, NULL));
    FAILS(NULL, fogbow_irradiance(caches, centre, NULL, 1, rgb, NULL));
    FAILS(NULL, fogbow_irradiance(caches, centre, ray.direction, 1, NULL, NULL));
    FAILS(ARGUMENT, fogbow_irradiance(caches, none, ray.direction, 1, rgb, NULL));
    FAILS(ARGUMENT, fogbow_irradiance(caches, centre, none, 1, rgb, NULL));
    FAILS(ARGUMENT, fogbow_irradiance(caches, centre, ray.direction, huge, rgb, NULL));
    OK(fogbow_irradiance(caches, centre, ray.direction, 1, rgb, &missing));
    fogbow_caches_state state = {.size = sizeof state};
    HANDLE(fogbow_caches, caches, freed_caches, world, fogbow_caches_look(handle, &state));
    SIZED(fogbow_caches_state, state, fogbow_caches_look(caches, structure));

    /* Bytes: damaged anywhere, cut off anywhere. */
    size_t size = 0;
    HANDLE(fogbow_caches, caches, freed_caches, world, fogbow_caches_save(handle, 7, NULL, 0, &size));
    FAILS(NULL, fogbow_caches_save(caches, 7, NULL, 0, NULL));
    OK(fogbow_caches_save(caches, 7, NULL, 0, &size));
    unsigned char *bytes = malloc(size);
    if (!bytes) return 1;
    FAILS(ARGUMENT, fogbow_caches_save(caches, 7, bytes, size - 1, NULL));
    OK(fogbow_caches_save(caches, 7, bytes, size, NULL));
    HANDLE(fogbow_caches, caches, freed_caches, world, fogbow_caches_load(handle, 7, bytes, size));
    FAILS(NULL, fogbow_caches_load(caches, 7, NULL, size));
    FAILS(ARGUMENT, fogbow_caches_load(caches, 7, bytes, SIZE_MAX));
    FAILS(DATA, fogbow_caches_load(caches, 7, bytes, 0));
    FAILS(DATA, fogbow_caches_load(caches, 8, bytes, size));
    for (size_t at = 0; at < size; at += 1 + size / 40) {
        FAILS(DATA, fogbow_caches_load(caches, 7, bytes, at));
        bytes[at] ^= 0x10;
        FAILS(DATA, fogbow_caches_load(caches, 7, bytes, size));
        bytes[at] ^= 0x10;
    }
    OK(fogbow_caches_load(caches, 7, bytes, size));
    free(bytes);

    /* Audits. */
    HANDLE(fogbow_caches, caches, freed_caches, world, fogbow_audit(handle, world, &view, 64, &made_work));
    HANDLE(fogbow_world, world, freed_world, caches, fogbow_audit(caches, handle, &view, 64, &made_work));
    SIZED(fogbow_view, view, fogbow_audit(caches, world, structure, 64, &made_work));
    FAILS(NULL, fogbow_audit(caches, world, &view, 64, NULL));
    OK(fogbow_audit(caches, world, &view, 64, &work));
    FAILS(BUSY, fogbow_fill_view(caches, world, &view, &made_work));
    FAILS(BUSY, fogbow_caches_load(caches, 7, (const uint8_t *)"x", 1));
    OK(fogbow_work_step(work, 2, NULL));
    HANDLE(fogbow_work, work, freed_work, world, fogbow_audit_findings(handle, &findings));
    SIZED(fogbow_findings, findings, fogbow_audit_findings(work, structure));
    int32_t dropped;
    HANDLE(fogbow_work, work, freed_work, world, fogbow_audit_drop_wrong(handle, 0.1f, &dropped));
    FAILS(NULL, fogbow_audit_drop_wrong(work, 0.1f, NULL));
    FAILS(ARGUMENT, fogbow_audit_drop_wrong(work, NAN, &dropped));
    OK(fogbow_audit_drop_wrong(work, 0.1f, &dropped));
    FAILS(BUSY, fogbow_audit_findings(work, &findings));
    OK(fogbow_work_step(work, 0, NULL));
    OK(fogbow_work_free(work));

    /* Probes. */
    const fogbow_bake_settings baked = {.size = sizeof baked, .counts = {2, 2, 2}, .most_passes = 2, .directions = 2};
    HANDLE(fogbow_world, world, freed_world, caches, fogbow_bake(handle, NULL, &baked, &made_work));
    FAILS(HANDLE, fogbow_bake(world, freed_caches, &baked, &made_work));
    SIZED(fogbow_bake_settings, baked, fogbow_bake(world, NULL, structure, &made_work));
    FAILS(NULL, fogbow_bake(world, NULL, &baked, NULL));
    for (int i = 0; i < 10; i++) {
        fogbow_bake_settings bad = baked;
        if (i == 9) bad.photons = 2;
        if (i == 0) memset(bad.counts, 0, sizeof bad.counts);
        if (i == 1) bad.counts[1] = 0;
        if (i == 2) memset(bad.counts, 0xff, sizeof bad.counts);
        if (i == 3) bad.basis = 9;
        if (i == 4) bad.quantity = 9;
        if (i == 5) bad.orders = 9;
        if (i == 6) bad.error = NAN;
        if (i == 7) bad.most_passes = 1;
        if (i == 8) bad.has_bounds = 1, bad.bounds = endless;
        FAILS(ARGUMENT, fogbow_bake(world, NULL, &bad, &made_work));
    }
    for (int i = 0; i < 4; i++) {
        fogbow_bake_settings bad = baked;
        memset(bad.counts, 0, sizeof bad.counts);
        bad.spacing = ((float[]){NAN, -1, INFINITY, 1e-30f})[i];
        FAILS(ARGUMENT, fogbow_bake(world, NULL, &bad, &made_work));
    }
    OK(fogbow_bake(world, caches, &baked, &work));
    OK(fogbow_work_step(work, 0, NULL));
    HANDLE(fogbow_work, work, freed_work, world, fogbow_bake_take(handle, &probes));
    FAILS(NULL, fogbow_bake_take(work, NULL));
    OK(fogbow_bake_take(work, &probes));
    FAILS(BUSY, fogbow_bake_take(work, &made_probes));
    OK(fogbow_work_free(work));
    fogbow_probes_state probes_state = {.size = sizeof probes_state};
    size = 0;
    OK(fogbow_probes_save(probes, 3, NULL, 0, &size));
    bytes = malloc(size);
    if (!bytes) return 1;
    OK(fogbow_probes_save(probes, 3, bytes, size, NULL));
    OK(fogbow_probes_load(3, bytes, size, &freed_probes));
    OK(fogbow_probes_free(freed_probes));
    FAILS(HANDLE, fogbow_probes_free(freed_probes));
    OK(fogbow_probes_free(NULL));
    FAILS(NULL, fogbow_probes_load(3, NULL, size, &made_probes));
    FAILS(NULL, fogbow_probes_load(3, bytes, size, NULL));
    FAILS(ARGUMENT, fogbow_probes_load(3, bytes, SIZE_MAX, &made_probes));
    FAILS(DATA, fogbow_probes_load(4, bytes, size, &made_probes));
    for (size_t at = 0; at < size; at += 1 + size / 40) {
        FAILS(DATA, fogbow_probes_load(3, bytes, at, &made_probes));
        bytes[at] ^= 0x10;
        FAILS(DATA, fogbow_probes_load(3, bytes, size, &made_probes));
        bytes[at] ^= 0x10;
    }
    HANDLE(fogbow_probes, probes, freed_probes, world, fogbow_probes_save(handle, 3, bytes, size, NULL));
    FAILS(ARGUMENT, fogbow_probes_save(probes, 3, bytes, size - 1, NULL));
    FAILS(NULL, fogbow_probes_save(probes, 3, NULL, 0, NULL));
    free(bytes);
    HANDLE(fogbow_probes, probes, freed_probes, world, fogbow_probes_look(handle, &probes_state));
    SIZED(fogbow_probes_state, probes_state, fogbow_probes_look(probes, structure));
    float held[8 * 9 * 3];
    uint8_t states[8];
    HANDLE(fogbow_probes, probes, freed_probes, world, fogbow_probes_copy(handle, held, 8 * 9 * 3, states, 8));
    FAILS(NULL, fogbow_probes_copy(probes, NULL, 8 * 9 * 3, states, 8));
    FAILS(NULL, fogbow_probes_copy(probes, held, 8 * 9 * 3, NULL, 8));
    FAILS(ARGUMENT, fogbow_probes_copy(probes, held, 7, states, 8));
    FAILS(ARGUMENT, fogbow_probes_copy(probes, held, huge, states, 8));
    OK(fogbow_probes_copy(probes, held, 8 * 9 * 3, states, 8));
    HANDLE(fogbow_probes, probes, freed_probes, world, fogbow_probes_value(handle, centre, ray.direction, 1, rgb));
    FAILS(NULL, fogbow_probes_value(probes, NULL, ray.direction, 1, rgb));
    FAILS(NULL, fogbow_probes_value(probes, centre, NULL, 1, rgb));
    FAILS(NULL, fogbow_probes_value(probes, centre, ray.direction, 1, NULL));
    FAILS(ARGUMENT, fogbow_probes_value(probes, none, ray.direction, 1, rgb));
    FAILS(ARGUMENT, fogbow_probes_value(probes, centre, none, 1, rgb));
    FAILS(ARGUMENT, fogbow_probes_value(probes, centre, ray.direction, huge, rgb));
    HANDLE(fogbow_probes, probes, freed_probes, world, fogbow_probes_look_up(handle, centre, 1, rgb, &share));
    FAILS(NULL, fogbow_probes_look_up(probes, NULL, 1, rgb, NULL));
    FAILS(NULL, fogbow_probes_look_up(probes, centre, 1, NULL, NULL));
    FAILS(ARGUMENT, fogbow_probes_look_up(probes, none, 1, rgb, NULL));
    FAILS(ARGUMENT, fogbow_probes_look_up(probes, centre, huge, rgb, NULL));
    HANDLE(fogbow_probes, probes, freed_probes, world, fogbow_probes_dilate(handle, NULL));
    OK(fogbow_probes_dilate(probes, &missing));

    /* Formulas. */
    const fogbow_phase phase = {FOGBOW_PHASE_HENYEY_GREENSTEIN, 0.5f, 0}, bad_phase = {77, 0, 0};
    const float one = 1, two = 2, u[2] = {0.5f, 0.5f}, bad_u[2] = {1, NAN};
    float number;
    FAILS(NULL, fogbow_phase_value(NULL, &one, 1, &number));
    FAILS(NULL, fogbow_phase_value(&phase, NULL, 1, &number));
    FAILS(NULL, fogbow_phase_value(&phase, &one, 1, NULL));
    FAILS(ARGUMENT, fogbow_phase_value(&bad_phase, &one, 1, &number));
    FAILS(ARGUMENT, fogbow_phase_value(&phase, &two, 1, &number));
    FAILS(ARGUMENT, fogbow_phase_value(&phase, none, 1, &number));
    FAILS(ARGUMENT, fogbow_phase_value(&phase, &one, huge, &number));
    FAILS(NULL, fogbow_phase_derivative(NULL, &one, 1, &number));
    FAILS(ARGUMENT, fogbow_phase_derivative(&phase, none, 1, &number));
    FAILS(NULL, fogbow_phase_moment(NULL, 1, &number));
    FAILS(NULL, fogbow_phase_moment(&phase, 1, NULL));
    FAILS(ARGUMENT, fogbow_phase_moment(&phase, UINT32_MAX, &number));
    FAILS(NULL, fogbow_phase_sample(NULL, ray.direction, u, rgb, &number));
    FAILS(NULL, fogbow_phase_sample(&phase, NULL, u, rgb, &number));
    FAILS(NULL, fogbow_phase_sample(&phase, ray.direction, NULL, rgb, &number));
    FAILS(NULL, fogbow_phase_sample(&phase, ray.direction, u, NULL, &number));
    FAILS(ARGUMENT, fogbow_phase_sample(&phase, centre, u, rgb, NULL));
    FAILS(ARGUMENT, fogbow_phase_sample(&phase, ray.direction, bad_u, rgb, NULL));
    FAILS(NULL, fogbow_sh_evaluate(NULL, 2, rgb));
    FAILS(NULL, fogbow_sh_evaluate(ray.direction, 2, NULL));
    FAILS(ARGUMENT, fogbow_sh_evaluate(none, 2, rgb));
    FAILS(ARGUMENT, fogbow_sh_evaluate(ray.direction, UINT32_MAX, rgb));
    fogbow_transmittance through;
    HANDLE(fogbow_medium, fog, freed_medium, world, fogbow_transmittance_along(handle, &ray, 1, FOGBOW_STEPS_GAUSS, 2, &through));
    FAILS(NULL, fogbow_transmittance_along(fog, NULL, 1, FOGBOW_STEPS_GAUSS, 2, &through));
    FAILS(NULL, fogbow_transmittance_along(fog, &ray, 1, FOGBOW_STEPS_GAUSS, 2, NULL));
    FAILS(ARGUMENT, fogbow_transmittance_along(fog, &ray, huge, FOGBOW_STEPS_GAUSS, 2, &through));
    FAILS(ARGUMENT, fogbow_transmittance_along(fog, &ray, 1, 9, 2, &through));
    FAILS(ARGUMENT, fogbow_transmittance_along(fog, &ray, 1, FOGBOW_STEPS_GAUSS, 0, &through));
    FAILS(ARGUMENT, fogbow_transmittance_along(fog, &ray, 1, FOGBOW_STEPS_GAUSS, UINT32_MAX, &through));
    fogbow_covariance light = {{1, 0, 1}, {0, 0, 0, 0}, {1, 0, 1}}, bad_light = {{1, NAN, 1}, {0, 0, 0, 0}, {1, 0, 1}}, changed;
    fogbow_symmetric2 matrix = {1, 0, 1}, bad_matrix = {1, 0, INFINITY}, slice;
    const float cosines[2] = {0.5f, 0.5f};
    FAILS(NULL, fogbow_covariance_travelled(NULL, 1, &changed));
    FAILS(NULL, fogbow_covariance_travelled(&light, 1, NULL));
    FAILS(ARGUMENT, fogbow_covariance_travelled(&bad_light, 1, &changed));
    FAILS(ARGUMENT, fogbow_covariance_travelled(&light, NAN, &changed));
    FAILS(NULL, fogbow_covariance_masked(NULL, &matrix, &changed));
    FAILS(NULL, fogbow_covariance_masked(&light, NULL, &changed));
    FAILS(NULL, fogbow_covariance_masked(&light, &matrix, NULL));
    FAILS(ARGUMENT, fogbow_covariance_masked(&light, &bad_matrix, &changed));
    FAILS(NULL, fogbow_covariance_attenuated(NULL, &matrix, 1, &changed));
    FAILS(NULL, fogbow_covariance_attenuated(&light, NULL, 1, &changed));
    FAILS(ARGUMENT, fogbow_covariance_attenuated(&light, &matrix, NAN, &changed));
    FAILS(NULL, fogbow_covariance_scattered(NULL, 1, &matrix, &changed));
    FAILS(NULL, fogbow_covariance_scattered(&light, 1, NULL, &changed));
    FAILS(ARGUMENT, fogbow_covariance_scattered(&light, 2, &matrix, &changed));
    FAILS(ARGUMENT, fogbow_covariance_scattered(&light, NAN, &matrix, &changed));
    FAILS(NULL, fogbow_covariance_rotated(NULL, 1, 0, &changed));
    FAILS(ARGUMENT, fogbow_covariance_rotated(&light, NAN, 0, &changed));
    FAILS(NULL, fogbow_covariance_reflected(NULL, cosines, &matrix, &matrix, &changed));
    FAILS(NULL, fogbow_covariance_reflected(&light, NULL, &matrix, &matrix, &changed));
    FAILS(NULL, fogbow_covariance_reflected(&light, cosines, NULL, &matrix, &changed));
    FAILS(NULL, fogbow_covariance_reflected(&light, cosines, &matrix, NULL, &changed));
    FAILS(ARGUMENT, fogbow_covariance_reflected(&light, none, &matrix, &matrix, &changed));
    FAILS(NULL, fogbow_covariance_combined(NULL, 1, &light, 1, &changed));
    FAILS(NULL, fogbow_covariance_combined(&light, 1, NULL, 1, &changed));
    FAILS(ARGUMENT, fogbow_covariance_combined(&light, NAN, &light, 1, &changed));
    FAILS(ARGUMENT, fogbow_covariance_combined(&light, 1, &light, -1, &changed));
    FAILS(NULL, fogbow_covariance_slice(NULL, &slice));
    FAILS(NULL, fogbow_covariance_slice(&light, NULL));
    FAILS(ARGUMENT, fogbow_covariance_slice(&bad_light, &slice));
    FAILS(NULL, fogbow_phase_covariance(NULL, 1, &slice));
    FAILS(NULL, fogbow_phase_covariance(&phase, 1, NULL));
    FAILS(ARGUMENT, fogbow_phase_covariance(&phase, NAN, &slice));
    FAILS(NULL, fogbow_phong_covariance(1, NULL));
    FAILS(ARGUMENT, fogbow_phong_covariance(NAN, &slice));
    const fogbow_record record = {{0, 0, 0}, 1, {1, 1, 1}, {{0, 0, 0}, {0, 0, 0}, {0, 0, 0}}};
    fogbow_record bad_record = record;
    bad_record.radius = 0;
    FAILS(NULL, fogbow_extrapolate(NULL, 1, 0, 1, centre, rgb, NULL));
    FAILS(NULL, fogbow_extrapolate(&record, 1, 0, 1, NULL, rgb, NULL));
    FAILS(NULL, fogbow_extrapolate(&record, 1, 0, 1, centre, NULL, NULL));
    FAILS(ARGUMENT, fogbow_extrapolate(&record, huge, 0, 1, centre, rgb, NULL));
    FAILS(ARGUMENT, fogbow_extrapolate(&record, 1, 9, 1, centre, rgb, NULL));
    FAILS(ARGUMENT, fogbow_extrapolate(&record, 1, 0, NAN, centre, rgb, NULL));
    FAILS(ARGUMENT, fogbow_extrapolate(&record, 1, 0, 1, none, rgb, NULL));
    FAILS(ARGUMENT, fogbow_extrapolate(&bad_record, 1, 0, 1, centre, rgb, NULL));
    OK(fogbow_extrapolate(NULL, 0, 0, 1, centre, rgb, &missing));
    FAILS(NULL, fogbow_record_radius(NULL, &record.gradient, 1, &number));
    FAILS(NULL, fogbow_record_radius(centre, NULL, 1, &number));
    FAILS(NULL, fogbow_record_radius(centre, &record.gradient, 1, NULL));
    FAILS(ARGUMENT, fogbow_record_radius(none, &record.gradient, 1, &number));
    FAILS(ARGUMENT, fogbow_record_radius(centre, &record.gradient, NAN, &number));
    for (int i = 0; i < 3; i++) {
        FAILS(ARGUMENT, fogbow_clamped_connection(((float[]){NAN, 0, -1})[i], 1, 1, &number, NULL));
        FAILS(ARGUMENT, fogbow_clamped_connection(1, ((float[]){NAN, 0, -1})[i], 1, &number, NULL));
        FAILS(ARGUMENT, fogbow_clamped_connection(1, 1, ((float[]){NAN, 2, -2})[i], &number, NULL));
    }
    OK(fogbow_clamped_connection(1, 1, 1, NULL, NULL));
    FAILS(NULL, fogbow_contraction(1, 1, 1, NULL));
    FAILS(ARGUMENT, fogbow_contraction(NAN, 1, 1, &number));
    FAILS(ARGUMENT, fogbow_contraction(1, 2, 1, &number));
    FAILS(ARGUMENT, fogbow_contraction(1, 1, INFINITY, &number));
    const fogbow_receiver receiver = {.size = sizeof receiver, .to_eye = {0, 0, 1}, .properties = smoke};
    fogbow_vertex vertex = {.size = sizeof vertex};
    HANDLE(fogbow_world, world, freed_world, caches, fogbow_compensation_vertex(handle, &receiver, 1, 0, chance, &vertex));
    SIZED(fogbow_receiver, receiver, fogbow_compensation_vertex(world, structure, 1, 0, chance, &vertex));
    SIZED(fogbow_vertex, vertex, fogbow_compensation_vertex(world, &receiver, 1, 0, chance, structure));
    FAILS(ARGUMENT, fogbow_compensation_vertex(world, &receiver, NAN, 0, chance, &vertex));
    FAILS(ARGUMENT, fogbow_compensation_vertex(world, &receiver, 1, 9, chance, &vertex));

    /* Callbacks that answer what cannot be: told, and nothing crashes. */
    fogbow_world *odd = NULL;
    fogbow_world_parts odd_parts = parts;
    odd_parts.scene = &scene;
    OK(fogbow_world_new(&odd_parts, &odd));
    for (int i = 0; i < 15; i++) {
        answer = (fogbow_hit){.distance = 1, .normal = {0, 0, -1}, .eta = 1, .light = FOGBOW_NO_LIGHT};
        if (i == 0) answer.distance = NAN;
        if (i == 1) answer.distance = -1;
        if (i == 2) answer.distance = INFINITY;
        if (i == 3) answer.normal[0] = NAN;
        if (i == 4) answer.normal[2] = 0;
        if (i == 5) answer.surface = 99;
        if (i == 6) answer.reflectance[1] = 2;
        if (i == 7) answer.light = 1;
        if (i == 8) answer.surface = FOGBOW_SURFACE_DIELECTRIC, answer.eta = 0;
        if (i == 9) answer.surface = FOGBOW_SURFACE_PHONG, answer.exponent = NAN;
        if (i == 10) answer.shading[2] = 1;
        if (i == 11) answer.shading[0] = NAN;
        if (i == 12) answer.surface = FOGBOW_SURFACE_PANE, answer.eta = -1;
        if (i == 13) answer.surface = FOGBOW_SURFACE_ROUGH_METAL, answer.roughness = NAN;
        if (i == 14) answer.surface = FOGBOW_SURFACE_ROUGH_DIELECTRIC, answer.roughness = 0.5f;
        FAILS(HOST, fogbow_path_trace(odd, &ray, 1, chance, rgb));
        for (int k = 0; k < 3; k++) wrong += !isfinite(rgb[k]);
        FAILS(HOST, fogbow_world_outline(odd, &outline));
    }
    OK(fogbow_world_free(odd));
    OK(fogbow_medium_host(&host, &medium));
    odd_parts = parts, odd_parts.medium = medium;
    OK(fogbow_world_new(&odd_parts, &odd));
    for (int i = 0; i < 7; i++) {
        told = smoke, told_extinction = 0.5f;
        bounded = (fogbow_segment){INFINITY, {0, 0, 0}, {1, 1, 1}};
        if (i == 0) told.absorption[0] = NAN;
        if (i == 1) told.scattering[0] = -1;
        if (i == 2) told.phase.kind = 99;
        if (i == 3) bounded.until = NAN;
        if (i == 4) bounded.until = -1;
        if (i == 5) bounded.majorant[0] = -1;
        if (i == 6) bounded.minorant[0] = NAN;
        FAILS(HOST, fogbow_world_outline(odd, &outline));
        fogbow_status status = FOGBOW_OK;
        for (uint64_t key = 0; key < 64 && status == FOGBOW_OK; key++) {
            status = fogbow_path_trace(odd, &ray, 1, (fogbow_chance){.first_key = key}, rgb);
            for (int k = 0; k < 3; k++) wrong += !isfinite(rgb[k]);
        }
        FAILS(HOST, status);
    }
    told_extinction = NAN;
    bounded = (fogbow_segment){INFINITY, {0, 0, 0}, {1, 1, 1}};
    told = smoke;
    fogbow_ray through_it = ray;
    through_it.length = 1;
    bounded.until = 3;
    FAILS(HOST, fogbow_transmittance_along(medium, &through_it, 1, FOGBOW_STEPS_MIDPOINTS, 2, &through));
    OK(fogbow_world_free(odd));
    OK(fogbow_medium_free(medium));
    fogbow_view bad_view = view;
    bad_view.ray = bad_ray;
    OK(fogbow_caches_new(world, &settings, &made_caches));
    FAILS(HOST, fogbow_fill_view(made_caches, world, &bad_view, &work));
    if (work) FAILS(HOST, fogbow_work_step(work, 0, NULL));
    OK(fogbow_work_free(work));
    OK(fogbow_caches_free(made_caches));

    OK(fogbow_probes_free(probes));
    OK(fogbow_caches_free(caches));
    OK(fogbow_world_free(world));
    OK(fogbow_medium_free(fog));
    if (!wrong) printf("every misuse is an error: %d calls\n", calls);
    return wrong != 0;
}
