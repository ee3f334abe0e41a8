// The same bits natively, in WebAssembly with and without SIMD, and with one, two and four workers:
//
//     node digests.mjs NATIVE-PROGRAM FOLDER-OF-PACKAGE [--full]
//
// NATIVE-PROGRAM is `native/digests.rs`. With --full at the effort that pictures have, and with figures of speed: medians of five.

import { execFile } from "node:child_process";
import { mkdtemp, readFile, rm, writeFile } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { pathToFileURL } from "node:url";
import { promisify } from "node:util";
import { digest } from "./crc.mjs";
import { atrium, smokeBox } from "./rooms.mjs";

const [native, folder, full] = process.argv.slice(2);
const at = (file) => pathToFileURL(join(folder, file)).href;
const fogbow = await import(at("fogbow.js"));
const describe = await import(at("describe.js"));
const { Workers } = await import(at("worker.js"));

const scratch = await mkdtemp(join(tmpdir(), "fogbow-"));
let failed = 0;

function compare(name, found, due) {
  const same = JSON.stringify(found) === JSON.stringify(due);
  console.log(`${same ? "same" : "OFF "} ${name}${same ? "" : ` ${JSON.stringify(found)}`}`);
  failed += same ? 0 : 1;
}

/** The work by an instance of its own, in a worker of Node: each file is another module. */
async function inWorkers(file, count, { world, caches, view, part, probes }) {
  const workers = await Workers.start({ count, wasm: await readFile(join(folder, file)) });
  const cpu = process.cpuUsage();
  const there = await workers.world(world);
  const filled = await workers.caches(there, caches);
  await filled.fill();
  const cached = await filled.picture(view, part);
  const { user, system } = process.cpuUsage(cpu);
  const saved = await filled.save();
  const traced = await there.pathTrace(view, part);
  const baked = await workers.probes(there, { ...probes, caches: filled });
  await baked.bake();
  const digests = { caches: digest(saved), cached: digest(cached), traced: digest(traced), probes: digest(await baked.save()) };
  workers.close();
  return { digests, seconds: (user + system) / 1e6 };
}

for (const [name, room] of [["smoke box", smokeBox], ["atrium", atrium]]) {
  const { world, view, probes } = room(fogbow);
  const caches = full ? { view, error: 0.05 } : { view, error: 0.2, rays: 256, walks: 16 };
  const part = { samples: full ? 16 : 2, width: 64, height: 64 };
  const work = { world, caches, view, part, probes };
  const files = await Promise.all(
    [describe.worldWords(world), describe.cachesWords(caches), describe.pictureWords(view, part), describe.probesWords(probes)].map(
      async (words, i) => {
        const file = join(scratch, String(i));
        await writeFile(file, words);
        return file;
      },
    ),
  );
  const natively = () => promisify(execFile)(native, files);
  const { stdout } = await natively();
  const due = Object.fromEntries(stdout.trim().split("\n").map((line) => line.split(" ")));
  console.log(`${name}, native: ${JSON.stringify(due)}`);
  for (const [file, counts] of [["fogbow.wasm", full ? [1, 2, 4] : [1]], ["fogbow-simd.wasm", full ? [1, 2, 4] : [1, 4]]]) {
    for (const count of counts) {
      const found = await inWorkers(file, count, work);
      compare(`${name}, ${file}, ${count} worker${count > 1 ? "s" : ""}`, found.digests, due);
    }
  }
  if (!full) continue;
  // In turns, for machines are now faster and now slower.
  const rounds = [];
  for (let round = 0; round < 5; round++) {
    const { stderr } = await natively();
    const [plain, simd] = [await inWorkers("fogbow.wasm", 1, work), await inWorkers("fogbow-simd.wasm", 1, work)];
    rounds.push([Number.parseFloat(stderr), plain.seconds, simd.seconds]);
  }
  const median = (values) => values.sort((a, b) => a - b)[values.length >> 1];
  console.log(`${name}: native ${median(rounds.map(([own]) => own)).toFixed(2)} CPU s`);
  ["fogbow.wasm", "fogbow-simd.wasm"].forEach((file, i) => {
    const seconds = median(rounds.map((round) => round[1 + i]));
    const ratios = rounds.map((round) => round[0] / round[1 + i]);
    const [least, most] = [Math.min(...ratios), Math.max(...ratios)].map((ratio) => ratio.toFixed(2));
    console.log(`${name}: ${file} ${seconds.toFixed(2)} CPU s, its compilation included: ${median(ratios).toFixed(2)} x native (${least} to ${most})`);
  });
}
await rm(scratch, { recursive: true });
process.exit(failed ? 1 : 0);
