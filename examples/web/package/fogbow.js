// fogbow in WebAssembly. See the README.

import { hasSimd, instantiate } from "./core.js";

export * from "./api.js";

const isNode = typeof process === "object" && process !== null && Boolean(process.versions?.node);

/** The module beside this file. Both urls stand as they are, so that bundlers see them. */
const own = () => (hasSimd() ? new URL("./fogbow-simd.wasm", import.meta.url) : new URL("./fogbow.wasm", import.meta.url));

async function fetched(url) {
  if (isNode && (typeof url === "string" ? url : url.href).startsWith("file:")) {
    const { readFile } = await import(/* webpackIgnore: true */ /* @vite-ignore */ "node:fs/promises");
    return readFile(new URL(url));
  }
  const response = await fetch(url);
  if (!response.ok) throw new Error(`${response.status} ${response.statusText}: ${response.url}`);
  return new Uint8Array(await response.arrayBuffer());
}

/** Makes the module ready. From nothing (beside this file), a url, bytes, a response or a compiled module. */
export async function init(source) {
  await instantiate(async () => {
    const given = await source;
    if (given === undefined) return fetched(own());
    if (typeof given === "string" || given instanceof URL) return fetched(given);
    if (typeof Response === "function" && given instanceof Response) return new Uint8Array(await given.arrayBuffer());
    return given;
  });
}
