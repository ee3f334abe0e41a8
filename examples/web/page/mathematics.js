// The second tab: one record, covariances, a virtual light; live, by the library.

import { World, init } from "./fogbow/fogbow.js";
import { BOUNDS, describe } from "./room.js";

const [WIDTH, HEIGHT] = [480, 320];
// The room is 9 m long and 6 m wide: a slice at the height of the eye, its long side across the picture.
const [LOW, HIGH] = BOUNDS;
const across = (x) => LOW[2] + (x / WIDTH) * (HIGH[2] - LOW[2]);
const along = (y) => LOW[0] + (y / HEIGHT) * (HIGH[0] - LOW[0]);
const left = (z) => ((z - LOW[2]) / (HIGH[2] - LOW[2])) * WIDTH;
const top = (x) => ((x - LOW[0]) / (HIGH[0] - LOW[0])) * HEIGHT;
const METRE = WIDTH / (HIGH[2] - LOW[2]);
const CELLS = [120, 80];

const mean = (colours, i) => (colours[i] + colours[i + 1] + colours[i + 2]) / 3;

/** Light as a colour: black, violet, orange, white; logarithmic over three decades. */
function shade(light, most) {
  const t = Math.max(0, Math.min(1, 1 + Math.log10(Math.max(light, 1e-12) / most) / 3));
  return [255 * Math.min(1, 1.8 * t), 255 * Math.max(0, 1.5 * t - 0.4), 255 * (t < 0.5 ? 0.9 * t : Math.max(0.45, 2.2 * t - 1.2))];
}

function paint(context, colours, [x, y, width, height]) {
  const [nx, ny] = CELLS;
  const image = new ImageData(nx, ny);
  for (let i = 0; i < nx * ny; i++) image.data.set([...colours(i), 255], 4 * i);
  const small = new OffscreenCanvas(nx, ny);
  small.getContext("2d").putImageData(image, 0, 0);
  context.imageSmoothingEnabled = true;
  context.drawImage(small, x, y, width, height);
}

export async function mathematics(element, eye) {
  await init();
  const TO_EYE = [0, 1, 0];
  let world = null;
  let now = null;
  let at = [2.3, 3.9];
  let slice = null;
  let most = 1;
  let waiting = 0;

  const points = (y) => {
    const [nx, ny] = CELLS;
    const all = new Float32Array(3 * nx * ny);
    for (let j = 0, o = 0; j < ny; j++) {
      for (let i = 0; i < nx; i++, o += 3) {
        all.set([along(((j + 0.5) / ny) * HEIGHT), y, across(((i + 0.5) / nx) * WIDTH)], o);
      }
    }
    return all;
  };

  function drawRecord() {
    const canvas = element("record");
    const context = canvas.getContext("2d");
    const height = eye()[1];
    const record = world.record([at[0], height, at[1]], TO_EYE, { tolerance: element("tolerance").valueAsNumber, least: 0.02, most: 3 });
    const value = mean(record.value, 0);
    const slope = record.gradient.map((colour) => mean(colour, 0));
    const told = (x, z) => value * Math.exp((slope[0] * (x - at[0]) + slope[2] * (z - at[1])) / Math.max(value, 1e-20));
    const [nx, ny] = CELLS;
    paint(context, (i) => {
      const [x, z] = [along(((Math.floor(i / nx) + 0.5) / ny) * HEIGHT), across((((i % nx) + 0.5) / nx) * WIDTH)];
      const isNear = Math.hypot(x - at[0], z - at[1]) < record.radius;
      return shade(isNear ? told(x, z) : slice[i], most);
    }, [0, 0, WIDTH, HEIGHT]);
    const [cx, cy] = [left(at[1]), top(at[0])];
    context.lineWidth = 2;
    context.strokeStyle = "#7fffd4";
    context.beginPath();
    context.arc(cx, cy, Math.max(2, record.radius * METRE), 0, 2 * Math.PI);
    context.stroke();
    const steepness = Math.hypot(slope[0], slope[2]);
    if (steepness > 0) {
      const length = 12 + 30 * Math.min(1, steepness / Math.max(value, 1e-20) / 2);
      const [dx, dy] = [(slope[2] / steepness) * length, (slope[0] / steepness) * length];
      context.beginPath();
      context.moveTo(cx, cy);
      context.lineTo(cx + dx, cy + dy);
      context.lineTo(cx + 0.75 * dx - 0.15 * dy, cy + 0.75 * dy + 0.15 * dx);
      context.moveTo(cx + dx, cy + dy);
      context.lineTo(cx + 0.75 * dx + 0.15 * dy, cy + 0.75 * dy - 0.15 * dx);
      context.stroke();
    }
    element("record-values").textContent = `radius ${record.radius.toFixed(2)} m, value ${value.toPrecision(3)}, gradient ${steepness.toPrecision(3)} per metre`;
  }

  function drawCovariances() {
    const canvas = element("covariance");
    const context = canvas.getContext("2d");
    const { size, covariances } = world.covariances({ edge: 18, photons: 4000 });
    const layer = Math.min(size[1] - 1, Math.floor((eye()[1] / HIGH[1]) * size[1]));
    paint(context, (i) => shade(slice[i], most * 4), [0, 0, WIDTH, HEIGHT]);
    context.strokeStyle = "#7fffd4";
    context.lineWidth = 1.25;
    const cells = [];
    for (let k = 0; k < size[2]; k++) {
      for (let i = 0; i < size[0]; i++) {
        const cell = 6 * (i + size[0] * (layer + size[1] * k));
        const [xx, , xz, , , zz] = covariances.subarray(cell, cell + 6);
        if (!(xx + zz > 0)) continue;
        // Principal axes in the slice: light stays alike over about 1/(2π σ) along each.
        const [middle, spread] = [(xx + zz) / 2, Math.hypot((xx - zz) / 2, xz)];
        const reach = [middle + spread, middle - spread].map((c) => 1 / (2 * Math.PI * Math.sqrt(Math.max(c, 1e-6))));
        const angle = 0.5 * Math.atan2(2 * xz, zz - xx);
        cells.push({ centre: [left(((k + 0.5) / size[2]) * HIGH[2]), top(((i + 0.5) / size[0]) * HIGH[0])], reach, angle });
      }
    }
    // The longer axis of most of them fits into a cell; all are drawn to that scale.
    const longest = cells.map(({ reach }) => reach[1]).sort((a, b) => a - b)[Math.floor(0.8 * cells.length)];
    const cellSize = METRE * (HIGH[2] / size[2]);
    for (const { centre, reach, angle } of cells) {
      // The first axis is that along which light varies most.
      const radii = reach.map((r) => Math.max(1, 0.48 * cellSize * Math.min(1, r / longest)));
      context.beginPath();
      context.ellipse(...centre, ...radii, angle, 0, 2 * Math.PI);
      context.stroke();
    }
    const shortest = Math.min(...cells.map(({ reach }) => reach[0]));
    element("covariance-values").textContent = cells.length
      ? `${cells.length} cells; light stays alike over ${(100 * shortest).toFixed(0)} cm at least, and ${(100 * longest).toFixed(0)} cm where a cell is full`
      : "no light here";
  }

  function drawVirtual() {
    const canvas = element("virtual");
    const context = canvas.getContext("2d");
    const height = eye()[1];
    const within = element("bound").valueAsNumber;
    const to = (from, target) => {
      const way = target.map((c, i) => c - from[i]);
      const length = Math.hypot(...way);
      return way.map((c) => c / length);
    };
    // In a corner of the cells: in a centre, one point would have nearly all of the light.
    const position = [3.75, height, 4.95];
    // Towards where its light came from: the lamp.
    const light = { position, incoming: to(position, now.lamp), flux: 1, bound: 1 / within ** 2, eye: [3, height + 20, 5] };
    const { clamped, all } = world.virtualLight(light, points(height));
    let brightest = 1e-12;
    let [kept, whole] = [0, 0];
    for (let i = 0; i < all.length; i += 3) {
      brightest = Math.max(brightest, mean(clamped, i));
      kept += mean(clamped, i);
      whole += mean(all, i);
    }
    paint(context, (i) => shade(mean(clamped, 3 * i), brightest), [0, 0, WIDTH / 2 - 2, HEIGHT / 2]);
    paint(context, (i) => shade(mean(all, 3 * i) - mean(clamped, 3 * i), brightest), [WIDTH / 2 + 2, 0, WIDTH / 2 - 2, HEIGHT / 2]);
    // Along the line through the light: all of it, and where it is clamped.
    const count = 240;
    const line = Float32Array.from({ length: 3 * count }, (_, i) => [position[0], height, across(((Math.floor(i / 3) + 0.5) / count) * WIDTH)][i % 3]);
    const on = world.virtualLight(light, line);
    context.fillStyle = "#101216";
    context.fillRect(0, HEIGHT / 2 + 2, WIDTH, HEIGHT / 2 - 2);
    const highest = Math.max(1e-12, ...Array.from({ length: count }, (_, i) => mean(on.all, 3 * i)));
    const curve = (values, colour) => {
      context.strokeStyle = colour;
      context.lineWidth = 2;
      context.beginPath();
      for (let i = 0; i < count; i++) {
        const t = Math.max(0, 1 + Math.log10(Math.max(mean(values, 3 * i), 1e-20) / highest) / 5);
        context.lineTo(((i + 0.5) / count) * WIDTH, HEIGHT - 8 - t * (HEIGHT / 2 - 40));
      }
      context.stroke();
    };
    curve(on.all, "#ffb45c");
    curve(on.clamped, "#7fffd4");
    context.fillStyle = "#ffffff";
    context.font = "13px system-ui, sans-serif";
    context.fillText("clamped", 8, 18);
    context.fillText("compensated", WIDTH / 2 + 10, 18);
    context.fillText("along the line through it: all light (orange), clamped (green)", 8, HEIGHT / 2 + 18);
    element("virtual-values").textContent = whole > 0 ? `clamping takes ${(100 * (1 - kept / whole)).toFixed(0)} % of the light on this slice` : "there is no fog";
  }

  function all() {
    world?.free();
    // Figures of fog need some.
    const shown = { ...now, density: Math.max(now.density, 0.02) };
    world = new World(describe(shown));
    const places = points(eye()[1]);
    const directions = new Float32Array(places.length).map((_, i) => TO_EYE[i % 3]);
    const once = world.scatteredOnce(places, directions);
    slice = Float32Array.from({ length: places.length / 3 }, (_, i) => mean(once, 3 * i));
    const sorted = [...slice].sort((a, b) => a - b);
    most = Math.max(1e-9, sorted[Math.floor(0.99 * sorted.length)]);
    drawRecord();
    drawCovariances();
    drawVirtual();
  }

  const canvas = element("record");
  const move = (x, z) => {
    at = [Math.max(LOW[0] + 0.05, Math.min(HIGH[0] - 0.05, x)), Math.max(LOW[2] + 0.05, Math.min(HIGH[2] - 0.05, z))];
    drawRecord();
  };
  canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
  for (const kind of ["pointerdown", "pointermove"]) {
    canvas.addEventListener(kind, (event) => {
      if (kind === "pointermove" && !canvas.hasPointerCapture(event.pointerId)) return;
      const box = canvas.getBoundingClientRect();
      move(along(((event.clientY - box.top) / box.height) * HEIGHT), across(((event.clientX - box.left) / box.width) * WIDTH));
    });
  }
  canvas.addEventListener("keydown", (event) => {
    const way = { ArrowUp: [-0.1, 0], ArrowDown: [0.1, 0], ArrowLeft: [0, -0.1], ArrowRight: [0, 0.1] }[event.code];
    if (!way) return;
    event.preventDefault();
    move(at[0] + way[0], at[1] + way[1]);
  });
  element("tolerance").addEventListener("input", drawRecord);
  element("bound").addEventListener("input", drawVirtual);

  return {
    changed(settings) {
      now = settings;
      if (element("panel-mathematics").hidden) return;
      clearTimeout(waiting);
      waiting = setTimeout(all, world ? 100 : 0);
    },
  };
}
