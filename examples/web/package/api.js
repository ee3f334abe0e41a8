// What both ways of loading the module share.

export { Caches, FogbowError, Probes, World, hasSimd, memoryBytes, trim } from "./core.js";
export { Light, Medium, Scene } from "./describe.js";

/** The version of this package. */
export const version = "0.1.0";
