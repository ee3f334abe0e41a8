// fog.glsl with FOG_LEVELS (WebGL2) and fog.wgsl (WebGPU) in a browser on textures of a bake with finer levels:
//
//     fogbow bake SCENE.xml --basis sh2 --refine E -o FOLDER/NAME.ktx2 && node levels.mjs FOLDER NAME
//
// In-scattered light and the medium at 20 000 random points against the same look-up written here, of the same textures. That this look-up is the core's is held by
// finer_levels_are_found_by_shaders_and_gone_on_with, a test of the program.

import { readFile } from "node:fs/promises";
import { browse, serve, watched } from "./browser.mjs";

const [folder, name] = process.argv.slice(2);
const shader = (file) => readFile(new URL(`../../shaders/${file}`, import.meta.url), "utf8");
const [glsl, wgsl] = [await shader("fog.glsl"), await shader("fog.wgsl")];
const site = await serve(folder);
let failed = false;

await browse(async (browser) => {
  const { page, wrong } = await watched(browser, site.url);
  // Of the same origin, and nothing in it.
  await page.route("**/empty.html", (route) => route.fulfill({ contentType: "text/html", body: "" }));
  await page.goto(`${site.url}empty.html`);
  const found = await page.evaluate(async ({ name, glsl, wgsl }) => {
    const about = await (await fetch(`${name}.ktx2.json`)).json();
    const names = ["sh0", "sh1", "sh2", "sh3", "sh4", "sh5", "sh6", "sh7", "sh8", "medium", "wall0", "wall1", "index"];
    const half = (h) => {
      const [exponent, rest] = [(h >> 10) & 31, h & 1023];
      return (h >> 15 ? -1 : 1) * (exponent ? 2 ** (exponent - 15) * (1 + rest / 1024) : 2 ** -14 * (rest / 1024));
    };
    const volumes = await Promise.all(names.map(async (texture) => {
      const bytes = new DataView(await (await fetch(`${name}-${texture}.ktx2`)).arrayBuffer());
      const size = [20, 24, 28].map((at) => bytes.getUint32(at, true));
      const at = Number(bytes.getBigUint64(80, true));
      const data = Float32Array.from({ length: 4 * size[0] * size[1] * size[2] }, (_, i) => half(bytes.getUint16(at + 2 * i, true)));
      return { size, data };
    }));
    const [low, high] = [about.box.min, about.box.max];
    const size = high.map((h, i) => h - low[i]);
    const [counts, levels] = [about.counts, about.levels.length];

    const [W, H] = [200, 100];
    let state = 1;
    const random = () => {
      state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
      return state / 2 ** 32;
    };
    const [points, directions] = [new Float32Array(4 * W * H), new Float32Array(4 * W * H)];
    for (let i = 0; i < points.length; i += 4) {
      points.set([0, 1, 2].map((k) => low[k] + size[k] * (1.1 * random() - 0.05)), i);
      const [z, a] = [2 * random() - 1, 2 * Math.PI * random()];
      const r = Math.sqrt(1 - z * z);
      directions.set([r * Math.cos(a), r * Math.sin(a), z, 0], i);
    }

    // The look-up, written here.
    const texel = (which, at) => {
      const { size: [nx, ny], data } = volumes[which];
      const first = 4 * (at[0] + nx * (at[1] + ny * at[2]));
      return data.subarray(first, first + 4);
    };
    const onLevels = new Array(levels + 2).fill(0);
    const look = (point, d) => {
      const [light, hidden, matter] = [[0, 0, 0], [0, 0, 0], [0, 0, 0, 0]];
      let [valid, rest, parts] = [0, 1, 0];
      for (let level = levels; level >= 0 && rest > 0; level--) {
        const n = counts.map((c) => c * 2 ** level);
        const at = n.map((n, i) => Math.min(Math.max(((point[i] - low[i]) / size[i]) * n - 0.5, 0), n - 1));
        const first = at.map((a, i) => Math.min(Math.floor(a), Math.max(n[i] - 2, 0)));
        let layer = 0;
        for (let other = 1; other < level; other++) layer += Math.ceil((counts[2] * 2 ** other) / 4);
        let [part, inner] = [0, 0];
        const corners = [];
        for (let corner = 0; corner < 8; corner++) {
          const bit = [corner & 1, (corner >> 1) & 1, corner >> 2];
          let place = first.map((f, i) => Math.min(f + bit[i], n[i] - 1));
          const offset = at.map((a, i) => a - first[i] - bit[i]);
          const weight = bit.reduce((w, b, i) => w * (b ? at[i] - first[i] : 1 - at[i] + first[i]), 1);
          if (level > 0) {
            const brick = texel(12, place.map((p, i) => Math.floor(p / 4) + (i === 2 ? layer : 0)));
            place = place.map((p, i) => brick[i] + (p % 4));
            if (brick[3] * texel(10, place)[3] > 0) {
              part += weight;
              inner++;
            }
          }
          corners.push({ place, offset, weight });
        }
        part = level === 0 || inner === 8 ? 1 : Math.min(part, 1);
        parts += part > 0;
        for (const { place, offset, weight } of part > 0 ? corners : []) {
          const w = rest * part * weight;
          const sh = names.slice(0, 9).map((_, k) => texel(k, place));
          const y = [
            0.2820948, 0.4886025 * d[1], 0.4886025 * d[2], 0.4886025 * d[0], 1.0925484 * d[0] * d[1], 1.0925484 * d[1] * d[2],
            0.31539157 * (3 * d[2] * d[2] - 1), 1.0925484 * d[0] * d[2], 0.5462742 * (d[0] * d[0] - d[1] * d[1]),
          ];
          const walls = [10, 11].map((k) => offset.reduce((s, o, i) => s + o * texel(k, place)[i], 0));
          const s = Math.max(...walls);
          const sees = Math.min(Math.max((1 - s) * 10, 0), 1) + 1e-6 / Math.max(s, 1) ** 8;
          for (let c = 0; c < 3; c++) {
            const seen = y.reduce((sum, y, k) => sum + y * sh[k][c], 0);
            light[c] += w * sh[0][3] * sees * seen;
            hidden[c] += w * seen;
          }
          valid += w * sh[0][3] * sees;
          texel(9, place).forEach((m, i) => (matter[i] += w * m));
        }
        rest *= 1 - part;
      }
      onLevels[parts]++;
      return { light: light.map((l, c) => Math.max(valid > 0 ? l / valid : hidden[c], 0)), matter };
    };
    const due = [];
    for (let i = 0; i < points.length; i += 4) due.push(look(points.subarray(i, i + 3), directions.subarray(i, i + 3)));

    const gl = new OffscreenCanvas(W, H).getContext("webgl2");
    gl.getExtension("EXT_color_buffer_float");
    const draw = (body) => {
      const program = gl.createProgram();
      const sources = [
        [gl.VERTEX_SHADER, "#version 300 es\nvoid main() { gl_Position = vec4(vec2(gl_VertexID & 1, gl_VertexID >> 1) * 4.0 - 1.0, 0.0, 1.0); }"],
        [gl.FRAGMENT_SHADER, `#version 300 es
precision highp float; precision highp int; precision highp sampler3D;
#define FOG_LEVELS
${glsl}
uniform highp sampler2D points, directions;
out vec4 colour;
void main() {
    vec4 point = texelFetch(points, ivec2(gl_FragCoord.xy), 0);
    vec3 direction = texelFetch(directions, ivec2(gl_FragCoord.xy), 0).xyz;
    colour = ${body};
}`],
      ];
      for (const [kind, source] of sources) {
        const made = gl.createShader(kind);
        gl.shaderSource(made, source);
        gl.compileShader(made);
        if (!gl.getShaderParameter(made, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(made));
        gl.attachShader(program, made);
      }
      gl.linkProgram(program);
      gl.useProgram(program);
      let unit = 0;
      const place = (uniform) => gl.getUniformLocation(program, uniform);
      const bind = (kind, uniform, upload) => {
        if (!place(uniform)) return;
        gl.activeTexture(gl.TEXTURE0 + unit);
        gl.bindTexture(kind, gl.createTexture());
        upload();
        for (const filter of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(kind, filter, gl.NEAREST);
        gl.uniform1i(place(uniform), unit++);
      };
      const flat = (data) => () => gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, W, H, 0, gl.RGBA, gl.FLOAT, data);
      bind(gl.TEXTURE_2D, "points", flat(points));
      bind(gl.TEXTURE_2D, "directions", flat(directions));
      volumes.forEach(({ size, data }, i) => bind(gl.TEXTURE_3D, names[i], () => gl.texImage3D(gl.TEXTURE_3D, 0, gl.RGBA32F, ...size, 0, gl.RGBA, gl.FLOAT, data)));
      gl.uniform3f(place("probes_corner"), ...low);
      gl.uniform3f(place("probes_size"), ...size);
      gl.uniform1f(place("probes_scale"), about.scale);
      gl.uniform1i(place("probes_numbers"), 9);
      gl.uniform3i(place("probes_counts"), ...counts);
      gl.uniform1i(place("probes_levels"), levels);
      gl.activeTexture(gl.TEXTURE15);
      const target = gl.createTexture();
      gl.bindTexture(gl.TEXTURE_2D, target);
      flat(null)();
      gl.bindFramebuffer(gl.FRAMEBUFFER, gl.createFramebuffer());
      gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, target, 0);
      gl.viewport(0, 0, W, H);
      gl.drawArrays(gl.TRIANGLES, 0, 3);
      const all = new Float32Array(4 * W * H);
      gl.readPixels(0, 0, W, H, gl.RGBA, gl.FLOAT, all);
      return all;
    };

    const adapter = await navigator.gpu.requestAdapter();
    const device = await adapter.requestDevice();
    device.pushErrorScope("validation");
    const pipeline = device.createComputePipeline({
      layout: "auto",
      compute: {
        module: device.createShaderModule({
          code: `${wgsl}
@group(1) @binding(0) var<storage, read> points: array<vec4<f32>>;
@group(1) @binding(1) var<storage, read> directions: array<vec4<f32>>;
@group(1) @binding(2) var<storage, read_write> answers: array<vec4<f32>>;
@compute @workgroup_size(64) fn ask(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < arrayLength(&points) {
        answers[2u * id.x] = vec4<f32>(in_scattered(points[id.x].xyz, directions[id.x].xyz), 1.0);
        answers[2u * id.x + 1u] = matter(points[id.x].xyz);
    }
}`,
        }),
        entryPoint: "ask",
      },
    });
    const buffer = (data, usage) => {
      const made = device.createBuffer({ size: data.byteLength, usage: usage | GPUBufferUsage.COPY_DST });
      device.queue.writeBuffer(made, 0, data);
      return { buffer: made };
    };
    const probes = new ArrayBuffer(48);
    new Float32Array(probes).set([...low, about.scale, ...size]);
    new Uint32Array(probes).set([9, ...counts, levels], 7);
    const volume = ({ size, data }) => {
      const texture = device.createTexture({ size, dimension: "3d", format: "rgba32float", usage: GPUTextureUsage.TEXTURE_BINDING | GPUTextureUsage.COPY_DST });
      device.queue.writeTexture({ texture }, data, { bytesPerRow: 16 * size[0], rowsPerImage: size[1] }, size);
      return texture.createView();
    };
    const bytes = 32 * W * H;
    const told = device.createBuffer({ size: bytes, usage: GPUBufferUsage.STORAGE | GPUBufferUsage.COPY_SRC });
    const readable = device.createBuffer({ size: bytes, usage: GPUBufferUsage.MAP_READ | GPUBufferUsage.COPY_DST });
    const groups = [
      [buffer(probes, GPUBufferUsage.UNIFORM), ...volumes.map(volume)],
      [buffer(points, GPUBufferUsage.STORAGE), buffer(directions, GPUBufferUsage.STORAGE), { buffer: told }],
    ];
    const encoder = device.createCommandEncoder();
    const pass = encoder.beginComputePass();
    pass.setPipeline(pipeline);
    groups.forEach((resources, number) => {
      const entries = resources.map((resource, binding) => ({ binding, resource }));
      pass.setBindGroup(number, device.createBindGroup({ layout: pipeline.getBindGroupLayout(number), entries }));
    });
    pass.dispatchWorkgroups(Math.ceil((W * H) / 64));
    pass.end();
    encoder.copyBufferToBuffer(told, 0, readable, 0, bytes);
    device.queue.submit([encoder.finish()]);
    await readable.mapAsync(GPUMapMode.READ);
    const answers = new Float32Array(readable.getMappedRange());
    const refused = (await device.popErrorScope())?.message ?? "";
    const answer = (which) => Float32Array.from({ length: 4 * W * H }, (_, i) => answers[8 * (i >> 2) + 4 * which + (i & 3)]);

    const mean = due.reduce((sum, { light }) => sum + light[0] + light[1] + light[2], 0) / (3 * due.length);
    const apart = (all, of, channels, level) => {
      let [worst, off] = [0, 0];
      due.forEach((d, i) => {
        for (let c = 0; c < channels; c++) {
          const error = Math.abs(of(d)[c] - all[4 * i + c]) / Math.max(level, of(d)[c]);
          if (error > 5e-5) off++;
          else worst = Math.max(worst, error);
        }
      });
      return { worst, off };
    };
    const lights = [draw("vec4(in_scattered(point.xyz, direction), 1.0)"), answer(0)].map((all) => apart(all, (d) => d.light, 3, mean));
    const matters = [draw("matter(point.xyz)"), answer(1)].map((all) => apart(all, (d) => d.matter, 4, 1));
    return { levels, onLevels, mean, lights, matters, refused, error: gl.getError() };
  }, { name, glsl, wgsl });
  console.log(JSON.stringify(found), wrong.join("; "));
  const checks = [
    ["points lie on one level alone and where two meet", found.levels > 0 && found.onLevels[1] > 500 && found.onLevels[2] > 500],
    // Of 60 000 numbers, some beside walls, where rounding decides which probes see a point.
    ["in-scattered light is the look-up's", found.mean > 0 && found.lights.every(({ off }) => off <= 12)],
    ["the medium is the look-up's", found.matters.every(({ off }) => off === 0)],
    ["no errors", found.error === 0 && found.refused === "" && wrong.length === 0],
  ];
  for (const [name, holds] of checks) {
    console.log(`${holds ? "ok " : "OFF"} ${name}`);
    failed ||= !holds;
  }
});
site.close();
process.exit(failed ? 1 : 0);
