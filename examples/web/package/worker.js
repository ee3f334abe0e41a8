// fogbow on workers. Each has a module of its own and gets job numbers; what jobs leave goes to all of them, in order: the same bits for any
// number of workers, and without shared memory, which pages on static hosts do not have.

import { FogbowError, hasSimd } from "./core.js";
import { askedWords, cachesWords, probesWords, viewWords, worldWords } from "./describe.js";

const isNode = typeof process === "object" && process !== null && Boolean(process.versions?.node);

/** A step of all workers should take about so long (ms): cancelling waits for it, and each has an overhead. */
const STEP = 60;

async function compiled(source) {
  const given = await source;
  if (given instanceof WebAssembly.Module) return given;
  if (given instanceof ArrayBuffer || ArrayBuffer.isView(given)) return WebAssembly.compile(given);
  const plain = new URL("./fogbow.wasm", import.meta.url);
  const simd = new URL("./fogbow-simd.wasm", import.meta.url);
  const url = new URL(given ?? (hasSimd() ? simd : plain), import.meta.url);
  if (isNode && url.protocol === "file:") {
    const { readFile } = await import(/* webpackIgnore: true */ /* @vite-ignore */ "node:fs/promises");
    return WebAssembly.compile(await readFile(url));
  }
  const response = await fetch(url);
  if (!response.ok) throw new FogbowError(`${response.status} ${response.statusText}: ${response.url}`);
  return WebAssembly.compile(await response.arrayBuffer());
}

async function startWorker() {
  if (isNode) {
    const { Worker: NodeWorker } = await import(/* webpackIgnore: true */ /* @vite-ignore */ "node:worker_threads");
    const worker = new NodeWorker(new URL("./worker-thread.js", import.meta.url));
    worker.unref();
    return { worker, listen: (on, fail) => worker.on("message", on).on("error", fail), ref: () => worker.ref(), unref: () => worker.unref() };
  }
  const worker = new Worker(new URL("./worker-thread.js", import.meta.url), { type: "module" });
  const listen = (on, fail) => {
    worker.onmessage = ({ data }) => on(data);
    worker.onerror = (event) => fail(new FogbowError(event.message || "a worker could not be started"));
  };
  return { worker, listen, ref() {}, unref() {} };
}

/** One worker: questions and answers. */
class Peer {
  #waiting = new Map();
  #next = 0;
  #broken = null;

  constructor(started) {
    this.started = started;
    started.listen(
      ({ id, result, error }) => {
        // Answers may still come when the worker has been ended.
        if (!this.#waiting.has(id)) return;
        const { resolve, reject } = this.#waiting.get(id);
        this.#waiting.delete(id);
        if (!this.#waiting.size) started.unref();
        if (error) reject(error.name === "FogbowError" ? new FogbowError(error.message) : Object.assign(new Error(error.message), { name: error.name }));
        else resolve(result);
      },
      (error) => this.end(error),
    );
  }

  ask(message) {
    if (this.#broken) return Promise.reject(this.#broken);
    return new Promise((resolve, reject) => {
      const id = this.#next++;
      this.#waiting.set(id, { resolve, reject });
      this.started.ref();
      this.started.worker.postMessage({ id, ...message });
    });
  }

  end(reason) {
    this.#broken = reason;
    this.started.worker.terminate();
    for (const { reject } of this.#waiting.values()) reject(reason);
    this.#waiting.clear();
  }
}

/** Lives in all workers, under one number. */
class Remote {
  constructor(workers, key) {
    this.workers = workers;
    this.key = key;
  }

  async free() {
    if (this.key === null) return;
    const key = this.key;
    this.key = null;
    await this.workers._all({ op: "free", key });
  }

  _call(name, ...args) {
    return this.workers._first({ op: "call", key: this.key, name, args });
  }
}

export class RemoteWorld extends Remote {
  pathTrace(view, part) {
    return this.workers._picture(this.key, "pathTrace", view, part);
  }
}

export class RemoteCaches extends Remote {
  ask(asked) {
    askedWords(asked);
    return this.workers._all({ op: "call", key: this.key, name: "ask", args: [asked] });
  }

  fill(options) {
    return this.workers._run(this, options);
  }

  picture(view, part) {
    return this.workers._picture(this.key, "picture", view, part);
  }

  inScattered(points, directions, options) {
    return this._call("inScattered", points, directions, options);
  }

  records(kind) {
    return this._call("records", kind);
  }

  save() {
    return this._call("save");
  }

  load(bytes) {
    return this.workers._all({ op: "call", key: this.key, name: "load", args: [bytes] });
  }
}

export class RemoteProbes extends Remote {
  bake(options) {
    return this.workers._run(this, options);
  }

  bakeAnew(box) {
    return this.workers._all({ op: "call", key: this.key, name: "bakeAnew", args: [box] });
  }

  values(points, directions) {
    return this._call("values", points, directions);
  }

  textures(options) {
    return this._call("textures", options);
  }

  save() {
    return this._call("save");
  }

  load(bytes) {
    return this.workers._all({ op: "call", key: this.key, name: "load", args: [bytes] });
  }
}

/** Workers, each with its own instance. */
export class Workers {
  #peers;
  #nextKey = 0;

  constructor(peers) {
    this.#peers = peers;
  }

  /** Starts them: one, or `count`. `wasm`: a url, bytes or a compiled module; nothing for the one beside this file. */
  static async start({ count = 1, wasm } = {}) {
    if (!Number.isInteger(count) || count < 1) throw new TypeError("count must be a positive integer");
    const module = await compiled(wasm);
    const peers = await Promise.all(Array.from({ length: count }, async () => new Peer(await startWorker())));
    const workers = new Workers(peers);
    try {
      await workers._all({ op: "start", module });
    } catch (error) {
      workers.close();
      throw error;
    }
    return workers;
  }

  get count() {
    return this.#peers.length;
  }

  async world(description) {
    const world = new RemoteWorld(this, this.#nextKey++);
    await this._all({ op: "world", key: world.key, words: description instanceof Uint32Array ? description : worldWords(description) });
    return world;
  }

  async caches(world, options) {
    const caches = new RemoteCaches(this, this.#nextKey++);
    await this._all({ op: "caches", key: caches.key, world: world.key, words: cachesWords(options) });
    return caches;
  }

  async probes(world, options) {
    const probes = new RemoteProbes(this, this.#nextKey++);
    await this._all({ op: "probes", key: probes.key, world: world.key, words: probesWords(options), caches: options.caches?.key ?? null });
    return probes;
  }

  /** Ends all workers. What waits for them fails. */
  close() {
    for (const peer of this.#peers) peer.end(new FogbowError("the workers have been closed"));
  }

  async _all(message) {
    return Promise.all(this.#peers.map((peer) => peer.ask(message)));
  }

  _first(message) {
    return this.#peers[0].ask(message);
  }

  /** Runs jobs until none are left, or `signal` says so; whether all is done. */
  async _run(object, { signal, onProgress } = {}) {
    const { key } = object;
    const workers = this.#peers.length;
    let [jobs, accept] = [1, []];
    for (;;) {
      if (signal?.aborted) {
        await this._all({ op: "cancel", key });
        return false;
      }
      const began = performance.now();
      const message = workers === 1 ? { op: "alone", key, jobs } : { op: "step", key, accept, workers, jobs };
      const answers = await Promise.all(this.#peers.map((peer, worker) => peer.ask({ ...message, worker })));
      const { next, end, stage, error, share } = answers[0];
      accept = [];
      for (let i = 0; workers > 1 && i < workers * jobs; i++) {
        const left = answers[i % workers].left[Math.floor(i / workers)];
        if (left) accept.push(left);
      }
      onProgress?.({ stage, done: next, of: end, error, share });
      if (next === end) return true;
      const took = performance.now() - began;
      // Jobs of one round are alike; of the next they may be ten times as long.
      jobs = Math.max(1, Math.min(4 * jobs, Math.floor((jobs * STEP) / Math.max(took, 1)), 4096));
    }
  }

  /** Rows of a picture, dealt out among the workers. */
  async _picture(key, name, view, { x = 0, y = 0, width = view.width - x, height = view.height - y, ...rest } = {}) {
    viewWords(view);
    const rows = Math.ceil(height / this.#peers.length);
    const parts = this.#peers.map((_, i) => ({ ...rest, x, y: y + i * rows, width, height: Math.min(rows, height - i * rows) }));
    const asked = parts.filter((part) => part.height > 0);
    const found = await Promise.all(asked.map((part, i) => this.#peers[i].ask({ op: "call", key, name, args: [view, part] })));
    const whole = new Float32Array(3 * width * height);
    found.forEach((colours, i) => whole.set(colours, 3 * width * (asked[i].y - y)));
    return whole;
  }
}

if (Symbol.dispose) {
  Object.defineProperty(Workers.prototype, Symbol.dispose, { value() { this.close(); } });
}
