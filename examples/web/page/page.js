// The page: settings, walking, baking on workers, the truth and the difference.

import { Workers } from "./fogbow/worker.js";
import { mathematics } from "./mathematics.js";
import { Renderer } from "./renderer.js";
import { BALL, BOUNDS, BOXES, describe, intensity, smokeExtinction } from "./room.js";

const element = (id) => document.getElementById(id);
const canvas = element("room");

function problem(error) {
  element("problem").textContent = error.message ?? String(error);
  element("problem").hidden = false;
}

// ---------------------------------------------------------------------------------------------
// Settings

const SLIDERS = ["density", "albedo", "g", "smoke", "lamp-x", "lamp-y", "lamp-z"];
const UNITS = { density: " /m", "lamp-x": " m", "lamp-y": " m", "lamp-z": " m" };

function settings() {
  const value = (id) => element(id).valueAsNumber;
  const hex = element("colour").value;
  // From sRGB to light.
  const light = (at) => (Number.parseInt(hex.slice(at, at + 2), 16) / 255) ** 2.2;
  const all = {
    density: value("density"),
    albedo: value("albedo"),
    g: value("g"),
    smoke: value("smoke"),
    colour: [light(1), light(3), light(5)],
    lamp: [value("lamp-x"), value("lamp-y"), value("lamp-z")],
  };
  return { ...all, smokeExtinction: smokeExtinction(all.smoke), intensity: intensity(all) };
}

function showValues() {
  for (const id of SLIDERS) {
    const text = `${element(id).valueAsNumber.toFixed(2)}${UNITS[id] ?? ""}`;
    element(`${id}-value`).textContent = text;
    element(id).setAttribute("aria-valuetext", text);
  }
  element("colour-value").textContent = element("colour").value;
}

// ---------------------------------------------------------------------------------------------
// Walking

const here = { eye: [3, 1.6, 8.2], yaw: 0, pitch: -0.05 };
const held = new Set();
const FOV = 1.1;

const facing = () => {
  const [cy, sy, cp, sp] = [Math.cos(here.yaw), Math.sin(here.yaw), Math.cos(here.pitch), Math.sin(here.pitch)];
  return [sy * cp, sp, -cy * cp];
};

function camera(aspect) {
  const forward = facing();
  const half = Math.tan(FOV / 2);
  const right = [Math.cos(here.yaw), 0, Math.sin(here.yaw)];
  const up = [
    right[1] * forward[2] - right[2] * forward[1],
    right[2] * forward[0] - right[0] * forward[2],
    right[0] * forward[1] - right[1] * forward[0],
  ];
  return { eye: here.eye, forward, right: right.map((c) => c * half * aspect), up: up.map((c) => c * half) };
}

const view = (width, height) => ({ eye: here.eye, target: here.eye.map((c, i) => c + facing()[i]), fov: FOV, width, height });

const MARGIN = 0.25;

function isFree([x, y, z]) {
  const inside = [x, y, z].every((c, i) => c > BOUNDS[0][i] + MARGIN && c < BOUNDS[1][i] - MARGIN);
  const inBox = BOXES.some(({ min, max }) => [x, y, z].every((c, i) => c > min[i] - MARGIN && c < max[i] + MARGIN));
  const inBall = Math.hypot(x - BALL.centre[0], y - BALL.centre[1], z - BALL.centre[2]) < BALL.radius + MARGIN;
  return inside && !inBox && !inBall;
}

/** Goes on for so many seconds; whether anything changed. */
function walk(seconds) {
  const has = (...names) => names.some((name) => held.has(name));
  const turn = (has("left") ? -1 : 0) + (has("right") ? 1 : 0);
  const ahead = (has("ahead") ? 1 : 0) - (has("back") ? 1 : 0);
  const aside = (has("step-right") ? 1 : 0) - (has("step-left") ? 1 : 0);
  here.yaw += 1.6 * turn * seconds;
  const [sy, cy] = [Math.sin(here.yaw), Math.cos(here.yaw)];
  const step = [(sy * ahead + cy * aside) * 1.8 * seconds, 0, (-cy * ahead + sy * aside) * 1.8 * seconds];
  // Along walls, if not through them.
  for (const only of [0, 2]) {
    const next = here.eye.map((c, i) => (i === only ? c + step[i] : c));
    if (isFree(next)) here.eye = next;
  }
  return turn !== 0 || ahead !== 0 || aside !== 0;
}

const KEYS = {
  ArrowUp: "ahead", ArrowDown: "back", ArrowLeft: "left", ArrowRight: "right",
  KeyW: "ahead", KeyS: "back", KeyA: "step-left", KeyD: "step-right",
};

canvas.addEventListener("keydown", (event) => {
  const name = KEYS[event.code];
  if (!name || event.ctrlKey || event.metaKey || event.altKey) return;
  event.preventDefault();
  held.add(name);
  redraw();
});
addEventListener("keyup", (event) => held.delete(KEYS[event.code]));
addEventListener("blur", () => held.clear());
for (const button of document.querySelectorAll("[data-walk]")) {
  const { walk: name } = button.dataset;
  const start = () => { held.add(name); redraw(); };
  const end = () => held.delete(name);
  button.addEventListener("pointerdown", start);
  for (const event of ["pointerup", "pointerleave", "pointercancel", "blur", "keyup"]) button.addEventListener(event, end);
  button.addEventListener("keydown", (event) => { if (event.code === "Enter" || event.code === "Space") start(); });
}
canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
canvas.addEventListener("pointermove", (event) => {
  if (!canvas.hasPointerCapture(event.pointerId)) return;
  here.yaw -= event.movementX * 0.004;
  here.pitch = Math.max(-1.2, Math.min(1.2, here.pitch + event.movementY * 0.004));
  moved();
});

// ---------------------------------------------------------------------------------------------
// Drawing

let renderer = null;
let isDirty = true;
let isRequested = false;
let last = 0;
/** Pixels of the canvas for one of the page: as many as the device draws in time. */
const SCALES = [0.12, Math.min(devicePixelRatio, 1.5)];
let scale = Math.max(SCALES[0], Math.min(SCALES[1], 160 / Math.max(canvas.clientWidth, 160)));
/** Set while the device is drawing; no frame begins before it is done, or they would queue up. */
let fence = null;
/** For who wants to know how the page is doing. */
const frames = { count: 0, firstLight: undefined };
globalThis.fogbowFrames = frames;

const mode = () => Number(document.querySelector("input[name=mode]:checked").value);

function redraw() {
  isDirty = true;
  if (renderer) keepGoing();
}

let movedAt = -Infinity;
/** Still pictures have more pixels than those of a walk, and than those before there is baked light: until then, the processor is to bake. */
const REST = 2.2;
const isMoving = (now) => held.size > 0 || now - movedAt < 400 || frames.firstLight === undefined;

function moved() {
  movedAt = performance.now();
  setTimeout(redraw, 450);
  truth.restart();
  redraw();
}

function frame(now) {
  isRequested = false;
  if (fence && !renderer.isDrawn(fence.sync)) return void keepGoing();
  if (fence) adapt(now - fence.began, fence.isMoving);
  fence = null;
  const wasWalking = now - last < 400;
  if (walk(wasWalking ? Math.min(0.25, (now - last) / 1000) : 1 / 60)) moved();
  last = now;
  if (!(isDirty || held.size) || element("panel-room").hidden) return;
  isDirty = false;
  const { clientWidth, clientHeight } = canvas;
  const own = isMoving(now) ? scale : Math.min(SCALES[1], REST * scale);
  const size = mode() === 0 ? [Math.round(clientWidth * own), Math.round(clientHeight * own)] : truth.size();
  const [width, height] = size.map((n) => Math.max(1, n));
  if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
  if (mode() !== 1 || truth.samples === 0) {
    renderer.marched(width, height, camera(width / height), settings(), { steps: 16, jitter: mode() === 0 ? 1 : 0 });
  }
  if (mode() === 2 && truth.samples > 0) truth.compare(renderer.read());
  renderer.shown(truth.samples === 0 ? 0 : mode(), truth.level);
  fence = { sync: renderer.fence(), began: now, isMoving: isMoving(now) };
  frames.count++;
  keepGoing();
}

function keepGoing() {
  if (isRequested) return;
  isRequested = true;
  requestAnimationFrame(frame);
}

/** Fewer pixels where frames take long, more where they do not. */
function adapt(milliseconds, isMoving) {
  if (mode() !== 0) return;
  const before = scale;
  if (milliseconds > (isMoving ? 45 : 250)) scale = Math.max(SCALES[0], scale * Math.max(0.5, Math.sqrt((isMoving ? 33 : 180) / milliseconds)));
  else if (milliseconds < 22) scale = Math.min(SCALES[1], scale * 1.25);
  if (scale > 1.1 * before) isDirty = true;
}

new ResizeObserver(() => moved()).observe(canvas);

// ---------------------------------------------------------------------------------------------
// Baking

/** Probes along the room: few at first, for quick light; then more. */
const COUNTS = [[6, 3, 9], [12, 6, 18]];
let workers = null;
let world = null;
/** Set while a bake goes on. */
let baking = null;
let bakes = 0;

async function bake() {
  baking?.abort();
  const own = new AbortController();
  baking = own;
  const { signal } = own;
  const now = settings();
  const made = [];
  try {
    const described = await workers.world(describe(now));
    made.push(described);
    if (signal.aborted) return;
    world?.free();
    world = described;
    made.length = 0;
    truth.restart();
    const began = performance.now();
    for (const [stage, counts] of COUNTS.entries()) {
      const isLast = stage === COUNTS.length - 1;
      const usual = { counts, orders: "indirect", directions: 8, error: isLast ? 0.05 : 0.2, passes: isLast ? 128 : 8 };
      const hasFog = now.density > 0 || now.smoke > 0;
      const fog = hasFog ? await workers.probes(described, { ...usual, degree: 2 }) : null;
      const surfaces = await workers.probes(described, { ...usual, degree: 1, quantity: "irradiance" });
      const both = fog ? [fog, surfaces] : [surfaces];
      made.push(...both);
      if (!(await refine({ signal, fog, surfaces, both, began, isLast }))) return;
    }
    bakes++;
    globalThis.fogbowBakes = bakes;
  } catch (error) {
    if (!signal.aborted) problem(error);
  } finally {
    if (baking === own) {
      baking = null;
      // What compares it says so.
      redraw();
    }
    for (const object of made) await object.free();
  }
}

/** Bakes both grids, and shows how far they are after each pass; whether to the end. */
async function refine({ signal, fog, surfaces, both, began, isLast }) {
  const state = new Map();
  let shownAt = 0;
  const show = async (isDone) => {
    // Whole passes only: bricks without any would be dark. And not fewer than the coarse ones have had.
    const all = [...state.values()];
    if (all.length < both.length || all.some(({ passes }) => passes < (isLast ? 4 : 1))) return;
    if (!isDone && performance.now() - shownAt < 250) return;
    shownAt = performance.now();
    const [a, b] = await Promise.all([fog?.textures(), surfaces.textures()]);
    if (signal.aborted) return;
    renderer.light(a, b);
    frames.firstLight ??= performance.now();
    redraw();
  };
  const run = (probes) => probes.bake({
    signal,
    onProgress({ done, of, error, share }) {
      const before = state.get(probes) ?? { passes: 0, done: 0 };
      const isWhole = done < before.done || done === of;
      state.set(probes, { passes: before.passes + (isWhole ? 1 : 0), done, error, share });
      tell(state, began, false);
      if (isWhole) show(false).catch((error) => signal.aborted || problem(error));
    },
  });
  const done = await Promise.all(both.map(run));
  if (!done.every(Boolean) || signal.aborted) return false;
  await show(true);
  if (isLast) tell(state, began, true);
  return !signal.aborted;
}

let told = 0;

function tell(state, began, isDone) {
  if (!isDone && performance.now() - told < 150) return;
  told = performance.now();
  const all = [...state.values()];
  const error = Math.max(...all.map((one) => one.error));
  element("progress").value = isDone ? 1 : Math.min(...all.map((one) => one.share));
  const text = Number.isFinite(error) ? `noise ${(100 * error).toFixed(1)} %` : "first light";
  element("baked").textContent = `${isDone ? "Done" : "Refining"}: ${text}, ${((performance.now() - began) / 1000).toFixed(1)} s, ${workers.count} worker${workers.count > 1 ? "s" : ""}`;
}

let asked = 0;

/** Sliders send many changes; a bake begins when they rest for a moment. */
function changed() {
  showValues();
  truth.restart();
  redraw();
  clearTimeout(asked);
  asked = setTimeout(() => bake(), 120);
  if (figures) figures.changed(settings());
}

for (const id of [...SLIDERS, "colour"]) element(id).addEventListener("input", changed);
for (const radio of document.querySelectorAll("input[name=mode]")) {
  radio.addEventListener("change", () => {
    canvas.width = 0;
    redraw();
    truth.run();
  });
}

// ---------------------------------------------------------------------------------------------
// The truth: samples of a small picture, one after the other.

const pause = (milliseconds) => new Promise((resolve) => setTimeout(resolve, milliseconds));

const truth = {
  samples: 0,
  level: 1,
  sums: null,
  generation: 0,
  isRunning: false,

  size() {
    const { clientWidth, clientHeight } = canvas;
    const width = Math.max(16, Math.round(Math.min(clientWidth, 640) / 4));
    return [width, Math.max(16, Math.round((width * clientHeight) / Math.max(clientWidth, 1)))];
  },

  restart() {
    this.generation++;
    this.samples = 0;
    this.run();
  },

  async run() {
    if (this.isRunning || mode() === 0 || !world) return;
    this.isRunning = true;
    try {
      while (mode() !== 0 && this.samples < 1024) {
        const [generation, size, traced, began] = [this.generation, this.size(), world, performance.now()];
        const light = await traced.pathTrace(view(...size), { first: this.samples, samples: 1 });
        if (generation !== this.generation) continue;
        this.add(light, size);
        redraw();
        // In turns with the bake, whose steps are far shorter: there may be but one worker for both.
        const turn = performance.now() - began;
        while (baking && generation === this.generation && performance.now() - began < 2 * turn) await pause(20);
      }
    } catch (error) {
      // A world that was freed under way: there is another by now.
      if (error.name !== "FogbowError") problem(error);
      setTimeout(() => this.run(), 50);
    } finally {
      this.isRunning = false;
    }
  },

  add(light, [width, height]) {
    if (this.samples === 0) [this.sums, this.means] = [new Float32Array(light.length), []];
    light.forEach((c, i) => { this.sums[i] += c; });
    this.means.push(light.reduce((a, b) => a + b, 0) / light.length);
    this.samples++;
    const picture = new Float32Array((light.length / 3) * 4);
    let sum = 0;
    for (let i = 0, o = 0; i < light.length; i += 3, o += 4) {
      for (let c = 0; c < 3; c++) picture[o + c] = this.sums[i + c] / this.samples;
      sum += picture[o] + picture[o + 1] + picture[o + 2];
    }
    this.level = sum / light.length;
    renderer.picture(renderer.truth, width, height, picture);
    if (mode() === 1) this.say(`Path tracing, ${this.samples} samples per pixel.`);
  },

  /** What the baked picture has more or less of. */
  compare(baked) {
    let sum = 0;
    for (let i = 0; i < baked.length; i += 4) sum += baked[i] + baked[i + 1] + baked[i + 2];
    const off = sum / ((baked.length / 4) * 3) / this.level - 1;
    [this.off, this.baked] = [off, baked];
    const n = this.samples;
    if (n < 4) return this.say(`The truth has ${n} sample${n > 1 ? "s" : ""} per pixel: too few to compare with.`);
    const error = Math.sqrt(this.means.reduce((sum, mean) => sum + (mean - this.level) ** 2, 0) / (n * (n - 1))) / this.level;
    const more = off >= 0 ? "brighter" : "darker";
    this.say(`Baked light${baking ? ", not yet done," : ""} is ${Math.abs(100 * off).toFixed(1)} % ± ${(100 * error).toFixed(1)} % ${more} on the whole (${n} samples). Orange: too bright; blue: too dark, means over some pixels; full colour at half of the mean light.`);
  },

  say(text) {
    element("compared").textContent = text;
  },
};
globalThis.fogbowTruth = truth;

// ---------------------------------------------------------------------------------------------
// Tabs

let figures = null;
const tabs = [...document.querySelectorAll("[role=tab]")];

async function select(tab) {
  for (const other of tabs) {
    const isChosen = other === tab;
    other.setAttribute("aria-selected", String(isChosen));
    other.tabIndex = isChosen ? 0 : -1;
    element(other.getAttribute("aria-controls")).hidden = !isChosen;
  }
  if (tab.id === "tab-mathematics") {
    figures ??= await mathematics(element, () => here.eye).catch(problem);
    figures?.changed(settings());
  } else {
    redraw();
  }
}

tabs.forEach((tab, i) => {
  tab.addEventListener("click", () => select(tab));
  tab.addEventListener("keydown", (event) => {
    const way = { ArrowRight: 1, ArrowLeft: -1 }[event.code];
    if (!way) return;
    const next = tabs[(i + way + tabs.length) % tabs.length];
    next.focus();
    select(next);
  });
});

// ---------------------------------------------------------------------------------------------

async function draw() {
  const response = await fetch(new URL("./fog.glsl", import.meta.url));
  renderer = new Renderer(canvas, await response.text());
  redraw();
}

showValues();
try {
  const count = Math.max(1, Math.min(3, (navigator.hardwareConcurrency ?? 2) - 1));
  // The module is compiled while the shaders are.
  [workers] = await Promise.all([Workers.start({ count }), draw()]);
  await bake();
} catch (error) {
  problem(error);
}
