export * from "./fogbow.js";
/** Makes the module ready, from the bytes in this file. */
export function init(): Promise<void>;
/** The bytes of the module, without SIMD: for `Workers.start`. */
export function bytes(): Uint8Array<ArrayBuffer>;
