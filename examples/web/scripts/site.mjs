// Puts the page together, ready for any static host: node site.mjs FOLDER PACKAGE

import { cp, mkdir } from "node:fs/promises";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";

const [folder, built] = process.argv.slice(2);
const own = join(dirname(fileURLToPath(import.meta.url)), "..");
await mkdir(folder, { recursive: true });
await cp(join(own, "page"), folder, { recursive: true });
await cp(join(own, "..", "shaders", "fog.glsl"), join(folder, "fog.glsl"));
await cp(built, join(folder, "fogbow"), { recursive: true });
