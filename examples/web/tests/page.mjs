// The page in a real browser: node page.mjs FOLDER-OF-PAGE [--full] [--pictures FOLDER]
//
// Loads, bakes, walks by keyboard, moves sliders, shows truth, difference and mathematics, without an error in the console or a request to elsewhere; axe
// finds nothing; its shader scatters the lamp's light as the library does. With --full also on a phone's width and in the dark, with 50 bakes, and pictures for looking at.

import { readFile } from "node:fs/promises";
import { createRequire } from "node:module";
import { join } from "node:path";
import { PATIENCE, asking, browse, serve, watched } from "./browser.mjs";

const [folder, ...options] = process.argv.slice(2);
const isFull = options.includes("--full");
const pictures = options.includes("--pictures") ? options[options.indexOf("--pictures") + 1] : null;
const axe = await readFile(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");

const failures = [];
const check = (name, holds, told = "") => {
  console.log(`${holds ? "ok " : "OFF"} ${name}${told === "" ? "" : `: ${told}`}`);
  if (!holds) failures.push(name);
};

const picture = (page, name) => pictures && page.screenshot({ path: join(pictures, `${name}.png`) });

async function accessible(page, name) {
  await page.evaluate(axe);
  const { violations } = await page.evaluate(() => globalThis.axe.run());
  check(`axe: ${name}`, violations.length === 0, violations.map(({ id, nodes }) => `${id} ${nodes[0].html}`).join("; "));
}

/** Waits for something to be so, without counting on frames, which are slow here. */
async function until(page, name, condition, argument) {
  const began = Date.now();
  for (;;) {
    if (await page.evaluate(condition, argument)) return check(name, true, `${((Date.now() - began) / 1000).toFixed(1)} s`);
    if (Date.now() - began > PATIENCE) return check(name, false, `after ${PATIENCE / 1000} s`);
    await page.waitForTimeout(100);
  }
}

const text = (page, id) => page.evaluate((id) => document.getElementById(id).textContent, id);

const site = await serve(folder);
await browse(async (browser) => {
  const { page, wrong } = await watched(browser, site.url);
  await page.goto(site.url);
  await until(page, "first light", () => fogbowFrames.firstLight > 0);
  console.log(`    first light ${((await page.evaluate(() => fogbowFrames.firstLight)) / 1000).toFixed(2)} s after the page began`);
  await until(page, "an error is told", () => /noise [\d.]+ %/.test(document.getElementById("baked").textContent));

  // What is seen is no even colour.
  const spread = () => page.evaluate(() => {
    const canvas = document.getElementById("room");
    const small = new OffscreenCanvas(32, 20);
    const context = small.getContext("2d");
    context.drawImage(canvas, 0, 0, 32, 20);
    const { data } = context.getImageData(0, 0, 32, 20);
    const light = Array.from({ length: 640 }, (_, i) => data[4 * i] + data[4 * i + 1] + data[4 * i + 2]);
    const mean = light.reduce((a, b) => a + b, 0) / 640;
    return { mean, deviation: Math.sqrt(light.reduce((a, b) => a + (b - mean) ** 2, 0) / 640), light };
  });
  const before = await spread();
  check("the room is seen", before.mean > 20 && before.deviation > 15, `mean ${before.mean.toFixed(0)}, deviation ${before.deviation.toFixed(0)}`);

  // By keyboard alone: from the top of the page to the room, and ahead.
  for (let i = 0; i < 3; i++) {
    await page.keyboard.press("Tab");
    if (await page.evaluate(() => document.activeElement.id === "room")) break;
  }
  check("the room has the focus", await page.evaluate(() => document.activeElement.id === "room"));
  // Seconds of the processor that the page's scripts have taken, those of baking included.
  const session = await browser.newCDPSession(page);
  await session.send("Performance.enable", { timeDomain: "threadTicks" });
  const spent = async () => {
    const { metrics } = await session.send("Performance.getMetrics");
    const frames = await page.evaluate(() => fogbowFrames.count);
    return [metrics.find(({ name }) => name === "ScriptDuration").value, frames];
  };
  const [scriptBefore, framesBefore] = await spent();
  await page.keyboard.down("ArrowUp");
  await until(page, "frames follow each other", (count) => fogbowFrames.count >= count, framesBefore + 10);
  await page.keyboard.up("ArrowUp");
  await page.waitForTimeout(900);
  const after = await spread();
  const moved = after.light.reduce((sum, light, i) => sum + Math.abs(light - before.light[i]), 0) / 640;
  check("walking changes the picture", moved > 4, moved.toFixed(1));
  const [scriptAfter, framesAfter] = await spent();
  const each = (1000 * (scriptAfter - scriptBefore)) / (framesAfter - framesBefore);
  check("a frame takes at most 4 ms of the processor for scripts", each <= 4, `${each.toFixed(2)} ms, over ${framesAfter - framesBefore} frames`);

  const slide = (id, value) => page.evaluate(([id, value]) => {
    const slider = document.getElementById(id);
    slider.value = value;
    slider.dispatchEvent(new Event("input", { bubbles: true }));
  }, [id, value]);
  await slide("density", "0.3");
  await slide("lamp-x", "4.9");
  await until(page, "a slider begins another bake", () => {
    const [, seconds] = /, ([\d.]+) s/.exec(document.getElementById("baked").textContent) ?? [];
    return Number(seconds) < 2;
  });
  await picture(page, "desktop");
  await accessible(page, "the room");

  await page.getByLabel("Path-traced truth").check();
  await until(page, "the truth is traced", (least) => fogbowTruth.samples >= least, isFull ? 32 : 2);
  await picture(page, "truth");
  const samples = await page.evaluate(() => fogbowTruth.samples);
  await page.getByLabel("Difference").check();
  await until(page, "the difference is told", () => /(brighter|darker) on the whole/.test(document.getElementById("compared").textContent));
  console.log(`    ${await text(page, "compared")}`);
  const left = await page.evaluate(() => fogbowTruth.samples);
  check("the difference goes on with the samples of the truth", left >= samples, `${samples}, then ${left}`);
  if (isFull) {
    console.log(`    ${await text(page, "baked")}`);
    // One worker traces and bakes in turns; what is compared in the end is the light of a bake that is done.
    await until(page, "the bake is done while the truth is traced", () => document.getElementById("baked").textContent.startsWith("Done"));
    await until(page, "it is what is compared", () => document.getElementById("compared").textContent.startsWith("Baked light is"));
    console.log(`    ${await text(page, "baked")}\n    ${await text(page, "compared")}`);
    const off = await page.evaluate(() => fogbowTruth.off);
    check("baked light is near the truth", Math.abs(off) < 0.06, `${(100 * off).toFixed(1)} %`);
  }
  await picture(page, "difference");
  await page.getByLabel("Baked light").check();

  await page.getByRole("tab", { name: "The mathematics" }).click();
  await until(page, "a record, covariances and a virtual light", () =>
    ["record-values", "covariance-values", "virtual-values"].every((id) => /\d/.test(document.getElementById(id).textContent)));
  const record = await text(page, "record-values");
  await page.focus("#record");
  for (let i = 0; i < 5; i++) await page.keyboard.press("ArrowLeft");
  check("the record moves", (await text(page, "record-values")) !== record, await text(page, "record-values"));
  await picture(page, "mathematics");
  await accessible(page, "the mathematics");

  if (isFull) {
    await page.getByRole("tab", { name: "The room" }).click();
    const heap = async () => {
      await session.send("HeapProfiler.collectGarbage");
      const { usedSize } = await session.send("Runtime.getHeapUsage");
      return usedSize / 1e6;
    };
    const heaps = [];
    for (let i = 0; i < 50; i++) {
      await slide("lamp-z", String(1 + (i % 8)));
      await page.waitForTimeout(600);
      if (i === 9 || i === 49) heaps.push(await heap());
    }
    check("the heap is flat over 40 bakes after the first ten", heaps[1] < 1.1 * heaps[0] + 1, heaps.map((mb) => `${mb.toFixed(1)} MB`).join(" → "));
  }
  check("no errors, no requests to elsewhere", wrong.length === 0, wrong.join("; "));
});

// What the page's own shader does with the lamp, which it takes as a point: light scattered once, as the library has it. Pictures with and without albedo
// differ by that alone.
await browse(async (browser) => {
  const { page, wrong } = await asking(browser, site.url);
  for (const g of [-0.4, 0, 0.8]) {
    const off = await page.evaluate(async (g) => {
      const [{ Renderer }, { World, init }, { describe, intensity }] = await Promise.all(["/renderer.js", "/fogbow/fogbow.js", "/room.js"].map((file) => import(file)));
      await init();
      const settings = { density: 0.3, albedo: 0.95, g, smoke: 0, smokeExtinction: 0, colour: [1, 0.7, 0.4], lamp: [4.2, 2.4, 4.3] };
      settings.intensity = intensity(settings);
      const world = new World(describe(settings));
      const renderer = new Renderer(document.createElement("canvas"), await (await fetch("/fog.glsl")).text());
      // Across the room, between its columns, below the lamp: towards it, then away from it.
      const [width, height, half] = [15, 10, 0.15];
      const eye = [0.3, 1.6, 4.3];
      const view = { eye, forward: [1, 0, 0], right: [0, 0, half * (width / height)], up: [0, half, 0] };
      const marched = (albedo) => {
        renderer.marched(width, height, view, { ...settings, albedo }, { steps: 512, jitter: 0 });
        return renderer.read();
      };
      const [lit, dark] = [marched(settings.albedo), marched(0)];
      const [steps, far] = [1000, 6];
      const each = far / steps;
      let [ours, theirs, worst] = [0, 0, 0];
      for (let i = 0; i < width * height; i++) {
        const [x, y] = [2 * (((i % width) + 0.5) / width) - 1, 2 * ((Math.floor(i / width) + 0.5) / height) - 1];
        const way = [1, y * half, x * view.right[2]];
        const length = Math.hypot(...way);
        const to = way.map((c) => -c / length);
        const points = Float32Array.from({ length: 3 * steps }, (_, k) => eye[k % 3] - to[k % 3] * (Math.floor(k / 3) + 0.5) * each);
        // Behind walls there is no light.
        const once = world.scatteredOnce(points, Float32Array.from({ length: 3 * steps }, (_, k) => to[k % 3]));
        let sum = 0;
        for (let s = 0; s < steps; s++) sum += Math.exp(-settings.density * (s + 0.5) * each) * settings.density * settings.albedo * each * once[3 * s + 1];
        const here = lit[4 * i + 1] - dark[4 * i + 1];
        [ours, theirs, worst] = [ours + here, theirs + sum, Math.max(worst, Math.abs(here / sum - 1))];
      }
      return { whole: ours / theirs - 1, worst };
    }, g);
    check(`the shader scatters light of the lamp as the library does, g = ${g}`, Math.abs(off.whole) < 0.02 && off.worst < 0.08,
      `${(100 * off.whole).toFixed(2)} %, ${(100 * off.worst).toFixed(1)} % in a pixel`);
  }
  check("no errors in it", wrong.length === 0, wrong.join("; "));
});

for (const [name, options] of isFull ? [["phone", { viewport: { width: 375, height: 760 }, hasTouch: true, isMobile: true }], ["dark", { colorScheme: "dark" }]] : []) {
  await browse(async (browser) => {
    const { page, wrong } = await watched(browser, site.url);
    await page.goto(site.url);
    await until(page, `${name}: first light`, () => fogbowFrames.firstLight > 0);
    await page.waitForTimeout(3000);
    const wide = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
    check(`${name}: nothing sticks out`, wide <= 0, `${wide} px`);
    await picture(page, name);
    await accessible(page, name);
    await page.getByRole("tab", { name: "The mathematics" }).click();
    await until(page, `${name}: mathematics`, () => /\d/.test(document.getElementById("virtual-values").textContent));
    await picture(page, `${name}-mathematics`);
    await accessible(page, `${name}, mathematics`);
    check(`${name}: no errors, no requests to elsewhere`, wrong.length === 0, wrong.join("; "));
  }, options);
}
site.close();
process.exit(failures.length ? 1 : 0);
