// Light in fog, from what `fogbow bake SCENE.xml --basis sh0|sh1|sh2 -o NAME.ktx2` writes: a 3D texture for each number of a probe, validity in
// alpha (NAME-sh0.ktx2 and so on), one of the medium (NAME-medium.ktx2: albedo, extinction in alpha), and two of the surfaces around probes
// (NAME-wall0.ktx2, NAME-wall1.ktx2: a point at an offset o, in cells, is behind one where dot(o, wall) > 1).
//
// Of a bake with --refine, all of these are atlases: first the probes of all cells, and above them in z bricks of 4 x 4 x 4 probes of half the spacing, and
// so on. NAME-index.ktx2 says for each brick of each finer level at which texel it begins, with 1 in alpha where it is there; alpha of wall0 is 1
// where a probe has neighbours of its level on all sides. Without finer levels, bind a texture of one texel as `index`.
//
// Copy it into your shader. The textures are read texel by texel, because probes in walls, and those behind a wall, must have no part in what is mixed: no sampler
// is needed. Where no wall is thinner than a cell, and without finer levels, bind textures of one texel, all 0, as `wall0` and `wall1`.

struct Probes {
    // The box: its corner, and its size (m).
    corner: vec3<f32>,
    // What light was multiplied by (--scale).
    scale: f32,
    size: vec3<f32>,
    // Numbers of a probe: 1, 4 or 9. What is bound beyond them is not read.
    numbers: u32,
    // Probes along x, y and z in the box, and how many finer levels there are (fogbow.counts, fogbow.levels). With none, counts are not read.
    counts: vec3<u32>,
    levels: u32,
}

@group(0) @binding(0) var<uniform> probes: Probes;
@group(0) @binding(1) var sh0: texture_3d<f32>;
@group(0) @binding(2) var sh1: texture_3d<f32>;
@group(0) @binding(3) var sh2: texture_3d<f32>;
@group(0) @binding(4) var sh3: texture_3d<f32>;
@group(0) @binding(5) var sh4: texture_3d<f32>;
@group(0) @binding(6) var sh5: texture_3d<f32>;
@group(0) @binding(7) var sh6: texture_3d<f32>;
@group(0) @binding(8) var sh7: texture_3d<f32>;
@group(0) @binding(9) var sh8: texture_3d<f32>;
@group(0) @binding(10) var medium: texture_3d<f32>;
@group(0) @binding(11) var wall0: texture_3d<f32>;
@group(0) @binding(12) var wall1: texture_3d<f32>;
@group(0) @binding(13) var index: texture_3d<f32>;

// The eight cells of a level around a point: the lowest, the highest, how far between them the point lies, where their probes are, and what part
// they have in the light.
struct Around {
    low: vec3<i32>,
    high: vec3<i32>,
    share: vec3<f32>,
    texels: array<vec3<i32>, 8>,
    part: f32,
}

fn around(point: vec3<f32>, level: u32) -> Around {
    let all = select(probes.counts, textureDimensions(sh0), vec3<bool>(probes.levels == 0u));
    let counts = vec3<f32>(all << vec3<u32>(level));
    // Probes stand in the centres of cells. Beyond the outermost the nearest of them counts.
    let at = clamp((point - probes.corner) / probes.size * counts - 0.5, vec3<f32>(0.0), counts - 1.0);
    let low = min(floor(at), max(counts - 2.0, vec3<f32>(0.0)));
    let high = min(low + 1.0, counts - 1.0);
    var place = Around(vec3<i32>(low), vec3<i32>(high), at - low, array<vec3<i32>, 8>(), 1.0);
    // Levels before this one in the index.
    var layer = 0;
    for (var other = 1u; other < level; other++) {
        layer += i32(((all.z << other) + 3u) / 4u);
    }
    // A finer level has a part within those probes that have neighbours on all sides: all eight are there, then.
    var part = 0.0;
    var inner = 0u;
    for (var corner = 0u; corner < 8u; corner++) {
        var texel = corner_cell(place, corner);
        if level > 0u {
            let brick = textureLoad(index, texel / 4 + vec3<i32>(0, 0, layer), 0);
            texel = vec3<i32>(brick.xyz) + texel % 4;
            if brick.a * textureLoad(wall0, texel, 0).a > 0.0 {
                part += corner_weight(place, corner);
                inner++;
            }
        }
        place.texels[corner] = texel;
    }
    place.part = select(min(part, 1.0), 1.0, level == 0u || inner == 8u);
    return place;
}

fn corner_cell(place: Around, corner: u32) -> vec3<i32> {
    let is_high = vec3<bool>((corner & 1u) != 0u, (corner & 2u) != 0u, (corner & 4u) != 0u);
    return select(place.low, place.high, is_high);
}

fn corner_weight(place: Around, corner: u32) -> f32 {
    let is_high = vec3<bool>((corner & 1u) != 0u, (corner & 2u) != 0u, (corner & 4u) != 0u);
    let weights = select(1.0 - place.share, place.share, is_high);
    return weights.x * weights.y * weights.z;
}

// How much of a part a probe of the eight has in the light: 1 before a surface, next to none behind it.
fn sees(place: Around, corner: u32, texel: vec3<i32>) -> f32 {
    let is_high = vec3<bool>((corner & 1u) != 0u, (corner & 2u) != 0u, (corner & 4u) != 0u);
    let near = textureLoad(wall0, min(texel, vec3<i32>(textureDimensions(wall0)) - 1), 0).rgb;
    let other = textureLoad(wall1, min(texel, vec3<i32>(textureDimensions(wall1)) - 1), 0).rgb;
    let offset = select(place.share, place.share - 1.0, is_high);
    let s = max(dot(offset, near), dot(offset, other));
    let far = max(s, 1.0);
    let fourth = far * far * far * far;
    return clamp((1.0 - s) * 10.0, 0.0, 1.0) + 1e-6 / (fourth * fourth);
}

// In-scattered radiance (W/(m^2 sr)) at a point towards the eye (unit): the phase function is in it, the scattering coefficient is not.
// sum(w v s c) / sum(w v s) over the eight probes around, v: 1 where a probe is valid, s: whether it sees the point; sum(w c) where none is valid. Where a finer level
// ends, over its probes and those of the coarser one: weights go over from one into the other.
fn in_scattered(point: vec3<f32>, to_eye: vec3<f32>) -> vec3<f32> {
    var light = vec3<f32>(0.0);
    var hidden = vec3<f32>(0.0);
    var valid = 0.0;
    var rest = 1.0;
    for (var level = probes.levels + 1u; level > 0u && rest > 0.0; level--) {
        var place = around(point, level - 1u);
        for (var corner = 0u; corner < 8u && place.part > 0.0; corner++) {
            let texel = place.texels[corner];
            let weight = rest * place.part * corner_weight(place, corner);
            let first = textureLoad(sh0, texel, 0);
            let seen = expansion(first.rgb, texel, to_eye);
            let part = weight * first.a * sees(place, corner, texel);
            light += part * seen;
            hidden += weight * seen;
            valid += part;
        }
        rest *= 1.0 - place.part;
    }
    return max(select(hidden, light / valid, valid > 0.0), vec3<f32>(0.0)) / probes.scale;
}

// Spherical harmonics in the order l (l + 1) + m, orthonormal, without the sign of Condon and Shortley.
fn expansion(first: vec3<f32>, texel: vec3<i32>, d: vec3<f32>) -> vec3<f32> {
    var light = 0.2820948 * first;
    if probes.numbers >= 4u {
        light += 0.4886025 * (d.y * textureLoad(sh1, texel, 0).rgb + d.z * textureLoad(sh2, texel, 0).rgb + d.x * textureLoad(sh3, texel, 0).rgb);
    }
    if probes.numbers >= 9u {
        light += 1.0925484 * (d.x * d.y * textureLoad(sh4, texel, 0).rgb + d.y * d.z * textureLoad(sh5, texel, 0).rgb + d.x * d.z * textureLoad(sh7, texel, 0).rgb);
        light += 0.31539157 * (3.0 * d.z * d.z - 1.0) * textureLoad(sh6, texel, 0).rgb;
        light += 0.5462742 * (d.x * d.x - d.y * d.y) * textureLoad(sh8, texel, 0).rgb;
    }
    return light;
}

// Albedo, and extinction (1/m) in alpha.
fn matter(point: vec3<f32>) -> vec4<f32> {
    var sum = vec4<f32>(0.0);
    var rest = 1.0;
    for (var level = probes.levels + 1u; level > 0u && rest > 0.0; level--) {
        var place = around(point, level - 1u);
        for (var corner = 0u; corner < 8u && place.part > 0.0; corner++) {
            sum += rest * place.part * corner_weight(place, corner) * textureLoad(medium, place.texels[corner], 0);
        }
        rest *= 1.0 - place.part;
    }
    return sum;
}

// Fog between the eye and what it sees at a distance of `depth` (m) in a direction (unit): light that is scattered towards the eye, and transmittance in
// alpha: colour = fog.rgb + fog.a * surface. In each of so many steps the medium is taken as even.
fn fog(eye: vec3<f32>, direction: vec3<f32>, depth: f32, steps: u32) -> vec4<f32> {
    // The part of the ray that lies in the box.
    let to_low = (probes.corner - eye) / direction;
    let to_high = (probes.corner + probes.size - eye) / direction;
    let nearer = min(to_low, to_high);
    let farther = max(to_low, to_high);
    let begin = max(max(nearer.x, nearer.y), max(nearer.z, 0.0));
    let end = min(min(farther.x, farther.y), min(farther.z, depth));
    var light = vec3<f32>(0.0);
    var through = 1.0;
    if end > begin {
        let step = (end - begin) / f32(steps);
        for (var i = 0u; i < steps; i++) {
            let point = eye + (begin + (f32(i) + 0.5) * step) * direction;
            let here = matter(point);
            let passed = exp(-here.a * step);
            light += through * (1.0 - passed) * here.rgb * in_scattered(point, -direction);
            through *= passed;
        }
    }
    return vec4<f32>(light, through);
}
