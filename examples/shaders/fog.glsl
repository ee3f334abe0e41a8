// Light in fog, from what `fogbow bake SCENE.xml --basis sh0|sh1|sh2 -o NAME.ktx2` writes, or from the textures of the package in examples/web: fog.wgsl
// for WebGL2 (GLSL ES 3.00), function by function. A 3D texture for each number of a probe, validity in alpha, one of the medium: albedo, extinction in alpha, and
// two of the surfaces around probes: a point at an offset o, in cells, is behind one where dot(o, wall) > 1.
//
// Copy it into your shader, behind `#version 300 es` and precisions for float, int and sampler3D (highp). The textures are read texel by texel, because
// probes in walls, and those behind a wall, must have no part in what is mixed: filters do not matter. Where no wall is thinner than a cell, bind textures of one
// texel, all 0, as `wall0` and `wall1`. With FOG_LEVELS, finer levels of a bake with --refine are read, too: then all textures are atlases, and `index` says where
// bricks of 4 x 4 x 4 probes are, as fog.wgsl tells. With FOG_FILTERED they are read by hardware instead (LINEAR, CLAMP_TO_EDGE): a fifth of the time, right where all
// probes around are valid and no wall stands between them; elsewhere what dilation has left in the others, and light leaks through walls.

// The box: its corner, and its size (m); what light was multiplied by (--scale); numbers of a probe: 1, 4 or 9. What is bound beyond them is not read.
uniform vec3 probes_corner;
uniform vec3 probes_size;
uniform float probes_scale;
uniform int probes_numbers;
uniform sampler3D sh0, sh1, sh2, sh3, sh4, sh5, sh6, sh7, sh8;
uniform sampler3D medium;
uniform sampler3D wall0, wall1;

#ifdef FOG_LEVELS
// Probes along x, y and z in the box, and how many finer levels there are (fogbow.counts, fogbow.levels).
uniform ivec3 probes_counts;
uniform int probes_levels;
uniform sampler3D index;
#endif

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

// Finer levels, which hardware does not find, are left out.
vec3 filtered_at(vec3 point) {
    vec3 at = (point - probes_corner) / probes_size;
#ifdef FOG_LEVELS
    vec3 counts = vec3(probes_counts);
    at = clamp(at * counts, vec3(0.5), counts - 0.5) / vec3(textureSize(sh0, 0));
#endif
    return at;
}

vec3 in_scattered(vec3 point, vec3 to_eye) {
    vec3 at = filtered_at(point);
    vec3 first = FILTERED(sh0, at);
    vec3 light;
    EXPANSION(FILTERED, at, first, to_eye, light)
    return max(light, vec3(0.0)) / probes_scale;
}

vec4 matter(vec3 point) {
    return texture(medium, filtered_at(point));
}

#else

#ifndef FOG_LEVELS
const int probes_levels = 0;
#endif

// The eight cells of a level around a point: the lowest, the highest, how far between them the point lies, where their probes are, and what part
// they have in the light.
struct Around {
    ivec3 low;
    ivec3 high;
    vec3 share;
    ivec3 texels[8];
    float part;
};

ivec3 corner_cell(Around place, int corner) {
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

Around around(vec3 point, int level) {
#ifdef FOG_LEVELS
    ivec3 all = probes_levels > 0 ? probes_counts : textureSize(sh0, 0);
#else
    ivec3 all = textureSize(sh0, 0);
#endif
    vec3 counts = vec3(all << level);
    // Probes stand in the centres of cells. Beyond the outermost the nearest of them counts.
    vec3 at = clamp((point - probes_corner) / probes_size * counts - 0.5, vec3(0.0), counts - 1.0);
    vec3 low = min(floor(at), max(counts - 2.0, vec3(0.0)));
    vec3 high = min(low + 1.0, counts - 1.0);
    Around place;
    place.low = ivec3(low);
    place.high = ivec3(high);
    place.share = at - low;
    place.part = 1.0;
    for (int corner = 0; corner < 8; corner++) {
        place.texels[corner] = corner_cell(place, corner);
    }
#ifdef FOG_LEVELS
    if (level > 0) {
        // Levels before this one in the index.
        int layer = 0;
        for (int other = 1; other < level; other++) {
            layer += ((all.z << other) + 3) / 4;
        }
        // A finer level has a part within those probes that have neighbours on all sides: all eight are there, then.
        float part = 0.0;
        int inner = 0;
        for (int corner = 0; corner < 8; corner++) {
            ivec3 cell = place.texels[corner];
            vec4 brick = texelFetch(index, cell / 4 + ivec3(0, 0, layer), 0);
            ivec3 texel = ivec3(brick.xyz) + cell % 4;
            if (brick.a * texelFetch(wall0, texel, 0).a > 0.0) {
                part += corner_weight(place, corner);
                inner++;
            }
            place.texels[corner] = texel;
        }
        place.part = inner == 8 ? 1.0 : min(part, 1.0);
    }
#endif
    return place;
}

#define TEXEL(map, at) texelFetch(map, at, 0).rgb

// How much of a part a probe of the eight has in the light: 1 before a surface, next to none behind it.
float sees(Around place, int corner, ivec3 texel) {
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
// sum(w v s c) / sum(w v s) over the eight probes around, v: 1 where a probe is valid, s: whether it sees the point; sum(w c) where none is valid. Where a finer level
// ends, over its probes and those of the coarser one: weights go over from one into the other.
vec3 in_scattered(vec3 point, vec3 to_eye) {
    vec3 light = vec3(0.0);
    vec3 hidden = vec3(0.0);
    float valid = 0.0;
    float rest = 1.0;
    for (int level = probes_levels; level >= 0 && rest > 0.0; level--) {
        Around place = around(point, level);
        for (int corner = 0; corner < 8 && place.part > 0.0; corner++) {
            ivec3 texel = place.texels[corner];
            float weight = rest * place.part * corner_weight(place, corner);
            vec4 first = texelFetch(sh0, texel, 0);
            vec3 seen;
            EXPANSION(TEXEL, texel, first.rgb, to_eye, seen)
            float part = weight * first.a * sees(place, corner, texel);
            light += part * seen;
            hidden += weight * seen;
            valid += part;
        }
        rest *= 1.0 - place.part;
    }
    return max(valid > 0.0 ? light / valid : hidden, vec3(0.0)) / probes_scale;
}

// Albedo, and extinction (1/m) in alpha.
vec4 matter(vec3 point) {
    vec4 sum = vec4(0.0);
    float rest = 1.0;
    for (int level = probes_levels; level >= 0 && rest > 0.0; level--) {
        Around place = around(point, level);
        for (int corner = 0; corner < 8 && place.part > 0.0; corner++) {
            sum += rest * place.part * corner_weight(place, corner) * texelFetch(medium, place.texels[corner], 0);
        }
        rest *= 1.0 - place.part;
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
