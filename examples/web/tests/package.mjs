// The package as its users have it: node package.mjs FOLDER-OF-PACKAGE [--full]
//
// Its size; installed from its tarball into an empty folder; the README's example for Node as it stands there; a program that uses every call, checked by
// TypeScript and run; errors; memory after many objects. With --full also the README's page and its example for Vite, in a browser.

import { execFile } from "node:child_process";
import { cp, mkdir, mkdtemp, readFile, rm, stat, writeFile } from "node:fs/promises";
import { tmpdir } from "node:os";
import { dirname, join, resolve } from "node:path";
import { fileURLToPath, pathToFileURL } from "node:url";
import { promisify } from "node:util";
import { brotliCompressSync, constants } from "node:zlib";

const run = promisify(execFile);
const [given, full] = process.argv.slice(2);
const folder = resolve(given);
const own = dirname(fileURLToPath(import.meta.url));
const failures = [];
const check = (name, holds, told = "") => {
  console.log(`${holds ? "ok " : "OFF"} ${name}${told === "" ? "" : `: ${told}`}`);
  if (!holds) failures.push(name);
};

for (const file of ["fogbow.wasm", "fogbow-simd.wasm"]) {
  const bytes = await readFile(join(folder, file));
  const brotli = brotliCompressSync(bytes, { params: { [constants.BROTLI_PARAM_QUALITY]: 11 } }).length;
  // Of gzip itself: Node's zlib makes more of the same.
  const gzip = (await run("gzip", ["-9", "-c", join(folder, file)], { encoding: "buffer", maxBuffer: 1 << 21 })).stdout.length;
  const told = `${bytes.length} bytes, ${gzip} by gzip, ${brotli} by brotli`;
  check(`${file} has at most 600 kB, 250 kB compressed`, bytes.length <= 600_000 && gzip <= 250_000, told);
  const imports = WebAssembly.Module.imports(new WebAssembly.Module(bytes));
  check(`${file} imports nothing`, imports.length === 0, imports.map(({ name }) => name).join());
}

const versions = [
  JSON.parse(await readFile(join(folder, "package.json"), "utf8")).version,
  (await import(pathToFileURL(join(folder, "api.js")).href)).version,
  /^version = "(.*)"$/m.exec(await readFile(join(own, "../../../Cargo.toml"), "utf8"))[1],
];
check("the package's version is the library's", new Set(versions).size === 1, versions.join(", "));

const empty = await mkdtemp(join(tmpdir(), "fogbow-user-"));
try {
  const { stdout } = await run("npm", ["pack", folder, "--pack-destination", empty, "--silent"]);
  const tarball = join(empty, stdout.trim());
  console.log(`    ${stdout.trim()}: ${(await stat(tarball)).size} bytes`);
  await writeFile(join(empty, "package.json"), '{ "private": true, "type": "module" }');
  await run("npm", ["install", tarball, "--no-audit", "--no-fund", "--silent", "--offline"], { cwd: empty });

  const readme = await readFile(join(empty, "node_modules/fogbow/README.md"), "utf8");
  const example = (name) => new RegExp(`<!-- test: ${name} -->\n\`\`\`\\w+\n([^]*?)\n\`\`\``).exec(readme)[1];

  const lines = example("page").split("\n").length;
  check("a page that bakes a room has fewer than 60 lines", lines < 60, lines);
  await writeFile(join(empty, "fog.mjs"), example("node"));
  await run("node", ["fog.mjs"], { cwd: empty });
  const pixels = (await readFile(join(empty, "fog.ppm"))).subarray("P6 64 64 255\n".length);
  const at = (x, y) => pixels[3 * (64 * y + x)];
  check("the README's example for Node", pixels.length === 3 * 64 * 64 && at(32, 32) > at(32, 20) && at(32, 20) > at(1, 1), `${at(32, 32)}, ${at(32, 20)}, ${at(1, 1)}`);

  await cp(join(own, "every-call.ts"), join(empty, "every-call.ts"));
  const tsc = join(own, "node_modules/typescript/bin/tsc");
  const settings = ["--strict", "--noEmit", "false", "--target", "es2023", "--lib", "es2023,esnext.disposable,dom", "--module", "nodenext", "--types", ""];
  const checked = await run("node", [tsc, ...settings, "every-call.ts"], { cwd: empty }).catch((error) => error);
  check("tsc --strict takes a program that uses every call", !checked.code, checked.code ? checked.stdout : "");
  const used = await run("node", ["--expose-gc", "every-call.js", full ? "10000" : "300"], { cwd: empty }).catch((error) => error);
  process.stdout.write(used.stdout.replace(/^/gm, "    ").trimEnd() + "\n");
  check("the program runs", !used.code, used.code ? used.stderr : "");

  if (full) {
    const { browse, serve, watched } = await import("./browser.mjs");
    const visit = async (root, name, title) => {
      const site = await serve(root);
      await browse(async (browser) => {
        const { page, wrong } = await watched(browser, site.url);
        await page.goto(site.url);
        const holds = await page.waitForFunction((title) => document.title.startsWith(title), title).then(() => true, () => false);
        check(`the README's example for ${name}`, holds && wrong.length === 0, [await page.title(), ...wrong].join("; "));
      });
      site.close();
    };
    const page = join(empty, "page");
    await mkdir(page);
    // A page without a title has one that the browser asks for by itself.
    await writeFile(join(page, "index.html"), example("page").replace("<title>", '<link rel="icon" href="data:,"><title>'));
    await cp(join(empty, "node_modules/fogbow"), join(page, "fogbow"), { recursive: true });
    await visit(page, "a page", "done: 9 textures of 384 probes");

    const vite = join(empty, "vite");
    await mkdir(join(vite, "node_modules"), { recursive: true });
    await cp(join(empty, "node_modules/fogbow"), join(vite, "node_modules/fogbow"), { recursive: true });
    await writeFile(join(vite, "package.json"), '{ "private": true, "type": "module" }');
    await writeFile(join(vite, "index.html"), '<!doctype html><link rel="icon" href="data:,"><title>…</title><script type="module" src="/main.js"></script>');
    for (const [name, source] of [["Vite", example("vite")], ["Vite, with the bytes inside", example("vite").replace('"fogbow"', '"fogbow/inline"')]]) {
      await writeFile(join(vite, "main.js"), source);
      await run("node", [join(own, "node_modules/vite/bin/vite.js"), "build", "--logLevel", "error"], { cwd: vite });
      await visit(join(vite, "dist"), name, "light: true");
    }
  }
} finally {
  await rm(empty, { recursive: true, force: true });
}
process.exit(failures.length ? 1 : 0);
