// Draws the room with WebGL2: one ray for each pixel, fog marched along it. Light straight from the lamp is computed here; light that was scattered
// or reflected before comes from the baked probes.

import { BALL, BOUNDS, BOXES, LAMP_RADIUS, SMOKE, WALLS, smokeDensity } from "./room.js";

const number = (x) => x.toFixed(6);
const vector = (v) => `vec3(${v.map(number).join(", ")})`;

const HEAD = `#version 300 es
precision highp float;
precision highp int;
precision highp sampler3D;
`;

const CORNERS = `#version 300 es
out vec2 film;
void main() {
    film = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 2.0;
    gl_Position = vec4(film * 2.0 - 1.0, 0.0, 1.0);
}`;

const ROOM = `
const vec3 LOW = ${vector(BOUNDS[0])}, HIGH = ${vector(BOUNDS[1])};
const vec3 WALLS[6] = vec3[6](${WALLS.map(vector).join(", ")});
const int BOXES = ${BOXES.length};
const vec3 BOX_LOW[BOXES] = vec3[BOXES](${BOXES.map((box) => vector(box.min)).join(", ")});
const vec3 BOX_HIGH[BOXES] = vec3[BOXES](${BOXES.map((box) => vector(box.max)).join(", ")});
const vec3 BOX_COLOUR[BOXES] = vec3[BOXES](${BOXES.map((box) => vector(box.colour)).join(", ")});
const vec3 BALL = ${vector(BALL.centre)}, BALL_COLOUR = ${vector(BALL.colour)};
const float BALL_RADIUS = ${number(BALL.radius)}, LAMP_RADIUS = ${number(LAMP_RADIUS)};
const vec3 SMOKE_LOW = ${vector(SMOKE.min)}, SMOKE_SIZE = ${vector(SMOKE.max.map((m, i) => m - SMOKE.min[i]))};

struct Seen { float depth; vec3 normal; vec3 colour; bool is_lamp; };

uniform vec3 lamp;

// Where a ray enters a ball; beyond everything if it does not.
float ball(vec3 from, vec3 direction, vec3 centre, float radius) {
    vec3 to = from - centre;
    float half_way = dot(to, direction);
    vec3 nearest = to - direction * half_way;
    float inside = radius * radius - dot(nearest, nearest);
    float at = -half_way - sqrt(max(inside, 0.0));
    return inside > 0.0 && at > 0.0 ? at : 1e9;
}

// Where a ray enters a box.
float block(vec3 from, vec3 direction, int box, out vec3 normal) {
    vec3 a = (BOX_LOW[box] - from) / direction, b = (BOX_HIGH[box] - from) / direction;
    vec3 near = min(a, b), far = max(a, b);
    float enter = max(near.x, max(near.y, near.z)), leave = min(far.x, min(far.y, far.z));
    normal = -sign(direction) * vec3(equal(near, vec3(enter)));
    return enter < leave && enter > 0.0 ? enter : 1e9;
}

Seen look(vec3 from, vec3 direction) {
    vec3 far = max((LOW - from) / direction, (HIGH - from) / direction);
    Seen seen;
    seen.is_lamp = false;
    seen.depth = min(far.x, min(far.y, far.z));
    int axis = seen.depth == far.x ? 0 : seen.depth == far.y ? 1 : 2;
    bool is_high = direction[axis] > 0.0;
    seen.normal = vec3(0.0);
    seen.normal[axis] = is_high ? -1.0 : 1.0;
    seen.colour = WALLS[2 * axis + (is_high ? 1 : 0)];
    for (int i = 0; i < BOXES; i++) {
        vec3 normal;
        float at = block(from, direction, i, normal);
        if (at < seen.depth) { seen.depth = at; seen.normal = normal; seen.colour = BOX_COLOUR[i]; }
    }
    float at = ball(from, direction, BALL, BALL_RADIUS);
    if (at < seen.depth) { seen.depth = at; seen.normal = normalize(from + at * direction - BALL); seen.colour = BALL_COLOUR; }
    at = ball(from, direction, lamp, LAMP_RADIUS);
    if (at < seen.depth) { seen.depth = at; seen.is_lamp = true; }
    return seen;
}

bool is_hidden(vec3 from, vec3 direction, float until) {
    if (ball(from, direction, BALL, BALL_RADIUS) < until) return true;
    for (int i = 0; i < BOXES; i++) {
        vec3 normal;
        if (block(from, direction, i, normal) < until) return true;
    }
    return false;
}
`;

const MARCH = `
uniform vec3 eye, forward, right, up, intensity;
uniform float density, smoke, albedo, g, jitter;
uniform int steps;
uniform bool has_light;
uniform sampler3D smoke_map, surface0, surface1, surface2, surface3;
in vec2 film;
out vec4 colour;

float extinction(vec3 point) {
    vec3 at = (point - SMOKE_LOW) / SMOKE_SIZE;
    bool is_in = all(greaterThanEqual(at, vec3(0.0))) && all(lessThanEqual(at, vec3(1.0)));
    return density + (is_in ? smoke * texture(smoke_map, at).r : 0.0);
}

float thickness(vec3 from, vec3 direction, float length) {
    float sum = density * length;
    // Only the part of the way that lies in the smoke.
    vec3 a = (SMOKE_LOW - from) / direction, b = (SMOKE_LOW + SMOKE_SIZE - from) / direction;
    vec3 near = min(a, b), far = max(a, b);
    float enter = max(max(near.x, near.y), max(near.z, 0.0)), leave = min(min(far.x, far.y), min(far.z, length));
    if (smoke > 0.0 && enter < leave) {
        float each = (leave - enter) / 4.0;
        for (int i = 0; i < 4; i++) {
            vec3 point = from + (enter + (float(i) + 0.5) * each) * direction;
            sum += smoke * texture(smoke_map, (point - SMOKE_LOW) / SMOKE_SIZE).r * each;
        }
    }
    return sum;
}

// What the lamp sends to a point: irradiance across it.
vec3 from_lamp(vec3 point, out vec3 to_lamp) {
    vec3 way = lamp - point;
    float distance = length(way);
    to_lamp = way / distance;
    if (is_hidden(point, to_lamp, distance - LAMP_RADIUS)) return vec3(0.0);
    // It comes from the near side of the ball: where that is on the mean of what is seen of it.
    float way_out = max(distance - 0.6667 * LAMP_RADIUS, 0.0);
    return intensity * exp(-thickness(point, to_lamp, way_out)) / max(distance * distance, LAMP_RADIUS * LAMP_RADIUS);
}

// Henyey and Greenstein.
float phase(float cosine) {
    float denominator = 1.0 + g * g - 2.0 * g * cosine;
    return (1.0 - g * g) / (12.5663706 * denominator * sqrt(denominator));
}

vec3 irradiance(vec3 point, vec3 d) {
    vec3 at = (point - probes_corner) / probes_size;
    vec3 light = 0.2820948 * texture(surface0, at).rgb;
    light += 0.4886025 * (d.y * texture(surface1, at).rgb + d.z * texture(surface2, at).rgb + d.x * texture(surface3, at).rgb);
    return max(light, vec3(0.0));
}

void main() {
    vec3 direction = normalize(forward + right * (2.0 * film.x - 1.0) + up * (2.0 * film.y - 1.0));
    Seen seen = look(eye, direction);
    vec3 to_lamp;
    vec3 light = vec3(0.0);
    float through = 1.0;
    // Steps begin at random, a little; what that leaves is finer than what even steps would show.
    float shift = mix(0.5, fract(52.9829189 * fract(dot(gl_FragCoord.xy, vec2(0.06711056, 0.00583715)))), jitter);
    float each = seen.depth / float(steps);
    for (int i = 0; i < steps; i++) {
        vec3 point = eye + (float(i) + shift) * each * direction;
        float here = extinction(point);
        float passed = exp(-here * each);
        vec3 lit = from_lamp(point, to_lamp) * phase(dot(direction, to_lamp));
        if (has_light) lit += in_scattered(point, -direction);
        light += through * (1.0 - passed) * albedo * lit;
        through *= passed;
    }
    if (seen.is_lamp) {
        light += through * intensity / (3.14159265 * LAMP_RADIUS * LAMP_RADIUS);
    } else {
        vec3 point = eye + seen.depth * direction + 1e-3 * seen.normal;
        vec3 lit = from_lamp(point, to_lamp) * max(dot(seen.normal, to_lamp), 0.0);
        if (has_light) lit += irradiance(point, seen.normal);
        light += through * seen.colour * lit / 3.14159265;
    }
    colour = vec4(light, 1.0);
}
`;

const SHOW = `${HEAD}
uniform sampler2D picture, truth;
uniform float exposure, level;
uniform int mode;
in vec2 film;
out vec4 colour;

vec3 film_of(vec3 light) {
    vec3 x = light * exposure;
    // A shoulder for what is bright, then sRGB.
    x = x * (1.0 + x / 16.0) / (1.0 + x);
    return mix(12.92 * x, 1.055 * pow(max(x, vec3(1e-6)), vec3(1.0 / 2.4)) - 0.055, step(vec3(0.0031308), x));
}

void main() {
    vec3 baked = texture(picture, film).rgb;
    vec3 traced = texture(truth, vec2(film.x, 1.0 - film.y)).rgb;
    if (mode == 0) { colour = vec4(film_of(baked), 1.0); return; }
    if (mode == 1) { colour = vec4(film_of(traced), 1.0); return; }
    // Means over nine by nine pixels: of single ones little is known but their noise. Too bright orange, too dark blue; full at half of the mean light.
    vec3 more = vec3(0.0);
    vec2 pixel = 1.0 / vec2(textureSize(truth, 0));
    for (int y = -4; y <= 4; y++) {
        for (int x = -4; x <= 4; x++) {
            vec2 at = clamp(film + vec2(x, y) * pixel, 0.0, 1.0);
            more += texture(picture, at).rgb - texture(truth, vec2(at.x, 1.0 - at.y)).rgb;
        }
    }
    float off = dot(more, vec3(1.0 / 243.0)) / max(level, 1e-9) * 2.0;
    vec3 hue = off > 0.0 ? vec3(0.95, 0.45, 0.05) : vec3(0.1, 0.4, 0.95);
    colour = vec4(mix(vec3(0.1), hue, clamp(abs(off), 0.0, 1.0)), 1.0);
}`;

function program(gl, fragment) {
  const linked = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, CORNERS], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    gl.attachShader(linked, shader);
  }
  gl.linkProgram(linked);
  if (!gl.getProgramParameter(linked, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(linked));
  const places = {};
  for (let i = 0; i < gl.getProgramParameter(linked, gl.ACTIVE_UNIFORMS); i++) {
    const { name } = gl.getActiveUniform(linked, i);
    places[name] = gl.getUniformLocation(linked, name);
  }
  return { linked, places };
}

const FOG = Array.from({ length: 9 }, (_, i) => `sh${i}`);
const SURFACE = ["surface0", "surface1", "surface2", "surface3"];

export class Renderer {
  constructor(canvas, fog) {
    const gl = canvas.getContext("webgl2", { antialias: false, preserveDrawingBuffer: true });
    if (!gl) throw new Error("This page needs WebGL2, which this browser does not have.");
    if (!gl.getExtension("EXT_color_buffer_float")) throw new Error("This page needs pictures of floating-point numbers, which this device does not have.");
    this.gl = gl;
    this.march = program(gl, `${HEAD}#define FOG_FILTERED\n${fog}${ROOM}${MARCH}`);
    this.show = program(gl, SHOW);
    this.volumes = new Map();
    this.volume("smoke_map", SMOKE.size, smokeDensity, [gl.R8, gl.RED, gl.UNSIGNED_BYTE]);
    const black = new Float32Array(4);
    for (const name of [...FOG, "medium", ...SURFACE]) this.volume(name, [1, 1, 1], black);
    this.hasLight = false;
    this.target = gl.createTexture();
    this.truth = gl.createTexture();
    this.frame = gl.createFramebuffer();
    this.picture(this.truth, 1, 1, black);
    this.size = [0, 0];
  }

  volume(name, [x, y, z], data, [internal, format, type] = [this.gl.RGBA16F, this.gl.RGBA, this.gl.FLOAT]) {
    const { gl } = this;
    if (!this.volumes.has(name)) this.volumes.set(name, gl.createTexture());
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_3D, this.volumes.get(name));
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    gl.texImage3D(gl.TEXTURE_3D, 0, internal, x, y, z, 0, format, type, data);
    for (const axis of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T, gl.TEXTURE_WRAP_R]) gl.texParameteri(gl.TEXTURE_3D, axis, gl.CLAMP_TO_EDGE);
    for (const filter of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_3D, filter, gl.LINEAR);
  }

  picture(texture, width, height, data) {
    const { gl } = this;
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, width, height, 0, gl.RGBA, gl.FLOAT, data);
    for (const axis of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, axis, gl.CLAMP_TO_EDGE);
    for (const filter of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, filter, gl.NEAREST);
  }

  /** Baked light: of fog, and of surfaces. */
  light(fog, surfaces) {
    fog?.harmonics.forEach((data, i) => this.volume(FOG[i], fog.counts, data));
    surfaces.harmonics.forEach((data, i) => this.volume(SURFACE[i], surfaces.counts, data));
    this.numbers = fog?.harmonics.length ?? 1;
    this.hasLight = true;
  }

  /** Marches the picture; its light stays in memory. */
  marched(width, height, view, settings, { steps, jitter }) {
    const { gl } = this;
    if (this.size[0] !== width || this.size[1] !== height) {
      this.picture(this.target, width, height, null);
      this.size = [width, height];
    }
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.frame);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, this.target, 0);
    gl.viewport(0, 0, width, height);
    const { linked, places } = this.march;
    gl.useProgram(linked);
    let unit = 0;
    for (const [name, texture] of this.volumes) {
      if (!places[name]) continue;
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(gl.TEXTURE_3D, texture);
      gl.uniform1i(places[name], unit++);
    }
    const three = { eye: view.eye, forward: view.forward, right: view.right, up: view.up, lamp: settings.lamp, intensity: settings.intensity };
    const size = BOUNDS[1].map((m, i) => m - BOUNDS[0][i]);
    Object.assign(three, { probes_corner: BOUNDS[0], probes_size: size });
    for (const [name, value] of Object.entries(three)) gl.uniform3fv(places[name], value);
    const one = { density: settings.density, smoke: settings.smokeExtinction, albedo: settings.albedo, g: settings.g, jitter, probes_scale: 1 };
    for (const [name, value] of Object.entries(one)) gl.uniform1f(places[name], value);
    gl.uniform1i(places.steps, steps);
    gl.uniform1i(places.has_light, this.hasLight ? 1 : 0);
    gl.uniform1i(places.probes_numbers, this.numbers ?? 1);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  /** To be asked later whether all that was drawn so far is there. */
  fence() {
    const sync = this.gl.fenceSync(this.gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    this.gl.flush();
    return sync;
  }

  isDrawn(sync) {
    const { gl } = this;
    if (gl.getSyncParameter(sync, gl.SYNC_STATUS) !== gl.SIGNALED) return false;
    gl.deleteSync(sync);
    return true;
  }

  /** The light of the marched picture, from the lower left: four floats a pixel. */
  read() {
    const { gl } = this;
    const [width, height] = this.size;
    const light = new Float32Array(4 * width * height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.frame);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.FLOAT, light);
    return light;
  }

  /** Shows what was marched (0), the truth (1), or their difference (2). */
  shown(mode, level = 1) {
    const { gl } = this;
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, gl.drawingBufferWidth, gl.drawingBufferHeight);
    const { linked, places } = this.show;
    gl.useProgram(linked);
    [["picture", this.target], ["truth", this.truth]].forEach(([name, texture], unit) => {
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.uniform1i(places[name], unit);
    });
    gl.uniform1f(places.exposure, 2.2);
    gl.uniform1f(places.level, level);
    gl.uniform1i(places.mode, mode);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }
}
