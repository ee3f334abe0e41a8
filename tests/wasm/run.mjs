// Prints the bits of every section of the kernel: node run.mjs FILE.wasm
import { readFile } from "node:fs/promises";

const { instance } = await WebAssembly.instantiate(await readFile(process.argv[2]), {});
const wasm = instance.exports;
for (let i = 0; i < wasm.section_count(); i++) {
  const name = new Uint8Array(wasm.memory.buffer, wasm.section_name(i), wasm.section_name_length(i));
  const bits = BigInt.asUintN(64, wasm.section_bits(i));
  console.log(`${new TextDecoder().decode(name)} ${bits.toString(16).padStart(16, "0")}`);
}
