// What runs in each worker: its own instance of the module, and objects by number.

import { Caches, FogbowError, Probes, World, instantiateSync } from "./core.js";

const objects = new Map();

function object(key) {
  const found = objects.get(key);
  if (!found) throw new FogbowError("the object has been freed");
  return found;
}

const operations = {
  start: ({ module }) => instantiateSync(module),
  world: ({ key, words }) => void objects.set(key, new World(words)),
  caches: ({ key, world, words }) => void objects.set(key, new Caches(object(world), words)),
  probes({ key, world, words, caches }) {
    const probes = new Probes(object(world), words);
    probes.caches = caches === null ? null : object(caches);
    objects.set(key, probes);
  },
  // Takes what all workers have left of the last jobs, in order, then runs its share of the next.
  step({ key, accept, worker, workers, jobs }) {
    const filled = object(key);
    for (const left of accept) filled.accept(new Uint8Array(left));
    const { next, end } = filled.jobs;
    const left = [];
    for (let job = next + worker; job < Math.min(end, next + workers * jobs); job += workers) left.push(filled.run(job).buffer);
    return { left, next, end, ...status(filled) };
  },
  // Alone: nothing has to be sent.
  alone({ key, jobs }) {
    const filled = object(key);
    if (filled instanceof Caches) filled.fill(jobs);
    else filled.bake(jobs);
    return { left: [], ...filled.jobs, ...status(filled) };
  },
  cancel: ({ key }) => object(key).cancel?.(),
  call: ({ key, name, args }) => object(key)[name](...args),
  free({ key }) {
    objects.get(key)?.free();
    objects.delete(key);
  },
};

function status(filled) {
  return filled instanceof Caches ? { stage: filled.stage } : { stage: "bake", error: filled.error, share: filled.share };
}

/** Buffers that are handed over and not copied. */
function buffers(answer) {
  if (ArrayBuffer.isView(answer)) return [answer.buffer];
  if (answer?.harmonics) return [answer.medium.buffer];
  return answer?.left ?? [];
}

function answer({ id, op, ...rest }, post) {
  try {
    const result = operations[op](rest);
    post({ id, result }, buffers(result));
  } catch (error) {
    post({ id, error: { name: error.name, message: error.message } }, []);
  }
}

if (typeof self === "object" && typeof self.postMessage === "function") {
  self.onmessage = ({ data }) => answer(data, (message, list) => self.postMessage(message, list));
} else {
  const { parentPort } = await import(/* webpackIgnore: true */ /* @vite-ignore */ "node:worker_threads");
  parentPort.on("message", (data) => answer(data, (message, list) => parentPort.postMessage(message, list)));
}
