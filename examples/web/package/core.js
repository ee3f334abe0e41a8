// The module and the objects that live in it.

import { Words, askedWords, cachesWords, pictureWords, probesWords, typed, worldWords } from "./describe.js";

const ABI = 1;
const FAILED = 0xffffffff;

/** What the module has refused, in its words. */
export class FogbowError extends Error {
  constructor(message) {
    super(message);
    this.name = "FogbowError";
  }
}

// One function that uses vectors of 128 bits: what engines without them refuse.
const SIMD_PROBE = Uint8Array.of(0, 97, 115, 109, 1, 0, 0, 0, 1, 5, 1, 96, 0, 1, 123, 3, 2, 1, 0, 10, 10, 1, 8, 0, 65, 0, 253, 15, 253, 98, 11);

/** Whether WebAssembly has SIMD here. */
export function hasSimd() {
  return WebAssembly.validate(SIMD_PROBE);
}

let exports = null;
let ended = null;

let starting = null;

/** Compiles nothing twice: whoever calls again, or meanwhile, gets the module that is there. After a failure one may try again. */
export async function instantiate(source) {
  if (exports) return;
  starting ??= (async () => {
    const resolved = await source();
    const module = resolved instanceof WebAssembly.Module ? resolved : await WebAssembly.compile(resolved);
    start(await WebAssembly.instantiate(module, {}));
  })();
  try {
    await starting;
  } finally {
    starting = null;
  }
}

/** As `instantiate`, without waiting: for workers and for Node. */
export function instantiateSync(bytesOrModule) {
  if (exports) return;
  const module = bytesOrModule instanceof WebAssembly.Module ? bytesOrModule : new WebAssembly.Module(bytesOrModule);
  start(new WebAssembly.Instance(module, {}));
}

function start(instance) {
  const found = instance.exports.fogbow_abi_version?.();
  if (found !== ABI) throw new FogbowError("this is not fogbow's module, or of another version");
  exports = instance.exports;
}

function wasm() {
  if (ended) throw new FogbowError(`the module has ended: ${ended}`);
  if (!exports) throw new FogbowError("call init() and await it first");
  return exports;
}

/** Bytes of memory that the module has. */
export function memoryBytes() {
  return wasm().memory.buffer.byteLength;
}

/** Calls an export; what it refuses becomes an exception. */
function call(name, ...args) {
  const module = wasm();
  let answer;
  try {
    answer = module[name](...args) >>> 0;
  } catch (error) {
    // A bug of the library, or no memory is left: what is in the module cannot be trusted any more.
    ended = `${error.message ?? error}; no memory is left, or this is a bug`;
    throw new FogbowError(`the module has ended: ${ended}`);
  }
  if (answer === FAILED) {
    module.fogbow_message();
    throw new FogbowError(text() || "the module is busy");
  }
  return answer;
}

function input(array) {
  const at = call("fogbow_input", array.byteLength);
  new Uint8Array(wasm().memory.buffer, at, array.byteLength).set(new Uint8Array(array.buffer, array.byteOffset, array.byteLength));
}

function output(Type) {
  const module = wasm();
  const bytes = new Uint8Array(module.memory.buffer, module.fogbow_output() >>> 0, module.fogbow_output_length() >>> 0).slice();
  return Type === Uint8Array ? bytes : new Type(bytes.buffer);
}

function text() {
  return new TextDecoder().decode(output(Uint8Array));
}

// Objects that nobody frees are freed when they are collected. It is a net: when that happens nobody knows.
const net = new FinalizationRegistry(([kind, handle]) => {
  if (exports && !ended) call(`${kind}_free`, handle);
});


class Held {
  #kind;
  #handle;

  constructor(kind, handle) {
    this.#kind = kind;
    this.#handle = handle;
    net.register(this, [kind, handle], this);
  }

  /** The handle, for calls. */
  get _handle() {
    if (this.#handle === null) throw new FogbowError("the object has been freed");
    return this.#handle;
  }

  /** Frees its memory in the module. Again is no error. */
  free() {
    if (this.#handle === null) return;
    net.unregister(this);
    const handle = this.#handle;
    this.#handle = null;
    if (!ended) call(`${this.#kind}_free`, handle);
  }
}

if (Symbol.dispose) {
  Object.defineProperty(Held.prototype, Symbol.dispose, { value() { this.free(); } });
}

function pairs(points, directions) {
  const [a, b] = [typed(points, Float32Array, "points"), typed(directions, Float32Array, "directions")];
  if (a.length !== b.length || a.length % 3) throw new RangeError("points and directions are three numbers each, as many of both");
  const both = new Float32Array(2 * a.length);
  for (let i = 0; i < a.length; i += 3) {
    both.set(a.subarray(i, i + 3), 2 * i);
    both.set(b.subarray(i, i + 3), 2 * i + 3);
  }
  return both;
}

function raysOf(rays) {
  const all = typed(rays, Float32Array, "rays");
  if (all.length % 7 === 0) return all;
  throw new RangeError("a ray is 7 numbers: origin, direction, length");
}

/** Media, surfaces and lights. */
export class World extends Held {
  constructor(description) {
    const words = description instanceof Uint32Array ? description : worldWords(description);
    input(words);
    super("world", call("world_new"));
    this.words = words;
  }

  get bounds() {
    call("world_bounds", this._handle);
    const [a, b, c, d, e, f] = output(Float32Array);
    return [[a, b, c], [d, e, f]];
  }

  pathTrace(view, part) {
    input(pictureWords(view, part));
    call("world_picture", this._handle);
    return output(Float32Array);
  }

  radiance(rays, { samples = 1, seed = 0 } = {}) {
    input(raysOf(rays));
    call("world_radiance", this._handle, samples, seed);
    return output(Float32Array);
  }

  inScattered(points, directions, { samples = 1, seed = 0 } = {}) {
    input(pairs(points, directions));
    call("world_in_scattered", this._handle, samples, seed);
    return output(Float32Array);
  }

  scatteredOnce(points, directions) {
    input(pairs(points, directions));
    call("world_scattered_once", this._handle);
    return output(Float32Array);
  }

  record(point, toEye, { tolerance = 0.2, least = 0.01, most = 10 } = {}) {
    const words = new Words().vector(point, "point").vector(toEye, "toEye").float(tolerance, "tolerance");
    input(words.float(least, "least").float(most, "most").done());
    call("world_record", this._handle);
    return recordOf(output(Float32Array));
  }

  covariances({ edge = 16, photons = 10000 } = {}) {
    input(new Words().integer(edge, "edge").integer(photons, "photons").done());
    call("world_covariances", this._handle);
    const all = output(Float32Array);
    return { size: Array.from(new Uint32Array(all.buffer, 0, 3)), covariances: all.subarray(3) };
  }

  virtualLight({ position, incoming, flux = 1, bound, eye }, points) {
    const words = new Words().vector(position, "position").vector(incoming, "incoming").colour(flux, "flux");
    words.float(bound, "bound").vector(eye, "eye").array(typed(points, Float32Array, "points"));
    input(words.done());
    call("world_virtual_light", this._handle);
    const both = output(Float32Array);
    const [clamped, all] = [new Float32Array(both.length / 2), new Float32Array(both.length / 2)];
    for (let i = 0; i < both.length; i += 6) {
      clamped.set(both.subarray(i, i + 3), i / 2);
      all.set(both.subarray(i + 3, i + 6), i / 2);
    }
    return { clamped, all };
  }
}

function recordOf(numbers) {
  const three = (at) => Array.from(numbers.subarray(at, at + 3));
  return { position: three(0), radius: numbers[3], value: three(4), gradient: [three(7), three(10), three(13)] };
}

const RECORDS = { single: 0, surface: 1, multiple: 2, irradiance: 3 };

/** Radiance caches of a world. */
export class Caches extends Held {
  constructor(world, options) {
    const words = options instanceof Uint32Array ? options : cachesWords(options);
    input(words);
    super("caches", call("caches_new", world._handle));
    this.world = world;
    this.words = words;
  }

  fill(jobs = 16) {
    return call("caches_fill", this._handle, this.world._handle, jobs) === 1;
  }

  ask(asked) {
    input(askedWords(asked));
    call("caches_ask", this._handle);
  }

  cancel() {
    call("caches_stop", this._handle);
  }

  get jobs() {
    call("caches_jobs", this._handle);
    const [next, end] = output(Uint32Array);
    return { next, end };
  }

  get stage() {
    call("caches_stage", this._handle);
    return text();
  }

  run(job) {
    call("caches_run", this._handle, this.world._handle, job);
    return output(Uint8Array);
  }

  accept(left) {
    input(left);
    call("caches_accept", this._handle, left.byteLength);
  }

  picture(view, part) {
    input(pictureWords(view, part));
    call("caches_picture", this._handle, this.world._handle);
    return output(Float32Array);
  }

  radiance(rays, { samples = 1, seed = 0 } = {}) {
    input(raysOf(rays));
    call("caches_radiance", this._handle, this.world._handle, samples, seed);
    return output(Float32Array);
  }

  inScattered(points, directions, { seed = 0 } = {}) {
    input(pairs(points, directions));
    call("caches_in_scattered", this._handle, this.world._handle, seed);
    return output(Float32Array);
  }

  records(kind = "multiple") {
    if (!(kind in RECORDS)) throw new TypeError(`there are no records "${kind}"`);
    call("caches_records", this._handle, RECORDS[kind]);
    return output(Float32Array);
  }

  save() {
    call("caches_save", this._handle);
    return output(Uint8Array);
  }

  load(bytes) {
    input(bytes);
    call("caches_load", this._handle, bytes.byteLength);
  }
}

/** A grid of light probes in a world. */
export class Probes extends Held {
  constructor(world, options) {
    const isWords = options instanceof Uint32Array;
    const words = isWords ? options : probesWords(options);
    input(words);
    super("probes", call("probes_new", world._handle));
    this.world = world;
    this.words = words;
    this.caches = (!isWords && options.caches) || null;
    this.counts = [words[6], words[7], words[8]];
    this.degree = words[9];
  }

  get #caches() {
    return this.caches ? this.caches._handle : FAILED;
  }

  bake(jobs = 16) {
    return call("probes_bake", this._handle, this.world._handle, this.#caches, jobs) === 1;
  }

  bakeAnew([min, max]) {
    input(new Words().vector(min, "box[0]").vector(max, "box[1]").done());
    call("probes_bake_anew", this._handle);
  }

  get jobs() {
    call("probes_jobs", this._handle);
    const [next, end] = output(Uint32Array);
    return { next, end };
  }

  run(job) {
    call("probes_run", this._handle, this.world._handle, this.#caches, job);
    return output(Uint8Array);
  }

  accept(left) {
    input(left);
    call("probes_accept", this._handle, left.byteLength);
  }

  get error() {
    call("probes_progress", this._handle);
    return output(Float32Array)[0];
  }

  get share() {
    call("probes_progress", this._handle);
    return output(Float32Array)[1];
  }

  values(points, directions) {
    input(pairs(points, directions));
    call("probes_values", this._handle);
    return output(Float32Array);
  }

  textures({ dilated = true } = {}) {
    call("probes_textures", this._handle, dilated ? 1 : 0);
    const all = output(Float32Array);
    const each = 4 * this.counts[0] * this.counts[1] * this.counts[2];
    const numbers = (this.degree + 1) ** 2;
    const harmonics = Array.from({ length: numbers }, (_, i) => all.subarray(i * each, (i + 1) * each));
    const [medium, ...walls] = [0, 1, 2].map((i) => all.subarray((numbers + i) * each, (numbers + i + 1) * each));
    return { counts: this.counts, harmonics, medium, walls };
  }

  save() {
    call("probes_save", this._handle);
    return output(Uint8Array);
  }

  load(bytes) {
    input(bytes);
    call("probes_load", this._handle, bytes.byteLength);
  }
}

/** Gives back the memory of inputs and outputs, which is as large as the largest so far. */
export function trim() {
  call("fogbow_trim");
}
