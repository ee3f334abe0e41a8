// fog.glsl (WebGL2) and fog.wgsl (WebGPU) in a browser against the core: node shader.mjs FOLDER-OF-PAGE
//
// 100 000 random points and directions, and as many rays: in-scattered light, the medium, and fog marched, from probes of a room with a block in it (so that some
// probes are not valid) and a wall thinner than a cell, of degree 2. The core's answers come from the package in the same page.

import { readFile } from "node:fs/promises";
import { browse, serve, watched } from "./browser.mjs";

const wgsl = await readFile(new URL("../../shaders/fog.wgsl", import.meta.url), "utf8");

const [folder] = process.argv.slice(2);
const site = await serve(folder);
let failed = false;

await browse(async (browser) => {
  const { page, wrong } = await watched(browser, site.url);
  // Anything of the same origin that runs no script.
  await page.goto(`${site.url}page.css`);
  const found = await page.evaluate(async (wgsl) => {
    const { Light, Medium, Probes, Scene, World, init } = await import("/fogbow/fogbow.js");
    await init();
    const box = [[0, 0, 0], [4, 3, 5]];
    const world = new World({
      media: [Medium.noise({ scattering: [0.5, 0.4, 0.3], absorption: 0.1, g: 0.4, frequency: 0.6, box })],
      scene: new Scene().room(box, { reflectance: 0.6 }).block([[1.2, 0, 1.5], [2.9, 1.6, 3.2]], { reflectance: [0.6, 0.3, 0.2] })
        .block([[2.2, 1.6, 0], [2.23, 2.5, 5]], { reflectance: 0.5 }),
      lights: [Light.sphere({ centre: [3, 2.5, 1], radius: 0.15, radiance: 100 })],
    });
    const probes = new Probes(world, { box, counts: [7, 6, 9], degree: 2, error: 0.5, passes: 8 });
    while (probes.bake());
    const { harmonics, medium, walls, counts } = probes.textures({ dilated: false });
    const invalid = harmonics[0].filter((v, i) => i % 4 === 3 && v === 0).length;

    const [W, H] = [400, 250];
    let state = 1;
    const random = () => {
      state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
      return state / 2 ** 32;
    };
    const points = new Float32Array(4 * W * H);
    const directions = new Float32Array(4 * W * H);
    for (let i = 0; i < points.length; i += 4) {
      points.set([4.4 * random() - 0.2, 3.4 * random() - 0.2, 5.4 * random() - 0.2, 6 * random()], i);
      const [z, a] = [2 * random() - 1, 2 * Math.PI * random()];
      const r = Math.sqrt(1 - z * z);
      directions.set([r * Math.cos(a), r * Math.sin(a), z, 0], i);
    }

    const gl = new OffscreenCanvas(W, H).getContext("webgl2");
    gl.getExtension("EXT_color_buffer_float");
    const fog = await (await fetch("/fog.glsl")).text();
    const draw = (body) => {
      const program = gl.createProgram();
      const sources = [
        [gl.VERTEX_SHADER, "#version 300 es\nvoid main() { gl_Position = vec4(vec2(gl_VertexID & 1, gl_VertexID >> 1) * 4.0 - 1.0, 0.0, 1.0); }"],
        [gl.FRAGMENT_SHADER, `#version 300 es\nprecision highp float;\nprecision highp int;\nprecision highp sampler3D;\n${fog}
uniform highp sampler2D points, directions;
out vec4 colour;
void main() {
    vec4 point = texelFetch(points, ivec2(gl_FragCoord.xy), 0);
    vec3 direction = texelFetch(directions, ivec2(gl_FragCoord.xy), 0).xyz;
    colour = ${body};
}`],
      ];
      for (const [kind, source] of sources) {
        const shader = gl.createShader(kind);
        gl.shaderSource(shader, source);
        gl.compileShader(shader);
        if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
        gl.attachShader(program, shader);
      }
      gl.linkProgram(program);
      gl.useProgram(program);
      let unit = 0;
      const bind = (kind, name, upload) => {
        const place = gl.getUniformLocation(program, name);
        if (!place) return;
        gl.activeTexture(gl.TEXTURE0 + unit);
        gl.bindTexture(kind, gl.createTexture());
        upload();
        for (const filter of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(kind, filter, gl.NEAREST);
        gl.uniform1i(place, unit++);
      };
      const flat = (data) => () => gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, W, H, 0, gl.RGBA, gl.FLOAT, data);
      const deep = (data) => () => gl.texImage3D(gl.TEXTURE_3D, 0, gl.RGBA32F, ...counts, 0, gl.RGBA, gl.FLOAT, data);
      bind(gl.TEXTURE_2D, "points", flat(points));
      bind(gl.TEXTURE_2D, "directions", flat(directions));
      harmonics.forEach((data, i) => bind(gl.TEXTURE_3D, `sh${i}`, deep(data)));
      bind(gl.TEXTURE_3D, "medium", deep(medium));
      walls.forEach((data, i) => bind(gl.TEXTURE_3D, `wall${i}`, deep(data)));
      gl.uniform3f(gl.getUniformLocation(program, "probes_corner"), ...box[0]);
      gl.uniform3f(gl.getUniformLocation(program, "probes_size"), ...box[1]);
      gl.uniform1f(gl.getUniformLocation(program, "probes_scale"), 1);
      gl.uniform1i(gl.getUniformLocation(program, "probes_numbers"), 9);
      gl.activeTexture(gl.TEXTURE15);
      const target = gl.createTexture();
      gl.bindTexture(gl.TEXTURE_2D, target);
      flat(null)();
      gl.bindFramebuffer(gl.FRAMEBUFFER, gl.createFramebuffer());
      gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, target, 0);
      gl.viewport(0, 0, W, H);
      gl.drawArrays(gl.TRIANGLES, 0, 3);
      const light = new Float32Array(4 * W * H);
      gl.readPixels(0, 0, W, H, gl.RGBA, gl.FLOAT, light);
      return light;
    };

    // The same questions for WebGPU, answered three for three.
    const adapter = await navigator.gpu.requestAdapter();
    const device = await adapter.requestDevice();
    device.pushErrorScope("validation");
    const STEPS = 8;
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
        let point = points[id.x];
        let direction = directions[id.x].xyz;
        answers[3u * id.x] = vec4<f32>(in_scattered(point.xyz, direction), 1.0);
        answers[3u * id.x + 1u] = matter(point.xyz);
        answers[3u * id.x + 2u] = fog(point.xyz, direction, point.w, ${STEPS}u);
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
    // Without finer levels: no counts, no index.
    const probed = new ArrayBuffer(48);
    new Float32Array(probed).set([...box[0], 1, ...box[1]]);
    new Uint32Array(probed)[7] = harmonics.length;
    const volume = (data, size = counts) => {
      const texture = device.createTexture({ size, dimension: "3d", format: "rgba32float", usage: GPUTextureUsage.TEXTURE_BINDING | GPUTextureUsage.COPY_DST });
      device.queue.writeTexture({ texture }, data, { bytesPerRow: 16 * size[0], rowsPerImage: size[1] }, size);
      return texture.createView();
    };
    const told = device.createBuffer({ size: 48 * W * H, usage: GPUBufferUsage.STORAGE | GPUBufferUsage.COPY_SRC });
    const readable = device.createBuffer({ size: 48 * W * H, usage: GPUBufferUsage.MAP_READ | GPUBufferUsage.COPY_DST });
    const groups = [
      [buffer(probed, GPUBufferUsage.UNIFORM), ...[...harmonics, medium, ...walls].map((data) => volume(data)), volume(new Float32Array(4), [1, 1, 1])],
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
    encoder.copyBufferToBuffer(told, 0, readable, 0, 48 * W * H);
    device.queue.submit([encoder.finish()]);
    await readable.mapAsync(GPUMapMode.READ);
    const answers = new Float32Array(readable.getMappedRange());
    const refused = (await device.popErrorScope())?.message ?? "";
    const answer = (which) => {
      const all = new Float32Array(4 * W * H);
      for (let i = 0; i < W * H; i++) all.set(answers.subarray(12 * i + 4 * which, 12 * i + 4 * which + 4), 4 * i);
      return all;
    };

    const three = (all) => all.filter((_, i) => i % 4 < 3);
    const level = (all) => all.reduce((a, b) => a + b, 0) / all.length;
    // Once by the core.
    const due = probes.values(three(points), three(directions));
    const mean = level(due);
    // Where next to no probe that sees the point has a part, rounding decides.
    const apart = (all) => {
      const got = three(all);
      let [worst, off] = [0, 0];
      due.forEach((d, i) => {
        const error = Math.abs(d - got[i]) / Math.max(mean, d);
        if (error > 2e-5) off++;
        else worst = Math.max(worst, error);
      });
      return { worst, off: off / due.length };
    };
    const light = [draw("vec4(in_scattered(point.xyz, direction), 1.0)"), answer(0)].map(apart);

    // The medium, mixed here.
    const at = (point, c) => {
      const places = counts.map((n, i) => Math.min(Math.max((point[i] / box[1][i]) * n - 0.5, 0), n - 1));
      let sum = 0;
      for (let corner = 0; corner < 8; corner++) {
        let [weight, index, stride] = [1, 0, 1];
        for (let i = 0; i < 3; i++) {
          const low = Math.min(Math.floor(places[i]), Math.max(counts[i] - 2, 0));
          const share = places[i] - low;
          const isHigh = (corner >> i) & 1;
          weight *= isHigh ? share : 1 - share;
          index += Math.min(low + isHigh, counts[i] - 1) * stride;
          stride *= counts[i];
        }
        sum += weight * medium[4 * index + c];
      }
      return sum;
    };
    const worstMatter = [draw("matter(point.xyz)"), answer(1)].map((matter) => {
      let worst = 0;
      for (let i = 0; i < points.length; i += 4) {
        for (let c = 0; c < 4; c++) worst = Math.max(worst, Math.abs(matter[i + c] - at(points.subarray(i, i + 3), c)));
      }
      return worst;
    });

    // Fog along rays of eight steps, for some of them: light at each step from the core.
    const marched = [draw(`fog(point.xyz, direction, point.w, ${STEPS})`), answer(2)];
    const fogs = marched.map(() => ({ worst: 0, off: 0 }));
    let rays = 0;
    for (let i = 0; i < points.length; i += 4 * 50) {
      const [eye, direction, depth] = [points.subarray(i, i + 3), directions.subarray(i, i + 3), points[i + 3]];
      let [begin, end] = [0, depth];
      for (let k = 0; k < 3; k++) {
        const sides = [(box[0][k] - eye[k]) / direction[k], (box[1][k] - eye[k]) / direction[k]];
        begin = Math.max(begin, Math.min(...sides));
        end = Math.min(end, Math.max(...sides));
      }
      const [light, each] = [[0, 0, 0], (end - begin) / STEPS];
      let through = 1;
      for (let s = 0; s < STEPS && end > begin; s++) {
        const point = Array.from(eye, (e, k) => e + (begin + (s + 0.5) * each) * direction[k]);
        const seen = probes.values(point, Array.from(direction, (d) => -d));
        const passed = Math.exp(-at(point, 3) * each);
        for (let c = 0; c < 3; c++) light[c] += through * (1 - passed) * at(point, c) * seen[c];
        through *= passed;
      }
      marched.forEach((all, k) => {
        const errors = [...light, through].map((d, c) => Math.abs(d - all[i + c]) / Math.max(c < 3 ? mean : 1, d));
        if (Math.max(...errors) > 5e-5) fogs[k].off++;
        else fogs[k].worst = Math.max(fogs[k].worst, ...errors);
      });
      rays++;
    }
    return { invalid, walled: walls[0].filter((v) => v !== 0).length, mean, light, worstMatter, fogs, rays, refused, error: gl.getError() };
  }, wgsl);
  console.log(JSON.stringify(found), wrong.join("; "));
  const checks = [
    ["some probes are not valid, some have walls around", found.invalid > 5 && found.walled > 50],
    // Single precision, sums of some ten numbers: a few parts in a million; but for a few points beside walls, where rounding decides which probes see them.
    ["in-scattered light is the core's", found.mean > 0 && found.light.every(({ off }) => off < 1e-4)],
    ["the medium is what it is", found.worstMatter.every((worst) => worst < 1e-5)],
    ["fog is marched as by the core", found.rays > 1000 && found.fogs.every(({ off }) => off <= 2)],
    ["no errors", found.error === 0 && found.refused === "" && wrong.length === 0],
  ];
  for (const [name, holds] of checks) {
    console.log(`${holds ? "ok " : "OFF"} ${name}`);
    failed ||= !holds;
  }
});
site.close();
process.exit(failed ? 1 : 0);
