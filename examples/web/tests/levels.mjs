// fog.glsl with FOG_LEVELS (WebGL2) and fog.wgsl (WebGPU) in a browser on textures of a bake with finer levels:
//
//     fogbow bake SCENE.xml --basis sh2 --refine E -o FOLDER/NAME.ktx2 && node levels.mjs FOLDER NAME
//
// In-scattered light and the medium at 20 000 random points against the same look-up written here, of the same textures. That this look-up is the core's is held by
// finer_levels_are_found_by_shaders_and_gone_on_with, a test of the program.

import { readFile } from "node:fs/promises";
import { asking, browse, serve } from "./browser.mjs";

const [folder, name] = process.argv.slice(2);
const shader = (file) => readFile(new URL(`../../shaders/${file}`, import.meta.url), "utf8");
const [glsl, wgsl] = [await shader("fog.glsl"), await shader("fog.wgsl")];
const site = await serve(folder);
let failed = false;

await browse(async (browser) => {
  const { page, wrong } = await asking(browser, site.url);
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
      return { name: texture, size, data };
    }));
    const [low, high] = [about.box.min, about.box.max];
    const size = high.map((h, i) => h - low[i]);
    const [counts, levels] = [about.counts, about.levels.length];

    const { questions, byWebGL, byWebGPU } = await import("/asked.mjs");
    const { points, directions } = questions(20000, low, size, 0);

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

    const gl = byWebGL({
      glsl: `#define FOG_LEVELS\n${glsl}`, width: 200, points, directions, volumes,
      uniforms: {
        probes_corner: ["3f", low], probes_size: ["3f", size], probes_scale: ["1f", [about.scale]], probes_numbers: ["1i", [9]],
        probes_counts: ["3i", counts], probes_levels: ["1i", [levels]],
      },
    });
    const probes = new ArrayBuffer(48);
    new Float32Array(probes).set([...low, about.scale, ...size]);
    new Uint32Array(probes).set([9, ...counts, levels], 7);
    const gpu = await byWebGPU({
      wgsl, points, directions, probes, volumes, bodies: ["vec4<f32>(in_scattered(point.xyz, direction), 1.0)", "matter(point.xyz)"],
    });

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
    const lights = [gl.ask("vec4(in_scattered(point.xyz, direction), 1.0)"), gpu.answers[0]].map((all) => apart(all, (d) => d.light, 3, mean));
    const matters = [gl.ask("matter(point.xyz)"), gpu.answers[1]].map((all) => apart(all, (d) => d.matter, 4, 1));
    return { levels, onLevels, mean, lights, matters, refused: gpu.refused, error: gl.error() };
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
