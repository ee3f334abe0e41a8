/* fogbow: light in fog, smoke and clouds. https://docs.rs/fogbow explains the methods.
 *
 * Made from the Rust source by cbindgen: do not edit.
 *
 * Units: lengths are metres, angles radians, colours three floats (r, g, b), vectors three floats (x, y, z).
 *
 * Every function but fogbow_message, fogbow_status_text, fogbow_version and fogbow_camera_ray returns a fogbow_status: 0, or why it failed;
 * fogbow_message() then says more, in this thread. No function throws, aborts or leaves by longjmp, whatever it is given.
 *
 * Pointers: null, wrong alignment and numbers outside their ranges are errors. What a function cannot see is whether a pointer that is neither null nor
 * misaligned points to as many elements as are said. Where a count is 0 the pointer may be anything. Answers are written only where a function succeeds,
 * but for FOGBOW_ERROR_HOST (all are written) and batches in which an element is wrong (those before it are written).
 *
 * Structures that begin with `size`: set it to sizeof, all else to 0 (`= { .size = sizeof(fogbow_settings) }` in C), then what you need: fields of later
 * versions come at the end, and 0 is what the library did before. Structures without `size` never change.
 *
 * Handles (fogbow_world *, ...) are no pointers to anything. A handle that was freed, is of another kind or is none is an error. What a handle stands for is
 * kept alive by what uses it, so the order in which handles are freed does not matter; each must be freed once, and freeing null is nothing.
 *
 * Threads: every function may be called on any thread at any time, and results do not depend on it. The context and the callbacks of a world must bear to be used
 * by all threads that call functions with this world. Callbacks must neither throw nor leave by longjmp, nor use the caches they are called for.
 *
 * Callbacks are checked: an answer that cannot be (no number, a normal that is not of length 1, a light that there is not) makes the function that asked
 * return FOGBOW_ERROR_HOST, and counts as nothing.
 */

#ifndef FOGBOW_H
#define FOGBOW_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

// The first number of the version of the interface.
#define FOGBOW_VERSION_MAJOR 0

// The second one. Until 1.0, versions that differ in it do not fit each other.
#define FOGBOW_VERSION_MINOR 1

// The third one.
#define FOGBOW_VERSION_PATCH 0

// The same in all directions.
#define FOGBOW_PHASE_ISOTROPIC 0

// Henyey–Greenstein, with `g` in (-1, 1), forward for g > 0.
#define FOGBOW_PHASE_HENYEY_GREENSTEIN 1

// Schlick, with `g` as its k in (-1, 1), forward for k > 0.
#define FOGBOW_PHASE_SCHLICK 2

// Rayleigh.
#define FOGBOW_PHASE_RAYLEIGH 3

// Draine, with `g` in (-1, 1) and `alpha` at least 0.
#define FOGBOW_PHASE_DRAINE 4

// Water droplets of the diameter `alpha` (µm, in [5, 50]): Jendersie and d'Eon 2023.
#define FOGBOW_PHASE_DROPLETS 5

// Ideal diffuse reflection of `reflectance`, on the side of the normal.
#define FOGBOW_SURFACE_LAMBERT 0

// A Phong lobe of `specular` and `exponent` over a diffuse base of `reflectance`; together at most 1.
#define FOGBOW_SURFACE_PHONG 1

// An ideal mirror of `reflectance`, on the side of the normal.
#define FOGBOW_SURFACE_MIRROR 2

// Smooth glass: index of refraction behind the normal over that before it `eta`, factors `reflectance` and `transmittance`.
#define FOGBOW_SURFACE_DIELECTRIC 3

// An interface that light passes unchanged.
#define FOGBOW_SURFACE_NULL 4

// A thin pane of glass, both faces as one, of the parameters of a dielectric; what passes goes straight on.
#define FOGBOW_SURFACE_PANE 5

// A rough metal (GGX) of `reflectance` and `roughness`, on the side of the normal.
#define FOGBOW_SURFACE_ROUGH_METAL 6

// Rough glass (GGX), of the parameters of a dielectric, `eta` not 1, and `roughness`.
#define FOGBOW_SURFACE_ROUGH_DIELECTRIC 7

// A diffuse base of `reflectance` under a smooth coat of index `eta`, whose reflections have the factor `specular`; on the side of
// the normal.
#define FOGBOW_SURFACE_PLASTIC 8

// The hit is on no lamp.
#define FOGBOW_NO_LIGHT 4294967295

// A point; `emission` is intensity (W/sr).
#define FOGBOW_LIGHT_POINT 0

// A cone of `position`, `direction`, `beam` and `cutoff`; `emission` is intensity (W/sr) along the axis.
#define FOGBOW_LIGHT_SPOT 1

// cos^exponent around `direction`; `emission` is intensity (W/sr) along it.
#define FOGBOW_LIGHT_PHONG 2

// A parallelogram of the corner `position` and the edges `edge_u` and `edge_v` that shines towards edge_u × edge_v; `emission` is
// radiance (W/(m² sr)).
// Its surface is one of the scene: `closest_hit` must find it.
#define FOGBOW_LIGHT_QUAD 3

// A ball of `position` and `radius`; `emission` is radiance (W/(m² sr)). Its surface is one of the scene: `closest_hit` must find it.
#define FOGBOW_LIGHT_SPHERE 4

// Parallel light that goes along `direction`; `emission` is irradiance (W/m²) of a plane across it.
#define FOGBOW_LIGHT_SUN 5

// The same radiance `emission` (W/(m² sr)) from all around.
#define FOGBOW_LIGHT_SKY 6

// Spherical harmonics of degree 2, 9 coefficients.
#define FOGBOW_BASIS_SH2 0

// Spherical harmonics of degree 0, 1 coefficient.
#define FOGBOW_BASIS_SH0 1

// Spherical harmonics of degree 1, 4 coefficients.
#define FOGBOW_BASIS_SH1 2

// Spherical harmonics of degree 3, 16 coefficients.
#define FOGBOW_BASIS_SH3 3

// Values towards +x, -x, +y, -y, +z, -z.
#define FOGBOW_BASIS_AMBIENT_CUBE 4

// Fluence (W/m²) alone, 1 number.
#define FOGBOW_BASIS_FLUENCE 5

// In-scattered radiance (W/(m² sr), without the scattering coefficient) towards a direction: it lights fog.
#define FOGBOW_QUANTITY_IN_SCATTERED 0

// Irradiance (W/m²) of a surface with the direction as its normal: it lights surfaces.
#define FOGBOW_QUANTITY_IRRADIANCE 1

// All light.
#define FOGBOW_ORDERS_ALL 0

// All but light straight from the lights.
#define FOGBOW_ORDERS_INDIRECT 1

// Light that the medium has scattered last.
#define FOGBOW_ORDERS_MULTIPLE 2

// Nothing is known of it yet.
#define FOGBOW_PROBE_UNKNOWN 0

// It holds light.
#define FOGBOW_PROBE_VALID 1

// It stands in a wall.
#define FOGBOW_PROBE_IN_WALL 2

// No medium is near.
#define FOGBOW_PROBE_EMPTY 3

// So many steps of equal length, sampled in their middle.
#define FOGBOW_STEPS_MIDPOINTS 0

// So many panels of 8 Gauss–Legendre nodes: for smooth media as good as exact.
#define FOGBOW_STEPS_GAUSS 1

// L + (grad L + mean grad L)/2 · d, mixed by weights: exact for light that changes quadratically.
#define FOGBOW_EXTRAPOLATION_CURVED 0

// L exp(grad L · d / L), mixed by a weighted geometric mean: Eq. 35.
#define FOGBOW_EXTRAPOLATION_EXPONENTIAL 1

// L + grad L · d, mixed by weights.
#define FOGBOW_EXTRAPOLATION_LINEAR 2

// L, mixed by weights.
#define FOGBOW_EXTRAPOLATION_CONSTANT 3

// Unbiased: delta tracking, and all surfaces are looked at.
#define FOGBOW_COMPENSATION_FULL 0

// As if the medium around were even: cheaper, biased where it is not.
#define FOGBOW_COMPENSATION_APPROXIMATE 1

// What a function returns: 0 if all went well, else why not. `fogbow_message` says more.
enum fogbow_status
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    // All went well.
    FOGBOW_OK = 0,
    // A pointer is null that must not be.
    FOGBOW_ERROR_NULL = 1,
    // A handle is of another kind, was freed, or is none at all.
    FOGBOW_ERROR_HANDLE = 2,
    // A value is outside its range, or not a number.
    FOGBOW_ERROR_ARGUMENT = 3,
    // The `size` of a structure is not set, or has fields that this library does not know.
    FOGBOW_ERROR_SIZE = 4,
    // What is asked for must wait until some other work is done or freed.
    FOGBOW_ERROR_BUSY = 5,
    // A job is not due, or a result is of other work.
    FOGBOW_ERROR_JOB = 6,
    // Bytes are damaged, or of something else.
    FOGBOW_ERROR_DATA = 7,
    // A callback of the host gave an answer that cannot be. What was computed is there, and may be wrong.
    FOGBOW_ERROR_HOST = 8,
    // There is no memory for it.
    FOGBOW_ERROR_MEMORY = 9,
    // A mistake in this library. The objects that took part should not be used again.
    FOGBOW_ERROR_PANIC = 10,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum fogbow_status fogbow_status;
#else
typedef int32_t fogbow_status;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// Light in a world, cached. Read by many threads at a time; while it is filled, too.
typedef struct fogbow_caches fogbow_caches;

// A medium: what light travels through. Never changes; worlds and other media that use it keep it alive.
typedef struct fogbow_medium fogbow_medium;

// A grid of probes that hold light. Read by many threads at a time.
typedef struct fogbow_probes fogbow_probes;

// The result of one job, until it is accepted.
typedef struct fogbow_result fogbow_result;

// Work under way: a fill, a bake or an audit, in rounds of pure jobs.
//
// `fogbow_work_jobs` tells the numbers of the jobs whose results are due. `fogbow_work_run` runs one of them, on any thread, many at a
// time, in any order. `fogbow_work_accept` takes results back, from any thread, in any order: those that come early are kept
// until it is their turn. When all of a round are in, the next begins. Whatever the order and the number of threads, the result has
// the same bits.
// To cancel is to stop calling; a job whose result never came back is asked for again.
typedef struct fogbow_work fogbow_work;

// A world: a medium, surfaces and lights. Never changes; work in it keeps it alive. Callbacks and their contexts must live as long.
typedef struct fogbow_world fogbow_world;

// A phase function, `FOGBOW_PHASE_…`; all zeros are isotropic. Mixtures come of media that overlap.
typedef struct {
    // Which one.
    uint32_t kind;
    // Its first parameter, where it has one.
    float g;
    // Its second parameter, where it has one.
    float alpha;
} fogbow_phase;

// Optical properties of a medium at a point; all zeros are vacuum.
typedef struct {
    // Absorption coefficient (1/m).
    float absorption[3];
    // Scattering coefficient (1/m).
    float scattering[3];
    // Emitted radiance per length (W/(m³ sr)).
    float emission[3];
    // Angular law of scattering.
    fogbow_phase phase;
} fogbow_properties;

// A grid of densities, trilinear between the centres of its cells; vacuum outside.
typedef struct {
    // sizeof(fogbow_grid).
    uint32_t size;
    // Cells along x, y and z; each at least 1.
    uint32_t counts[3];
    // One density for each cell, x fastest: cell (x, y, z) is number (z * counts[1] + y) * counts[0] + x. Finite, not negative.
    // They are copied.
    const float *densities;
    // How many there are: the product of `counts`.
    size_t density_count;
    // What the medium is where the density is 1; coefficients and emission are in proportion to it.
    fogbow_properties properties;
    // Where the unit cube of the grid lies in the world: three rows of four numbers, the last of each a translation (m).
    float world_from_grid_rows[12];
} fogbow_grid;

// Fractal noise: density = clamp(offset + amplitude * sum of gain^i * noise(frequency * lacunarity^i * x), 0, max_density).
typedef struct {
    // sizeof(fogbow_noise).
    uint32_t size;
    // Octaves, at least 1.
    uint32_t octaves;
    // Other seeds are other clouds.
    uint32_t seed;
    // Cells per metre of the first octave.
    float frequency;
    // From octave to octave, the factor of frequencies, at least 1; 0 for 2.
    float lacunarity;
    // From octave to octave, the factor of amplitudes, at most 1; 0 for a half.
    float gain;
    // Mean density before clamping; a negative one leaves islands in vacuum.
    float offset;
    // Amplitude of the first octave, whose values lie in about ±1.
    float amplitude;
    // Largest density; 0 for 1.
    float max_density;
    // What the medium is where the density is 1.
    fogbow_properties properties;
} fogbow_noise;

// A ray. Fixed for ever: arrays of it cross the interface.
typedef struct {
    // Where it begins (m).
    float origin[3];
    // Where it goes (unit).
    float direction[3];
    // How far (m); may be infinite.
    float length;
} fogbow_ray;

// Bounds of extinction along a part of a ray.
typedef struct {
    // Distance (m) along the ray up to which they hold, beyond where they were asked for; infinite where nothing follows.
    float until;
    // Lower bound of extinction (1/m). Where it is equal to the upper one in all channels, the medium must be constant.
    float minorant[3];
    // Upper bound of extinction (1/m). 0 promises vacuum.
    float majorant[3];
} fogbow_segment;

// A medium of the host. Its callbacks are pure (the same answer to the same question), may be called by every thread that calls
// fogbow, and never throw, jump out or call fogbow with the same caches.
typedef struct {
    // sizeof(fogbow_host_medium).
    uint32_t size;
    // 1: extinction is the same in all channels everywhere, which is quicker. Where this is not so, colours are wrong.
    uint32_t is_grey;
    // 1: there may be emission. Else it is left out.
    uint32_t is_emissive;
    // Length (m) over which coefficients vary, for the steps of differences and marches; 0 for 0.01.
    float resolution;
    // Upper bound of extinction (1/m) everywhere; used where `bounds` is null.
    float majorant[3];
    // Passed to the callbacks.
    void *context;
    // Writes the properties at a point (x, y, z; m), which are vacuum before.
    void (*properties)(void *context, const float *point, fogbow_properties *properties);
    // Writes bounds from the distance `from` (m) along a ray on, which are 0 up to infinity before. Null: `majorant` holds everywhere.
    void (*bounds)(void *context, const fogbow_ray *ray, float from, fogbow_segment *segment);
    // Writes extinction (1/m, three channels) at a point, where that is cheaper than all properties. May be null.
    void (*extinction)(void *context, const float *point, float *extinction);
} fogbow_host_medium;

// A box along the axes (m).
typedef struct {
    // Least coordinates.
    float lower[3];
    // Greatest coordinates; each above the least one.
    float upper[3];
} fogbow_box;

// Where a ray meets a surface. Before the callback it is a black Lambert surface on no lamp, with `eta` and `transmittance` 1.
typedef struct {
    // Distance along the ray (m), above 0 and within its length.
    float distance;
    // Geometric normal (unit); surfaces shine and reflect on the side it points to. For two-sided ones, turn it against the ray.
    float normal[3];
    // The normal (unit) that scattering goes by, on the side of the other: interpolated between vertices, or bent by a texture.
    // Zeros: the geometric one.
    float shading[3];
    // `FOGBOW_SURFACE_…`.
    uint32_t surface;
    // Share of light reflected, in [0, 1].
    float reflectance[3];
    // Share of light reflected in a lobe.
    float specular[3];
    // Factor on light that passes.
    float transmittance[3];
    // Exponent of a lobe, at least 0.
    float exponent;
    // Relative index of refraction, above 0.
    float eta;
    // Width of the distribution of facets, in [0.001, 1].
    float roughness;
    // Number of the light whose surface this is, or `FOGBOW_NO_LIGHT`. Each light with an area must be found so.
    uint32_t light;
} fogbow_hit;

// Surfaces of the host. Its callbacks are pure (the same answer to the same question), may be called by every thread that calls
// fogbow, and never throw, jump out or call fogbow with the same caches.
typedef struct {
    // sizeof(fogbow_host_scene).
    uint32_t size;
    // 0.
    uint32_t reserved;
    // Passed to the callbacks.
    void *context;
    // Writes the nearest surface within the ray's length, and returns 1; or returns 0 if there is none.
    int32_t (*closest_hit)(void *context, const fogbow_ray *ray, fogbow_hit *hit);
    // Returns 1 if any surface but a null interface lies within the ray's length, else 0. Null: `closest_hit` is asked.
    int32_t (*is_blocked)(void *context, const fogbow_ray *ray);
} fogbow_host_scene;

// A light. Fields that its kind does not use may hold anything.
typedef struct {
    // `FOGBOW_LIGHT_…`.
    uint32_t kind;
    // Where (m).
    float position[3];
    // Where it shines to; of any length above 0.
    float direction[3];
    // An edge (m).
    float edge_u[3];
    // The other one (m).
    float edge_v[3];
    // Of a ball (m).
    float radius;
    // Of a cone: half the angle (rad) within which it is as bright as along the axis; at most `cutoff`.
    float beam;
    // Of a cone: half the angle (rad) beyond which it is dark.
    float cutoff;
    // Of cos^exponent: 0, or at least 1.
    float exponent;
    // How bright, in the unit of the kind.
    float emission[3];
} fogbow_light;

// What light travels through, and where it comes from.
typedef struct {
    // sizeof(fogbow_world_parts).
    uint32_t size;
    // 0.
    uint32_t reserved;
    // The medium; null for vacuum. May be freed afterwards.
    const fogbow_medium *medium;
    // The surfaces; null for none. Copied; its callbacks and its context are used as long as the world is.
    const fogbow_host_scene *scene;
    // The lights, which are copied.
    const fogbow_light *lights;
    // How many.
    size_t light_count;
    // What holds all surfaces and media, or what matters of them.
    fogbow_box bounds;
} fogbow_world_parts;

// What methods find in a world: the numbers that settings follow from.
typedef struct {
    // sizeof(fogbow_outline).
    uint32_t size;
    // Mean free path (m) over all of the bounds, holes included; infinite in vacuum.
    float mean_free_path;
    // Free path (m) where the medium is thickest.
    float least_free_path;
    // Mean extinction (1/m) of the medium, by itself.
    float extinction;
    // Mean albedo of the medium, by extinction.
    float albedo;
    // Length (m) over which the medium varies.
    float resolution;
    // 1: the medium is constant wherever it was looked at.
    uint32_t is_constant;
    // 1: its extinction is the same in all channels.
    uint32_t is_grey;
    // 1: it may emit light.
    uint32_t is_emissive;
    // 1: there are surfaces.
    uint32_t has_surfaces;
    // 1: there are mirrors or glass.
    uint32_t has_mirrors;
    // How many lights there are.
    uint32_t light_count;
} fogbow_outline;

// Which random numbers a batch uses: element i those of sample `sample` of key `first_key + i`, whatever else is in the batch. In
// pictures, let the key of a pixel be `(uint64_t)y << 32 | x`.
typedef struct {
    // Changes all of them. Readers of caches take that of the caches' settings, too.
    uint64_t seed;
    // Key of the first element.
    uint64_t first_key;
    // Number of the sample.
    uint32_t sample;
    // 0.
    uint32_t reserved;
} fogbow_chance;

// How caches are filled and read. Zeros are what suits most.
typedef struct {
    // sizeof(fogbow_settings).
    uint32_t size;
    // Relative error that pictures may have, noise and bias together: 0.001 to 0.5; 0 for 0.02.
    float error;
    // Pixels of the picture that they are for, which says how many eye rays look for places; 0 for a small picture or a box.
    uint32_t pixels;
    // Eye rays that look for places, or points in a box; 0 for what `pixels` says. Fewer: quick, and small things have no records.
    uint32_t rays;
    // Random walks for each record; 0 for what `error` says. Fewer: quick and noisy.
    uint32_t walks;
    // 1: light straight from the lights is cached, too, and not connected to.
    uint32_t is_single_cached;
    // Changes all random numbers.
    uint64_t seed;
} fogbow_settings;

// The eye rays of a picture.
typedef struct {
    // sizeof(fogbow_view).
    uint32_t size;
    // Angular width of a pixel (rad), above 0.
    float pixel;
    // Passed to `ray`.
    const void *context;
    // Writes the ray through the point `at` of the picture: (0, 0) is the upper left corner, (1, 1) the lower right one. Pure,
    // and called by every
    // thread that runs jobs. `fogbow_camera_ray` is one.
    void (*ray)(const void *context, const float *at, fogbow_ray *ray);
} fogbow_view;

// What caches hold.
typedef struct {
    // sizeof(fogbow_caches_state).
    uint32_t size;
    // 1: a fill was left before its end.
    uint32_t is_open;
    // 1: a fill is under way.
    uint32_t is_filling;
    // Records of light scattered once from the lights, if that is cached.
    uint32_t single_records;
    // Records of light scattered once from surfaces.
    uint32_t surface_records;
    // Records of light scattered more than once.
    uint32_t multiple_records;
    // Records of irradiance.
    uint32_t irradiance_records;
    // The relative error asked for.
    float error;
    // Bytes of memory that records take.
    uint64_t bytes;
} fogbow_caches_state;

// Radiance along a ray, by part (W/(m² sr)). Fixed for ever: arrays of it cross the interface.
typedef struct {
    // Of lights seen, and of media that glow.
    float emitted[3];
    // Straight from the lights to a surface.
    float surface_direct[3];
    // From elsewhere to a surface.
    float surface_indirect[3];
    // Straight from the lights to the medium.
    float medium_single[3];
    // From surfaces to the medium.
    float medium_surface[3];
    // Scattered in the medium more than once.
    float medium_multiple[3];
    // Look-ups in caches.
    uint32_t lookups;
    // Look-ups that found nothing, so that a sample was taken.
    uint32_t misses;
} fogbow_light_parts;

// A relative deviation of the mean light of a picture, and how well it is known.
typedef struct {
    // -0.01 is one per cent too dark.
    double bias;
    // Its standard error; infinite if nothing is known.
    double error;
} fogbow_deviation;

// What an audit has found so far.
typedef struct {
    // sizeof(fogbow_findings).
    uint32_t size;
    // Eye rays compared.
    uint32_t rays;
    // Of all light.
    fogbow_deviation all;
    // Of the light that is cached, as a part of all light: better known.
    fogbow_deviation cached;
    // Of the light straight from the lights that the medium scatters once; 0 if that is not cached. Parts are of all light.
    fogbow_deviation single;
    // Of the light of surfaces that the medium scatters.
    fogbow_deviation surface;
    // Of the light that the medium scatters more than once.
    fogbow_deviation multiple;
    // Of the light from elsewhere to surfaces.
    fogbow_deviation irradiance;
    // Of the cached light in each channel, as a part of the mean of all channels.
    fogbow_deviation channels[3];
} fogbow_findings;

// What is baked, and how well. Zeros are what suits most, but for `counts` or `spacing`.
typedef struct {
    // sizeof(fogbow_bake_settings).
    uint32_t size;
    // Probes along x, y and z; all 0 for as many as cells of `spacing` fill the box.
    uint32_t counts[3];
    // Side of a cell (m), where `counts` are 0.
    float spacing;
    // What a probe holds, `FOGBOW_BASIS_…`.
    uint32_t basis;
    // Which light of a direction, `FOGBOW_QUANTITY_…`.
    uint32_t quantity;
    // Which light is in it, `FOGBOW_ORDERS_…`.
    uint32_t orders;
    // Relative standard error that is enough; 0 for 0.02.
    float error;
    // Passes at most, at least 2; 0 for 1024.
    uint32_t most_passes;
    // Directions of a pass; 0 for 16.
    uint32_t directions;
    // 1: `bounds` is the box that cells fill; 0: that of the world is.
    uint32_t has_bounds;
    // The box that cells fill.
    fogbow_box bounds;
    // Chooses other random numbers.
    uint64_t seed;
    // 1: light that was scattered before comes by photons that all probes share, many times faster: means over cells, without what media emit. 0: by paths from each probe.
    uint32_t photons;
    // 0.
    uint32_t reserved;
} fogbow_bake_settings;

// What a grid of probes is.
typedef struct {
    // sizeof(fogbow_probes_state).
    uint32_t size;
    // Probes along x, y and z. Probe (x, y, z) is number (z * counts[1] + y) * counts[0] + x, and stands in the centre of its cell.
    uint32_t counts[3];
    // The box that cells fill (m).
    fogbow_box bounds;
    // What a probe holds, `FOGBOW_BASIS_…`.
    uint32_t basis;
    // Numbers in colour that a probe holds.
    uint32_t numbers;
    // `FOGBOW_QUANTITY_…`.
    uint32_t quantity;
    // `FOGBOW_ORDERS_…`.
    uint32_t orders;
    // Pairs of neighbours with a surface between them: where light leaks.
    uint32_t leaks;
    // Standard error of the whole grid in proportion to its mean light; infinite before two passes.
    float relative_error;
    // How far look-ups between probes are off because the grid is too coarse, in proportion to the mean light: a root mean square.
    float relative_coarseness;
} fogbow_probes_state;

// Gradient of a colour: derivatives (per metre) along x, y and z, of three channels each. Fixed for ever.
typedef struct {
    // Derivative along x.
    float x[3];
    // Derivative along y.
    float y[3];
    // Derivative along z.
    float z[3];
} fogbow_gradient;

// Transmittance along a ray, with its gradients with respect to the ray's origin. Fixed for ever: arrays of it cross the interface.
typedef struct {
    // T = exp(-optical thickness).
    float value[3];
    // Its gradient with the far end held fixed.
    fogbow_gradient gradient_fixed;
    // Its gradient when the whole segment is moved.
    fogbow_gradient gradient_joint;
} fogbow_transmittance;

// A symmetric 2 × 2 matrix. Fixed for ever.
typedef struct {
    // First row, first column.
    float xx;
    // Off the diagonal.
    float xy;
    // Second row, second column.
    float yy;
} fogbow_symmetric2;

// The covariance of a light field's spectrum around a ray, over places (u, v) across it and directions (theta, phi). Fixed for ever.
typedef struct {
    // Over places (cycles²/m²).
    fogbow_symmetric2 spatial;
    // Of places with directions (cycles²/(m rad)): u theta, u phi, v theta, v phi.
    float mixed[4];
    // Over directions (cycles²/rad²).
    fogbow_symmetric2 angular;
} fogbow_covariance;

// A cached value with its gradient. Fixed for ever: arrays of it cross the interface.
typedef struct {
    // Where (m).
    float position[3];
    // How far it may be used (m), above 0.
    float radius;
    // The value: radiance (W/(m² sr)) or irradiance (W/m²).
    float value[3];
    // Its gradient (per metre).
    fogbow_gradient gradient;
} fogbow_record;

// A point of a medium that light is gathered for.
typedef struct {
    // sizeof(fogbow_receiver).
    uint32_t size;
    // Where (m).
    float point[3];
    // Where the light leaves to (unit).
    float to_eye[3];
    // What scatters it there; absorption and emission do not count.
    fogbow_properties properties;
} fogbow_receiver;

// The next vertex of a compensation path.
typedef struct {
    // sizeof(fogbow_vertex).
    uint32_t size;
    // 0: the path ends here, and all else is 0. 1: in the medium. 2: on a surface.
    uint32_t kind;
    // Where (m).
    float point[3];
    // Back to where it came from (unit).
    float to_eye[3];
    // Factor on the light that leaves the vertex towards `to_eye`; in the mean over vertices that makes what clamping takes.
    float weight[3];
} fogbow_vertex;

// A perspective camera, for `fogbow_camera_ray`.
typedef struct {
    // Where the eye is (m).
    float eye[3];
    // What it looks at (m).
    float target[3];
    // What is up; not along the way to `target`.
    float up[3];
    // Angle (rad) between the lower and the upper border of the picture, below pi.
    float field_of_view;
    // Width of the picture over its height.
    float aspect;
} fogbow_camera;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// Why the last function that this thread called failed, in a sentence; empty if it did not. Valid until the next call.
const char *fogbow_message(void);

// What a status means, in a few words, whatever thread it came from. Never null.
const char *fogbow_status_text(int32_t status);

// The version of the library that runs: `major << 16 | minor << 8 | patch`.
uint32_t fogbow_version(void);

// A medium that is the same everywhere. Put it into a box or a ball by `fogbow_medium_in_box` and `fogbow_medium_in_ball`.
fogbow_status fogbow_medium_homogeneous(const fogbow_properties *properties,
                                        fogbow_medium **medium);

// A medium from a grid of densities.
fogbow_status fogbow_medium_grid(const fogbow_grid *grid, fogbow_medium **medium);

// A medium of fractal noise without end.
fogbow_status fogbow_medium_noise(const fogbow_noise *noise, fogbow_medium **medium);

// A medium by callbacks of the host, without end. Put it into a box or a ball where it has sharp borders.
fogbow_status fogbow_medium_host(const fogbow_host_medium *host, fogbow_medium **medium);

// The medium `inner` inside a box, vacuum outside. `inner` may be freed afterwards.
fogbow_status fogbow_medium_in_box(const fogbow_medium *inner, const fogbow_box *bounds, fogbow_medium **medium);

// The medium `inner` inside a ball with a centre (x, y, z; m) and a radius (m), vacuum outside. `inner` may be freed afterwards.
fogbow_status fogbow_medium_in_ball(const fogbow_medium *inner,
                                    const float *centre,
                                    float radius,
                                    fogbow_medium **medium);

// Several media in the same space: coefficients and emission add up, phase functions mix by scattering. There should be no more than
// four different
// phase functions; where more meet, that of the medium which scatters most stands for all. No media are vacuum. `media` may be freed
// afterwards.
fogbow_status fogbow_medium_overlap(const fogbow_medium *const *media,
                                    size_t count,
                                    fogbow_medium **medium);

// Coefficients and emission of a medium at a point (x, y, z; m); the phase function is left isotropic.
fogbow_status fogbow_medium_properties(const fogbow_medium *medium, const float *point, fogbow_properties *properties);

// Frees the handle of a medium; worlds that use the medium keep it. Null is nothing.
fogbow_status fogbow_medium_free(fogbow_medium *medium);

// A new world.
fogbow_status fogbow_world_new(const fogbow_world_parts *parts, fogbow_world **world);

// Frees the handle of a world; work in it keeps it alive until that is freed, too. Null is nothing.
fogbow_status fogbow_world_free(fogbow_world *world);

// Looks at a world: at 24³ points of its medium and along 1024 rays.
fogbow_status fogbow_world_outline(const fogbow_world *world, fogbow_outline *outline);

// Radiance (W/(m² sr), three channels a ray) that arrives at the origins of rays, by one unbiased path each: the truth, with noise.
//
// Ray i has the random numbers of sample `sample` of the key `first_key + i` and of `seed`, whatever else is in the batch: in a
// picture of row after row let the key be `(uint64_t)y << 32 | x`.
fogbow_status fogbow_path_trace(const fogbow_world *world,
                                const fogbow_ray *rays,
                                size_t count,
                                fogbow_chance chance,
                                float *radiance);

// Numbers of the jobs that are due: from `first` to below `end`; equal ones if all is done.
//
// They stay due until it is their turn: hand each number out once, or work is done twice. Those of results that never came back are
// due again. Safe on any
// thread.
fogbow_status fogbow_work_jobs(const fogbow_work *work,
                               uint32_t *first,
                               uint32_t *end);

// Runs a job. Safe on any thread, many at a time. The result is to be accepted, or freed; it is null for a job whose result is there
// already or whose
// round is over, which is not run again.
fogbow_status fogbow_work_run(const fogbow_work *work,
                              uint32_t job,
                              fogbow_result **result);

// Takes a result back and frees its handle, whatever comes of it. Safe on any thread, in any order. Null is nothing.
fogbow_status fogbow_work_accept(fogbow_work *work, fogbow_result *result);

// Frees a result that is not accepted. Null is nothing.
fogbow_status fogbow_result_free(fogbow_result *result);

// Runs one job after the other on this thread, at most `jobs` of them (0: all there are). `left` (may be null): 1 if more are due, else 0.
//
// For hosts with one thread, and for a few jobs in every frame. Nobody else should run jobs of the same work meanwhile.
fogbow_status fogbow_work_step(fogbow_work *work,
                               uint32_t jobs,
                               int32_t *left);

// What is being done, in a word or two ("search", "bake"); valid for ever.
fogbow_status fogbow_work_stage(const fogbow_work *work, const char **stage);

// About what share of a bake is done, in [0, 1]; of other work 1 when it is done, and 0 before: how many rounds there will be,
// nobody knows.
fogbow_status fogbow_work_share(const fogbow_work *work,
                                float *share);

// Frees work, done or not. The caches of a fill keep what they have, and can be saved and filled again. Null is nothing.
fogbow_status fogbow_work_free(fogbow_work *work);

// The ray of a camera through a point `at` (x, y; [0, 1]; the first from the left, the second from above): fits `fogbow_view.ray`, with a
// `fogbow_camera` as the context. A camera that cannot be, or a null pointer, gives a ray of length 0.
void fogbow_camera_ray(const void *camera,
                       const float *at,
                       fogbow_ray *ray);

// New, empty caches for a world. Fill them by `fogbow_fill_view` or `fogbow_fill_box`.
fogbow_status fogbow_caches_new(const fogbow_world *world, const fogbow_settings *settings, fogbow_caches **caches);

// Frees the handle of caches; work that uses them keeps them alive. Null is nothing.
fogbow_status fogbow_caches_free(fogbow_caches *caches);

// Work that fills caches until every place has records that the eye rays of a picture ask for. Nothing is done yet: see `fogbow_work`.
//
// `world` is the one that the caches were made for. Fills of caches that have something add what is missing.
fogbow_status fogbow_fill_view(fogbow_caches *caches,
                               const fogbow_world *world,
                               const fogbow_view *view,
                               fogbow_work **work);

// As `fogbow_fill_view`, for light anywhere in a box of the medium: for probes.
fogbow_status fogbow_fill_box(fogbow_caches *caches,
                              const fogbow_world *world,
                              const fogbow_box *bounds,
                              fogbow_work **work);

// Tells what caches hold.
fogbow_status fogbow_caches_look(const fogbow_caches *caches, fogbow_caches_state *state);

// Saves caches as bytes: the same on every machine, with a version and checksums. `tag` says what they were made for: whatever changes the
// light in the world. With a null `buffer`, `needed` alone is written; else it may be null. Not while they are filled.
fogbow_status fogbow_caches_save(const fogbow_caches *caches,
                                 uint64_t tag,
                                 uint8_t *buffer,
                                 size_t capacity,
                                 size_t *needed);

// Reads caches that were saved with the same tag, in place of what is there. The settings must be those they were made with, or ask
// for less. Where it fails,
// some of what was there may be lost.
fogbow_status fogbow_caches_load(fogbow_caches *caches,
                                 uint64_t tag,
                                 const uint8_t *bytes,
                                 size_t count);

// Radiance (W/(m² sr), three channels a ray) that arrives at the origins of rays: one sample each of what caches say, with light
// straight from the lights
// and what is not cached sampled. `parts` may be null; else it has room for `count` elements. On any thread, also while the caches
// are filled.
fogbow_status fogbow_radiance(const fogbow_caches *caches,
                              const fogbow_world *world,
                              const fogbow_ray *rays,
                              size_t count,
                              fogbow_chance chance,
                              float *radiance,
                              fogbow_light_parts *parts);

// In-scattered radiance (W/(m² sr), three channels a point, without the scattering coefficient) at points (x, y, z; m) towards eyes
// (unit vectors
// from the points), all light together; what no record tells is sampled.
fogbow_status fogbow_in_scattered(const fogbow_caches *caches,
                                  const fogbow_world *world,
                                  const float *points,
                                  const float *to_eyes,
                                  size_t count,
                                  fogbow_chance chance,
                                  float *radiance);

// What caches say at points of the light that is scattered there, in spherical harmonics up to `degree` (0 to 8): (degree + 1)²
// coefficients of three
// channels each, point after point; zeros where no record reaches. `missing` (may be null): how many points those are.
//
// Without light straight from the lights, unless the settings cache it. See `fogbow_sh_evaluate` for the functions.
fogbow_status fogbow_in_scattered_sh(const fogbow_caches *caches,
                                     const float *points,
                                     size_t count,
                                     uint32_t degree,
                                     float *answers,
                                     size_t *missing);

// Fluence (W/m², three channels a point), the integral of radiance over all directions, of the light whose scattering is cached;
// zeros where no record reaches.
// `missing` (may be null): how many points those are.
fogbow_status fogbow_fluence(const fogbow_caches *caches,
                             const float *points,
                             size_t count,
                             float *fluences,
                             size_t *missing);

// Irradiance (W/m², three channels a point), without light straight from the lights, at points of surfaces with unit normals; zeros
// where no record reaches.
// `missing` (may be null): how many points those are.
fogbow_status fogbow_irradiance(const fogbow_caches *caches,
                                const float *points,
                                const float *normals,
                                size_t count,
                                float *irradiances,
                                size_t *missing);

// Work that compares the caches with path tracing along about `rays` eye rays of a view (0 for 16384; four times as many halve the
// error of what is found; where they say that records are wrong, it looks again along three times as many others, which alone count then).
// Meanwhile the caches can be read, but not filled.
fogbow_status fogbow_audit(const fogbow_caches *caches,
                           const fogbow_world *world,
                           const fogbow_view *view,
                           uint32_t rays,
                           fogbow_work **work);

// What an audit has found so far.
fogbow_status fogbow_audit_findings(const fogbow_work *work, fogbow_findings *findings);

// Drops the records that an audit has found off by certainly more than `error` (0.001 to 0.5); the next fill makes finer ones.
// `is_dropped`: 1 if any
// were, else 0. The audit is over then, and its work is to be freed.
fogbow_status fogbow_audit_drop_wrong(fogbow_work *work,
                                      float error,
                                      int32_t *is_dropped);

// Work that bakes light into a grid of probes; see `fogbow_work`. `caches` may be null: then all light is sampled, without bias.
// Else what the caches tell is read from
// them, which is quick, and as far off as they are; they should be filled for all of the box, and cannot be filled meanwhile.
fogbow_status fogbow_bake(const fogbow_world *world,
                          const fogbow_caches *caches,
                          const fogbow_bake_settings *settings,
                          fogbow_work **work);

// Takes the probes of a bake, as far as they are baked. The bake is over then, and its work is to be freed.
fogbow_status fogbow_bake_take(fogbow_work *work, fogbow_probes **probes);

// Frees the handle of probes. Null is nothing.
fogbow_status fogbow_probes_free(fogbow_probes *probes);

// Tells what a grid of probes is.
fogbow_status fogbow_probes_look(const fogbow_probes *probes, fogbow_probes_state *state);

// Copies all probes: `held` has room for `held_count` floats, three for each number of each probe, probe after probe; `states` for
// `probe_count` bytes,
// `FOGBOW_PROBE_…`. Either may be null, with a count of 0.
fogbow_status fogbow_probes_copy(const fogbow_probes *probes,
                                 float *held,
                                 size_t held_count,
                                 uint8_t *states,
                                 size_t probe_count);

// The light (three channels a point) at points (x, y, z; m) in directions (unit): towards an eye, or along a normal, as was baked.
// From the eight probes around,
// those that hold no light left out; beyond the outermost probes that of the nearest of them.
fogbow_status fogbow_probes_value(const fogbow_probes *probes,
                                  const float *points,
                                  const float *directions,
                                  size_t count,
                                  float *light);

// All numbers of the light at points: three floats for each number that a probe holds, point after point. `shares` (may be null):
// what share of
// the probes around each point holds light.
fogbow_status fogbow_probes_look_up(const fogbow_probes *probes,
                                    const float *points,
                                    size_t count,
                                    float *held,
                                    float *shares);

// Lets light spread into probes that hold none, for engines that mix all eight probes whatever they are. `reached` (may be null):
// how many it reached.
fogbow_status fogbow_probes_dilate(fogbow_probes *probes,
                                   size_t *reached);

// Saves probes as bytes; see `fogbow_caches_save`.
fogbow_status fogbow_probes_save(const fogbow_probes *probes,
                                 uint64_t tag,
                                 uint8_t *buffer,
                                 size_t capacity,
                                 size_t *needed);

// Probes that were saved with the same tag.
fogbow_status fogbow_probes_load(uint64_t tag, const uint8_t *bytes, size_t count, fogbow_probes **probes);

// Values (1/sr) of a phase function at cosines of the deflection (1: straight on). Their integral over the sphere is 1.
fogbow_status fogbow_phase_value(const fogbow_phase *phase, const float *cosines, size_t count, float *values);

// Derivatives (1/sr) of a phase function with respect to the cosine of the deflection: Jarosz et al. 2008, Eq. 44 and 45.
fogbow_status fogbow_phase_derivative(const fogbow_phase *phase,
                                      const float *cosines,
                                      size_t count,
                                      float *derivatives);

// The Legendre moment of a phase function for a degree from 0 to 16: 1 for degree 0, the mean cosine for degree 1.
fogbow_status fogbow_phase_moment(const fogbow_phase *phase, uint32_t degree, float *moment);

// Draws a direction (x, y, z; unit) from which light comes that leaves towards `to_eye` (unit), by two numbers `u` in [0, 1).
// `density` (1/sr; may be null): with which it
// was drawn, the value of the phase function.
fogbow_status fogbow_phase_sample(const fogbow_phase *phase,
                                  const float *to_eye,
                                  const float *u,
                                  float *to_light,
                                  float *density);

// Real spherical harmonics up to a degree from 0 to 16 in a direction (x, y, z; unit): (degree + 1)² values, number l² + l + m of
// degree l and order m, without the
// Condon–Shortley phase.
fogbow_status fogbow_sh_evaluate(const float *direction,
                                 uint32_t degree,
                                 float *values);

// Transmittance along rays with its gradients: Jarosz et al. 2008, Eq. 16 to 22. Exact where the medium says that it is constant;
// elsewhere marched, in
// `step_count` steps (`FOGBOW_STEPS_…`) of every part of a ray in between. A medium of the host is asked by its callbacks.
fogbow_status fogbow_transmittance_along(const fogbow_medium *medium,
                                         const fogbow_ray *rays,
                                         size_t count,
                                         uint32_t steps,
                                         uint32_t step_count,
                                         fogbow_transmittance *answers);

// After a flight of `distance` (m): Fig. 3. `light` and `changed` may be the same in all operators.
fogbow_status fogbow_covariance_travelled(const fogbow_covariance *light, float distance, fogbow_covariance *changed);

// Multiplied in space by a mask of the covariance `mask` (cycles²/m²): an occluder, a texture. Fig. 3.
fogbow_status fogbow_covariance_masked(const fogbow_covariance *light,
                                       const fogbow_symmetric2 *mask,
                                       fogbow_covariance *changed);

// Attenuated along `distance` (m) by a medium whose extinction has the Hessian `hessian` (1/m³) across the ray: Eq. 6 and 7.
fogbow_status fogbow_covariance_attenuated(const fogbow_covariance *light,
                                           const fogbow_symmetric2 *hessian,
                                           float distance,
                                           fogbow_covariance *changed);

// Scattered by a lobe of angular covariance `lobe` (cycles²/rad²; see `fogbow_phase_covariance`), turned by an angle of cosine
// `cos_alpha` in the plane of u: Eq. 11 to 13.
fogbow_status fogbow_covariance_scattered(const fogbow_covariance *light,
                                          float cos_alpha,
                                          const fogbow_symmetric2 *lobe,
                                          fogbow_covariance *changed);

// In a frame turned about the ray by an angle of this cosine and sine: u' = cos u + sin v.
fogbow_status fogbow_covariance_rotated(const fogbow_covariance *light,
                                        float cos,
                                        float sin,
                                        fogbow_covariance *changed);

// Reflected by a surface: met at an angle of this cosine in the plane of u, of curvature `curvature` (1/m, convex positive; first axis in
// the plane of incidence), with a lobe of angular covariance `lobe` (cycles²/rad²; see `fogbow_phong_covariance`), and left at an
// angle of cosine `cos_out`.
fogbow_status fogbow_covariance_reflected(const fogbow_covariance *light,
                                          const float *cosines,
                                          const fogbow_symmetric2 *curvature,
                                          const fogbow_symmetric2 *lobe,
                                          fogbow_covariance *changed);

// Of the sum of two light fields in the same frame, with energies `weight` and `other_weight` (not negative).
fogbow_status fogbow_covariance_combined(const fogbow_covariance *light,
                                         float weight,
                                         const fogbow_covariance *other,
                                         float other_weight,
                                         fogbow_covariance *changed);

// Covariance (cycles²/m²) across the ray of the fluence: X - C P⁺ Cᵀ.
fogbow_status fogbow_covariance_slice(const fogbow_covariance *light, fogbow_symmetric2 *slice);

// Angular covariance (cycles²/rad²) of a phase function around a deflection of this cosine: Eq. 13 and 14.
fogbow_status fogbow_phase_covariance(const fogbow_phase *phase, float cos_deflection, fogbow_symmetric2 *lobe);

// Angular covariance (cycles²/rad²) of a Phong lobe of an exponent (not negative).
fogbow_status fogbow_phong_covariance(float exponent, fogbow_symmetric2 *lobe);

// What records say about the light at a point (x, y, z; m), three channels: those whose balls hold it, each with a weight that falls
// to 0 at its
// radius. `tolerance` bounds exponents; 0 for 1. `reached` (may be null): how many there were; the light is 0 if none.
fogbow_status fogbow_extrapolate(const fogbow_record *records,
                                 size_t count,
                                 uint32_t extrapolation,
                                 float tolerance,
                                 const float *point,
                                 float *light,
                                 size_t *reached);

// How far (m) a value may be carried where its logarithm may change by `tolerance`: the least of tolerance · L/|grad L| over
// channels (Eq. 34 for one sample); infinite where nothing changes.
fogbow_status fogbow_record_radius(const float *value,
                                   const fogbow_gradient *gradient,
                                   float tolerance,
                                   float *radius);

// What clamping within `radius` (m, above 0) leaves and takes of a connection over `distance` (m, above 0) with the product of
// cosines `cosines` (1 in a medium): `clamped` is
// min(G, 1/radius²) (1/m²) with G = cosines/distance², `missing` the share of G that is taken. Each may be null.
fogbow_status fogbow_clamped_connection(float radius,
                                        float distance,
                                        float cosines,
                                        float *clamped,
                                        float *missing);

// What one step of compensation within `radius` (m) makes of the light it is given, in an even isotropic medium of this extinction
// (1/m) and albedo: after n steps
// its n-th power is still missing.
fogbow_status fogbow_contraction(float extinction,
                                 float albedo,
                                 float radius,
                                 float *share);

// Draws the next vertex of a compensation path within `radius` (m) of a receiver (Eq. 3 to 5), with the random numbers of `chance`.
fogbow_status fogbow_compensation_vertex(const fogbow_world *world,
                                         const fogbow_receiver *receiver,
                                         float radius,
                                         uint32_t compensation,
                                         fogbow_chance chance,
                                         fogbow_vertex *vertex);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* FOGBOW_H */
