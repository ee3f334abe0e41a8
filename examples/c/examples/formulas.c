/* The mathematics without a renderer: each formula held against its closed form.
 *   cc -std=c99 -O2 formulas.c $(pkg-config --cflags --libs fogbow) -lm && ./a.out */
#include <fogbow.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

static const double pi = 3.14159265358979;

static void check(fogbow_status status) {
    if (status) {
        fprintf(stderr, "%s: %s\n", fogbow_status_text(status), fogbow_message());
        exit(1);
    }
}

static void compare(const char *what, double found, double exact, double tolerance) {
    printf("%-46s %12.6f  exact %12.6f\n", what, found, exact);
    if (!(fabs(found - exact) <= tolerance)) {
        fprintf(stderr, "%s is off\n", what);
        exit(1);
    }
}

/* Fog that thickens along x: extinction 1 + x. */
static void thickening(void *context, const float *point, fogbow_properties *properties) {
    (void)context;
    for (int k = 0; k < 3; k++) properties->absorption[k] = 1 + point[0];
}

int main(void) {
    /* Phase functions: Jarosz et al. 2008, Eq. 41 and 44. */
    const fogbow_phase fog = {FOGBOW_PHASE_HENYEY_GREENSTEIN, 0.5f, 0};
    const float cosines[3] = {1, -1, 0};
    float values[3], slopes[3], moment;
    check(fogbow_phase_value(&fog, cosines, 3, values));
    check(fogbow_phase_derivative(&fog, cosines, 3, slopes));
    check(fogbow_phase_moment(&fog, 2, &moment));
    compare("forward over backward, ((1 + g)/(1 - g))^3", values[0] / values[1], 27, 1e-4);
    compare("derivative sideways, 3 g p/(1 + g^2)", slopes[2], 3 * 0.5 * values[2] / 1.25, 1e-6);
    compare("second moment, g^2", moment, 0.25, 1e-7);
    const float to_eye[3] = {0, 0, 1}, u[2] = {0.9f, 0.2f};
    float to_light[3], density, again;
    check(fogbow_phase_sample(&fog, to_eye, u, to_light, &density));
    const float turned = -to_light[2];
    check(fogbow_phase_value(&fog, &turned, 1, &again));
    compare("density of a sample, the value there", density, again, 1e-4);

    /* Spherical harmonics: the addition theorem. */
    const float direction[3] = {0.6f, 0, 0.8f};
    float harmonics[9];
    double sum = 0;
    check(fogbow_sh_evaluate(direction, 2, harmonics));
    for (int i = 0; i < 9; i++) sum += (double)harmonics[i] * harmonics[i];
    compare("sum of squares up to degree 2, 9/(4 pi)", sum, 9 / (4 * pi), 1e-6);

    /* Transmittance and its gradient through a medium of the host's: Eq. 16 to 22. */
    const fogbow_host_medium host = {.size = sizeof host, .majorant = {3, 3, 3}, .properties = thickening};
    const fogbow_ray ray = {{0, 0, 0}, {1, 0, 0}, 2};
    fogbow_medium *medium;
    fogbow_transmittance through;
    check(fogbow_medium_host(&host, &medium));
    check(fogbow_transmittance_along(medium, &ray, 1, FOGBOW_STEPS_GAUSS, 2, &through));
    check(fogbow_medium_free(medium));
    compare("transmittance, e^-4", through.value[0], exp(-4), 1e-6);
    compare("its gradient, the far end fixed, e^-4", through.gradient_fixed.x[0], exp(-4), 1e-4);
    compare("its gradient, both moved, -2 e^-4", through.gradient_joint.x[0], -2 * exp(-4), 1e-4);

    /* Covariances: Belcour et al. 2014, Fig. 3 and Eq. 13. */
    const fogbow_covariance light = {{4, 0, 4}, {0, 0, 0, 0}, {9, 0, 9}};
    fogbow_covariance far, scattered;
    fogbow_symmetric2 lobe;
    check(fogbow_covariance_travelled(&light, 3, &far));
    compare("angular covariance after 3 m, P + d^2 X", far.angular.xx, 9 + 3 * 3 * 4, 1e-4);
    check(fogbow_phase_covariance(&fog, 1, &lobe));
    compare("covariance of a lobe, 3g/(1 - g)^2/(4 pi^2)", lobe.xx, 6 / (4 * pi * pi), 1e-5);
    check(fogbow_covariance_scattered(&light, 1, &lobe, &scattered));
    compare("angular covariance, s P/(s + P)", scattered.angular.xx, 9 * lobe.xx / (9 + lobe.xx), 1e-5);

    /* One record of L(x) = 3 e^-2x, carried from 0 to 0.4: Jarosz et al. 2008, Eq. 35. */
    const fogbow_record record = {{0, 0, 0}, 1, {3, 3, 3}, {{-6, -6, -6}, {0, 0, 0}, {0, 0, 0}}};
    const float there[3] = {0.4f, 0, 0};
    float carried[3], radius;
    check(fogbow_extrapolate(&record, 1, FOGBOW_EXTRAPOLATION_EXPONENTIAL, 1, there, carried, NULL));
    compare("carried exponentially, 3 e^-0.8", carried[0], 3 * exp(-0.8), 1e-5);
    check(fogbow_record_radius(record.value, &record.gradient, 0.5f, &radius));
    compare("how far a tolerance of 0.5 reaches, e L/|grad L|", radius, 0.25, 1e-6);

    /* Bias compensation: Engelhardt et al. 2012. The mean weight of the next vertex is the contraction. */
    float clamped, missing, contraction;
    check(fogbow_clamped_connection(0.5f, 0.25f, 1, &clamped, &missing));
    compare("clamped and missing make all of it", clamped + missing / (0.25 * 0.25), 1 / (0.25 * 0.25), 1e-5);
    check(fogbow_contraction(1, 0.8f, 1.2f, &contraction));
    compare("contraction", contraction, 0.8 * (1 - 2 * (1 - exp(-1.2) * 2.2) / 1.44), 1e-5);
    const fogbow_properties even = {.absorption = {0.2f, 0.2f, 0.2f}, .scattering = {0.8f, 0.8f, 0.8f}};
    fogbow_world *world;
    check(fogbow_medium_homogeneous(&even, &medium));
    const fogbow_world_parts parts = {.size = sizeof parts, .medium = medium, .bounds = {{-1, -1, -1}, {1, 1, 1}}};
    check(fogbow_world_new(&parts, &world));
    const fogbow_receiver receiver = {.size = sizeof receiver, .to_eye = {0, 0, 1}, .properties = even};
    double mean = 0;
    for (uint64_t i = 0; i < 20000; i++) {
        fogbow_vertex vertex = {.size = sizeof vertex};
        const fogbow_chance chance = {.seed = 1, .first_key = i};
        check(fogbow_compensation_vertex(world, &receiver, 1.2f, FOGBOW_COMPENSATION_FULL, chance, &vertex));
        mean += (double)vertex.weight[0] / 20000;
    }
    /* Weights lie in [0, 1]: six standard errors are at most 6/(2 sqrt 20000). */
    compare("mean weight of a vertex", mean, contraction, 6 / (2 * sqrt(20000)));
    check(fogbow_world_free(world));
    check(fogbow_medium_free(medium));
    return 0;
}
