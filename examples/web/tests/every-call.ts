// Uses every call of the package. Checked by tsc --strict, then run.

import { Caches, FogbowError, Light, Medium, Probes, Scene, World, hasSimd, init, memoryBytes, trim, version } from "fogbow";
import type { Box, Jobs, Textures, View } from "fogbow";
import { bytes as inlineBytes } from "fogbow/inline";
import { Workers } from "fogbow/worker";
import type { Progress } from "fogbow/worker";

declare const process: { argv: string[] };
declare const gc: undefined | (() => void);

function holds(condition: boolean, name: string): void {
  if (!condition) throw new Error(`${name} does not hold`);
}

function refuses(work: () => unknown, words: RegExp): void {
  try {
    work();
  } catch (error) {
    if (error instanceof Error && words.test(error.message)) return;
    throw error;
  }
  throw new Error(`nothing was refused: ${words}`);
}

const sum = (numbers: Float32Array): number => numbers.reduce((a, b) => a + b, 0);
const same = (a: ArrayLike<number>, b: ArrayLike<number>): boolean => a.length === b.length && Array.from(a).every((x, i) => Object.is(x, b[i]));

refuses(() => memoryBytes(), /call init\(\)/);
await init(new Uint8Array(3)).then(() => holds(false, "damaged bytes"), () => {});
await Promise.all([init(), init(inlineBytes())]);
await init(); // Again is no error.
console.log(`version ${version}, SIMD ${hasSimd()}`);

// Descriptions
const box: Box = [[-1, -1, -1], [1, 1, 1]];
const density = Float32Array.from({ length: 64 }, (_, i) => i / 64);
const media = [
  Medium.homogeneous({ absorption: 0.1, scattering: [0.5, 0.4, 0.3], g: 0.5, box }),
  Medium.grid({ scattering: 1, size: [4, 4, 4], density, box }),
  Medium.grid({ scattering: 1, phase: "henyey-greenstein", g: 0.5, size: [4, 4, 4], density: new Uint8Array(64).fill(50), box }),
  Medium.noise({ scattering: 1, frequency: 2, octaves: 2, seed: 7, sphere: { centre: [0, 0, 0], radius: 0.5 } }),
];
for (const phase of [{ phase: "schlick", k: 0.3 }, { phase: "rayleigh" }, { phase: "draine", g: 0.3, alpha: 1 }] as const) {
  Medium.homogeneous({ scattering: 1, box, ...phase });
}
const scene = new Scene()
  .room(box, { reflectance: 0.5 })
  .block([[0.5, -1, 0.5], [0.8, 0, 0.8]], { reflectance: [0.2, 0.5, 0.2] })
  .triangles([-0.9, -0.9, -0.5, 0.9, -0.9, -0.5, 0, -0.2, -0.5], [0, 1, 2], { kind: "phong", reflectance: 0.3, specular: 0.2, exponent: 20 })
  .triangles(new Float32Array([-0.5, -0.9, 0, 0.5, -0.9, 0, 0, -0.9, 0.5]))
  .quad([-1, 0.5, -1], [0.2, 0, 0], [0, 0, 0.2], { kind: "mirror" })
  .sphere([0.4, 0.4, 0], 0.2, { kind: "glass", eta: 1.5 })
  .sphere([-0.4, 0.4, 0], 0.1, { kind: "null" });
const lights = [
  Light.point({ position: [0, 0.8, 0], flux: 10 }),
  Light.spot({ position: [0, 0.9, 0], axis: [0, -1, 0], beam: 0.2, cutoff: 0.4, intensity: 5 }),
  Light.sphere({ centre: [0.5, 0.5, -0.5], radius: 0.1, radiance: 3 }),
  Light.quad({ corner: [-0.2, 0.99, -0.2], edgeU: [0.4, 0, 0], edgeV: [0, 0, 0.4], radiance: [3, 2, 1] }),
  Light.sun({ toLight: [0, 1, 0], irradiance: 1 }),
  Light.sky({ radiance: 0.1 }),
];
const view: View = { eye: [0, 0, 0.9], target: [0, 0, 0], up: [0, 1, 0], fov: 1, width: 8, height: 6 };

// World
const world = new World({ media, scene, lights, bounds: box });
holds(world.bounds[1][0] === 1 && world.words.length > 100, "bounds and words");
const traced = world.pathTrace(view, { samples: 2 });
holds(traced.length === 3 * 48 && sum(traced) > 0, "pathTrace");
const part = world.pathTrace(view, { x: 2, y: 3, width: 4, height: 1, samples: 2 });
holds(same(part, traced.subarray(3 * (3 * 8 + 2), 3 * (3 * 8 + 6))), "parts of pictures are parts");
const rays = [0, 0, 0.9, 0, 0, -1, Infinity];
holds(sum(world.radiance(rays, { samples: 4, seed: 1 })) > 0, "radiance");
holds(world.inScattered([0, 0, 0.5], [0, 0, 1], { samples: 4 }).length === 3, "inScattered");
holds(sum(world.scatteredOnce([0, 0, 0.5], [0, 0, 1])) > 0, "scatteredOnce");
const record = world.record([0, 0, 0.5], [0, 0, 1], { tolerance: 0.3 });
holds(record.radius > 0 && record.gradient[2].length === 3 && record.value[0] > 0, "record");
const { size, covariances } = world.covariances({ edge: 4, photons: 500 });
holds(size.join() === "4,4,4" && covariances.length === 6 * 64, "covariances");
const virtual = world.virtualLight({ position: [0, 0, 0.5], incoming: [0, 1, 0], bound: 4, eye: [0, 0, 2] }, [0, 0, 0.45, 0, 0.1, -0.3]);
holds(virtual.clamped[0]! < virtual.all[0]! && virtual.clamped[3] === virtual.all[3], "virtualLight");

// Caches
const options = { view, error: 0.3, rays: 32, walks: 8, seed: 3 };
const caches = new Caches(world, options);
const jobs: Jobs = caches.jobs;
holds(jobs.next === 0 && jobs.end > 0 && caches.stage === "fill search", "jobs");
caches.accept(caches.run(jobs.next));
holds(caches.jobs.next === 1, "accept");
while (caches.fill());
holds(caches.jobs.next === caches.jobs.end && caches.stage === "", "fill");
holds(sum(caches.picture(view, { samples: 2 })) > 0 && sum(caches.radiance(rays)) > 0, "pictures from caches");
holds(caches.inScattered([0, 0, 0.5], [0, 0, 1], { seed: 2 }).length === 3, "inScattered of caches");
holds(caches.records("multiple").length % 16 === 0 && caches.records("irradiance").length > 0, "records");
const saved = caches.save();
const loaded = new Caches(world, options);
loaded.load(saved);
holds(same(loaded.save(), saved), "save and load");
refuses(() => loaded.load(saved.slice(0, 100)), /./);
loaded.ask({ box });
loaded.fill(4);
loaded.cancel();
loaded.free();

// Probes
const probes = new Probes(world, { box, counts: [4, 4, 4], degree: 1, orders: "indirect", quantity: "in-scattered", error: 0.5, directions: 4, passes: 4, seed: 1 });
probes.accept(probes.run(probes.jobs.next));
while (probes.bake());
holds(probes.error >= 0 && probes.share === 1 && sum(probes.values([0, 0, 0.5], [0, 0, 1])) > 0, "bake");
const textures: Textures = probes.textures();
holds(textures.harmonics.length === 4 && textures.medium.length === 4 * 64 && textures.counts[0] === 4, "textures");
const begun = new Probes(world, probes.words);
begun.load(probes.save());
holds(same(begun.save(), probes.save()), "save and load of probes");
begun.bakeAnew([[0, 0, 0], [1, 1, 1]]);
holds(begun.bake(1) || begun.jobs.next === begun.jobs.end, "bakeAnew");
begun.caches = caches;
begun.bake(1);
begun.free();

// Workers
const workers = await Workers.start({ count: 2, wasm: inlineBytes() });
holds(workers.count === 2, "count");
const there = await workers.world({ media, scene, lights, bounds: box });
holds(same(await there.pathTrace(view, { samples: 2 }), traced), "pathTrace on workers");
const filled = await workers.caches(there, options);
const stages: Progress[] = [];
holds(await filled.fill({ onProgress: (progress) => stages.push(progress) }), "fill on workers");
holds(stages.length > 0 && same(await filled.save(), saved), "the same bits on workers");
holds(same(await filled.picture(view, { samples: 2 }), caches.picture(view, { samples: 2 })), "pictures on workers");
await filled.load(saved);
await filled.ask({ box });
holds(!(await filled.fill({ signal: AbortSignal.abort() })), "abort");
holds((await filled.inScattered([0, 0, 0.5], [0, 0, 1])).length === 3 && (await filled.records()).length > 0, "readers on workers");
const baked = await workers.probes(there, { counts: [4, 4, 4], degree: 0, error: 0.5, passes: 4, caches: filled });
holds(await baked.bake(), "bake on workers");
holds((await baked.textures()).harmonics.length === 1 && (await baked.values([0, 0, 0], [0, 1, 0])).length === 3, "probes on workers");
await baked.load(await baked.save());
await baked.bakeAnew(box);
await Promise.all([baked.free(), filled.free(), there.free()]);
await workers.caches(there, options).then(() => holds(false, "a freed world"), (error: unknown) => holds(error instanceof FogbowError && /has been freed/.test(error.message), "a freed world"));
workers.close();

// What is refused, and in which words
refuses(() => new World({ media: [Medium.homogeneous({ scattering: -1, box })] }), /medium 0: absorption and scattering must be finite/);
refuses(() => new World({ lights: [Light.quad({ corner: [0, 0, 0], edgeU: [0, 0, 0], edgeV: [0, 1, 0], radiance: 1 })] }), /light 0: /);
refuses(() => new World({ scene: new Scene().sphere([0, 0, 0], -1) }), /sphere 0: a radius must be finite and positive/);
refuses(() => new Scene().triangles([0, 0, 0], [0, 1, 2]), /triangle 0: vertex 1 is none of 1/);
refuses(() => Medium.grid({ scattering: 1, size: [2, 2, 2], density: [1], box }), /1 cells/);
refuses(() => world.radiance([0, 0, 0, 2, 0, 0, 1]), /ray 0: its direction is no unit vector/);
refuses(() => world.pathTrace({ ...view, width: 0 }), /pixels/);
refuses(() => new Probes(world, { counts: [1e6, 1e6, 1e6] }), /probes are too many/);
refuses(() => new Caches(world, { box, error: 0 }), /error/);
const probe = new World({ lights, bounds: box });
probe.free();
probe.free();
refuses(() => probe.bounds, /has been freed/);
try {
  probe.bounds;
} catch (error) {
  holds(error instanceof FogbowError, "FogbowError");
}
if (Symbol.dispose) {
  using own = new World({ lights, bounds: box });
  holds(own.bounds[0][0] === -1, "using");
}

// Memory is flat, however many objects there have been; of those that nobody frees, too.
const cycles = Number(process.argv[2] ?? 1000);
const cycle = (): void => {
  const world = new World({ media: media.slice(0, 2), scene, lights, bounds: box });
  const caches = new Caches(world, { view, rays: 16 });
  const probes = new Probes(world, { counts: [8, 8, 8] });
  for (const object of [probes, caches, world]) object.free();
};
for (let i = 0; i < 50; i++) cycle();
trim();
const before = memoryBytes();
for (let i = 0; i < cycles; i++) cycle();
holds(memoryBytes() === before, "memory is flat");
if (typeof gc === "function") {
  for (let i = 0; i < 200; i++) {
    new World({ media, scene, lights, bounds: box });
    if (i % 20 === 19) {
      gc();
      await new Promise((resolve) => setTimeout(resolve, 5));
    }
  }
  const after = memoryBytes();
  for (let i = 0; i < 400; i++) {
    new World({ media, scene, lights, bounds: box });
    if (i % 20 === 19) {
      gc();
      await new Promise((resolve) => setTimeout(resolve, 5));
    }
  }
  holds(memoryBytes() === after, "collected objects are freed");
}
console.log(`memory ${before} bytes before and after ${cycles} worlds, caches and probes`);
