// fog.glsl (WebGL2) and fog.wgsl (WebGPU) in a browser against the core: node shader.mjs FOLDER-OF-PAGE
//
// 100 000 random points and directions, and as many rays: in-scattered light, the medium, and fog marched, from probes of a room with a block in it (so that some
// probes are not valid) and a wall thinner than a cell, of degree 2. The core's answers come from the package in the same page.

import { readFile } from "node:fs/promises";
import { asking, browse, serve } from "./browser.mjs";

const wgsl = await readFile(new URL("../../shaders/fog.wgsl", import.meta.url), "utf8");

const [folder] = process.argv.slice(2);
const site = await serve(folder);
let failed = false;

await browse(async (browser) => {
  const { page, wrong } = await asking(browser, site.url);
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

    const { questions, byWebGL, byWebGPU } = await import("/asked.mjs");
    const { points, directions } = questions(100000, ...box, 6);
    const STEPS = 8;
    const volume = (name) => (data, i) => ({ name: `${name}${i}`, size: counts, data });
    const volumes = [...harmonics.map(volume("sh")), { name: "medium", size: counts, data: medium }, ...walls.map(volume("wall"))];
    const gl = byWebGL({
      glsl: await (await fetch("/fog.glsl")).text(), width: 400, points, directions, volumes,
      uniforms: { probes_corner: ["3f", box[0]], probes_size: ["3f", box[1]], probes_scale: ["1f", [1]], probes_numbers: ["1i", [9]] },
    });
    // Without finer levels: no counts, no index.
    const probed = new ArrayBuffer(48);
    new Float32Array(probed).set([...box[0], 1, ...box[1]]);
    new Uint32Array(probed)[7] = harmonics.length;
    const gpu = await byWebGPU({
      wgsl, points, directions, probes: probed, volumes: [...volumes, { size: [1, 1, 1], data: new Float32Array(4) }],
      bodies: ["vec4<f32>(in_scattered(point.xyz, direction), 1.0)", "matter(point.xyz)", `fog(point.xyz, direction, point.w, ${STEPS}u)`],
    });

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
    const light = [gl.ask("vec4(in_scattered(point.xyz, direction), 1.0)"), gpu.answers[0]].map(apart);

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
    const worstMatter = [gl.ask("matter(point.xyz)"), gpu.answers[1]].map((matter) => {
      let worst = 0;
      for (let i = 0; i < points.length; i += 4) {
        for (let c = 0; c < 4; c++) worst = Math.max(worst, Math.abs(matter[i + c] - at(points.subarray(i, i + 3), c)));
      }
      return worst;
    });

    // Fog along rays of eight steps, for some of them: light at each step from the core.
    const marched = [gl.ask(`fog(point.xyz, direction, point.w, ${STEPS})`), gpu.answers[2]];
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
    return { invalid, walled: walls[0].filter((v) => v !== 0).length, mean, light, worstMatter, fogs, rays, refused: gpu.refused, error: gl.error() };
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
