// What runs in each worker: its own instance of the module, and objects by number.

import { Caches, Probes, World, instantiateSync } from "./core.js";

const objects = new Map();

const operations = {
  start: ({ module }) => instantiateSync(module),
  world: ({ key, words }) => void objects.set(key, new World(words)),
  caches: ({ key, world, words }) => void objects.set(key, new Caches(objects.get(world), words)),
  probes({ key, world, words, caches }) {
    const probes = new Probes(objects.get(world), words);
    probes.caches = caches === null ? null : objects.get(caches);
    objects.set(key, probes);
  },
  // Takes what all workers have left of the last jobs, in order, then runs its share of the next.
  step({ key, accept, worker, workers, jobs }) {
    const object = objects.get(key);
    for (const left of accept) object.accept(new Uint8Array(left));
    const { next, end } = object.jobs;
    const left = [];
    for (let job = next + worker; job < Math.min(end, next + workers * jobs); job += workers) left.push(object.run(job).buffer);
    return { left, next, end, ...status(object) };
  },
  // Alone: nothing has to be sent.
  alone({ key, jobs }) {
    const object = objects.get(key);
    if (object instanceof Caches) object.fill(jobs);
    else object.bake(jobs);
    return { left: [], ...object.jobs, ...status(object) };
  },
  cancel: ({ key }) => objects.get(key).cancel?.(),
  call({ key, name, args }) {
    const answer = objects.get(key)[name](...args);
    return answer;
  },
  free({ key }) {
    objects.get(key)?.free();
    objects.delete(key);
  },
};

function status(object) {
  return object instanceof Caches ? { stage: object.stage } : { stage: "bake", error: object.error, share: object.share };
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
