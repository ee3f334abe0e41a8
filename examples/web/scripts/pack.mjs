// Puts the package together: node pack.mjs FOLDER PLAIN.wasm SIMD.wasm
// The module, the same with SIMD, the same bytes in a JavaScript file, licences, README.

import { cp, mkdir, readFile, readdir, writeFile } from "node:fs/promises";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";

const [folder, plain, simd] = process.argv.slice(2);
const own = join(dirname(fileURLToPath(import.meta.url)), "..");
const root = join(own, "..", "..");

await mkdir(folder, { recursive: true });
for (const file of await readdir(join(own, "package"))) await cp(join(own, "package", file), join(folder, file));
await cp(plain, join(folder, "fogbow.wasm"));
await cp(simd, join(folder, "fogbow-simd.wasm"));
await cp(join(own, "README.md"), join(folder, "README.md"));
for (const licence of ["LICENSE-MIT", "LICENSE-APACHE"]) await cp(join(root, licence), join(folder, licence));

const base64 = (await readFile(plain)).toString("base64");
await writeFile(
  join(folder, "inline.js"),
  `// fogbow with the bytes of the module inside: for bundlers and hosts that lose its url. Written by scripts/pack.mjs.

import { instantiate } from "./core.js";

export * from "./api.js";

const BYTES = "${base64}";

/** The bytes of the module. */
export function bytes() {
  const text = atob(BYTES);
  return Uint8Array.from(text, (character) => character.charCodeAt(0));
}

/** Makes the module ready. */
export async function init() {
  await instantiate(async () => bytes());
}
`,
);
