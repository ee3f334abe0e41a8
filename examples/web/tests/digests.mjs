// The same bits natively, in WebAssembly with and without SIMD, and with one, two and four workers:
//
//     node digests.mjs NATIVE-PROGRAM FOLDER-OF-PACKAGE [--full]
//
// NATIVE-PROGRAM is `native/digests.rs`. With --full at the effort that pictures have, and with figures of speed.

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
  const files = await Promise.all(
    [describe.worldWords(world), describe.cachesWords(caches), describe.pictureWords(view, part), describe.probesWords(probes)].map(
      async (words, i) => {
        const file = join(scratch, String(i));
        await writeFile(file, words);
        return file;
      },
    ),
  );
  const { stdout, stderr } = await promisify(execFile)(native, files);
  const due = Object.fromEntries(stdout.trim().split("\n").map((line) => line.split(" ")));
  console.log(`${name}, native: ${JSON.stringify(due)}`);
  const seconds = {};
  for (const [file, counts] of [["fogbow.wasm", full ? [1, 2, 4] : [1]], ["fogbow-simd.wasm", full ? [1, 2, 4] : [1, 4]]]) {
    for (const count of counts) {
      const found = await inWorkers(file, count, { world, caches, view, part, probes });
      compare(`${name}, ${file}, ${count} worker${count > 1 ? "s" : ""}`, found.digests, due);
      if (count === 1) seconds[file] = found.seconds;
    }
  }
  if (full) {
    const own = Number.parseFloat(stderr);
    for (const [file, taken] of Object.entries(seconds)) {
      console.log(`${name}: native ${own.toFixed(2)} CPU s, ${file} ${taken.toFixed(2)} s: ${(own / taken).toFixed(2)} x native`);
    }
  }
}
await rm(scratch, { recursive: true });
process.exit(failed ? 1 : 0);
