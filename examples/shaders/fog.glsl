// Light in fog, from what `fogbow bake SCENE.xml --basis sh0|sh1|sh2 -o NAME.ktx2` writes, or from the textures of the package in examples/web: fog.wgsl
// for WebGL2 (GLSL ES 3.00), function by function. A 3D texture for each number of a probe, validity in alpha, one of the medium: albedo, extinction in alpha, and
// two of the surfaces around probes: a point at an offset o, in cells, is behind one where dot(o, wall) > 1.
//
// Copy it into your shader, behind `#version 300 es` and precisions for float, int and sampler3D (highp). The textures are read texel by texel, because
// probes in walls, and those behind a wall, must have no part in what is mixed: filters do not matter. Where no wall is thinner than a cell, bind textures of one
// texel, all 0, as `wall0` and `wall1`. With FOG_FILTERED they are read by hardware instead (LINEAR, CLAMP_TO_EDGE): a fifth of the time, right where all
// probes around are valid and no wall stands between them; elsewhere what dilation has left in the others, and light leaks through walls.

// The box: its corner, and its size (m); what light was multiplied by (--scale); numbers of a probe: 1, 4 or 9. What is bound beyond them is not read.
uniform vec3 probes_corner;
uniform vec3 probes_size;
uniform float probes_scale;
uniform int probes_numbers;
uniform sampler3D sh0, sh1, sh2, sh3, sh4, sh5, sh6, sh7, sh8;
uniform sampler3D medium;
uniform sampler3D wall0, wall1;

// Spherical harmonics in the order l (l + 1) + m, orthonormal, without the sign of Condon and Shortley.
#define EXPANSION(READ, at, first, d, light)                                                                                          \
    light = 0.2820948 * first;                                                                                                      \
    if (probes_numbers >= 4) {                                                                                                      \
        light += 0.4886025 * (d.y * READ(sh1, at) + d.z * READ(sh2, at) + d.x * READ(sh3, at));                                     \
    }                                                                                                                               \
    if (probes_numbers >= 9) {                                                                                                      \
        light += 1.0925484 * (d.x * d.y * READ(sh4, at) + d.y * d.z * READ(sh5, at) + d.x * d.z * READ(sh7, at));                   \
        light += 0.31539157 * (3.0 * d.z * d.z - 1.0) * READ(sh6, at);                                                              \
        light += 0.5462742 * (d.x * d.x - d.y * d.y) * READ(sh8, at);                                                               \
    }

#ifdef FOG_FILTERED

#define FILTERED(map, at) texture(map, at).rgb

vec3 in_scattered(vec3 point, vec3 to_eye) {
    vec3 at = (point - probes_corner) / probes_size;
    vec3 first = FILTERED(sh0, at);
    vec3 light;
    EXPANSION(FILTERED, at, first, to_eye, light)
    return max(light, vec3(0.0)) / probes_scale;
}

vec4 matter(vec3 point) {
    return texture(medium, (point - probes_corner) / probes_size);
}

#else

// The eight probes around a point: the texel of the lowest, of the highest, and how far between them the point lies.
struct Around {
    ivec3 low;
    ivec3 high;
    vec3 share;
};

Around around(vec3 point) {
    vec3 counts = vec3(textureSize(sh0, 0));
    // Probes stand in the centres of cells. Beyond the outermost the nearest of them counts.
    vec3 at = clamp((point - probes_corner) / probes_size * counts - 0.5, vec3(0.0), counts - 1.0);
    vec3 low = min(floor(at), max(counts - 2.0, vec3(0.0)));
    vec3 high = min(low + 1.0, counts - 1.0);
    return Around(ivec3(low), ivec3(high), at - low);
}

ivec3 corner_texel(Around place, int corner) {
    return ivec3(
        (corner & 1) != 0 ? place.high.x : place.low.x,
        (corner & 2) != 0 ? place.high.y : place.low.y,
        (corner & 4) != 0 ? place.high.z : place.low.z);
}

float corner_weight(Around place, int corner) {
    vec3 is_high = vec3((corner & 1) != 0, (corner & 2) != 0, (corner & 4) != 0);
    vec3 weights = mix(1.0 - place.share, place.share, is_high);
    return weights.x * weights.y * weights.z;
}

#define TEXEL(map, at) texelFetch(map, at, 0).rgb

// How much of a part a probe of the eight has in the light: 1 before a surface, next to none behind it.
float sees(Around place, int corner) {
    ivec3 texel = corner_texel(place, corner);
    vec3 is_high = vec3((corner & 1) != 0, (corner & 2) != 0, (corner & 4) != 0);
    vec3 near = texelFetch(wall0, min(texel, textureSize(wall0, 0) - 1), 0).rgb;
    vec3 other = texelFetch(wall1, min(texel, textureSize(wall1, 0) - 1), 0).rgb;
    vec3 offset = mix(place.share, place.share - 1.0, is_high);
    float s = max(dot(offset, near), dot(offset, other));
    float far = max(s, 1.0);
    float fourth = far * far * far * far;
    return clamp((1.0 - s) * 10.0, 0.0, 1.0) + 1e-6 / (fourth * fourth);
}

// In-scattered radiance (W/(m^2 sr)) at a point towards the eye (unit): the phase function is in it, the scattering coefficient is not.
// sum(w v s c) / sum(w v s) over the eight probes around, v: 1 where a probe is valid, s: whether it sees the point; sum(w c) where none is valid.
vec3 in_scattered(vec3 point, vec3 to_eye) {
    Around place = around(point);
    vec3 light = vec3(0.0);
    vec3 hidden = vec3(0.0);
    float valid = 0.0;
    for (int corner = 0; corner < 8; corner++) {
        ivec3 texel = corner_texel(place, corner);
        float weight = corner_weight(place, corner);
        vec4 first = texelFetch(sh0, texel, 0);
        vec3 seen;
        EXPANSION(TEXEL, texel, first.rgb, to_eye, seen)
        float part = weight * first.a * sees(place, corner);
        light += part * seen;
        hidden += weight * seen;
        valid += part;
    }
    return max(valid > 0.0 ? light / valid : hidden, vec3(0.0)) / probes_scale;
}

// Albedo, and extinction (1/m) in alpha.
vec4 matter(vec3 point) {
    Around place = around(point);
    vec4 sum = vec4(0.0);
    for (int corner = 0; corner < 8; corner++) {
        sum += corner_weight(place, corner) * texelFetch(medium, corner_texel(place, corner), 0);
    }
    return sum;
}

#endif

// Fog between the eye and what it sees at a distance of `depth` (m) in a direction (unit): light that is scattered towards the eye, and transmittance in
// alpha: colour = fog.rgb + fog.a * surface. In each of so many steps the medium is taken as even.
vec4 fog(vec3 eye, vec3 direction, float depth, int steps) {
    // The part of the ray that lies in the box.
    vec3 to_low = (probes_corner - eye) / direction;
    vec3 to_high = (probes_corner + probes_size - eye) / direction;
    vec3 nearer = min(to_low, to_high);
    vec3 farther = max(to_low, to_high);
    float begin = max(max(nearer.x, nearer.y), max(nearer.z, 0.0));
    float end = min(min(farther.x, farther.y), min(farther.z, depth));
    vec3 light = vec3(0.0);
    float through = 1.0;
    if (end > begin) {
        float each = (end - begin) / float(steps);
        for (int i = 0; i < steps; i++) {
            vec3 point = eye + (begin + (float(i) + 0.5) * each) * direction;
            vec4 here = matter(point);
            float passed = exp(-here.a * each);
            light += through * (1.0 - passed) * here.rgb * in_scattered(point, -direction);
            through *= passed;
        }
    }
    return vec4(light, through);
}
