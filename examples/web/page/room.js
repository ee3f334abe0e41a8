// The room: as a world for the library, and as a few boxes for the shader. One list for both.

import { Light, Medium, Scene } from "./fogbow/fogbow.js";

export const BOUNDS = [[0, 0, 0], [6, 3, 9]];

/** Boxes that stand in the room: corners and colour. */
export const BOXES = [
  { min: [1.4, 0, 2.6], max: [1.8, 3, 3.0], colour: [0.62, 0.58, 0.5] },
  { min: [4.2, 0, 2.6], max: [4.6, 3, 3.0], colour: [0.62, 0.58, 0.5] },
  { min: [1.4, 0, 5.6], max: [1.8, 3, 6.0], colour: [0.62, 0.58, 0.5] },
  { min: [4.2, 0, 5.6], max: [4.6, 3, 6.0], colour: [0.62, 0.58, 0.5] },
  { min: [2.5, 0, 0.8], max: [3.5, 0.7, 1.6], colour: [0.45, 0.3, 0.2] },
];

export const BALL = { centre: [3.1, 0.5, 4.4], radius: 0.5, colour: [0.25, 0.4, 0.65] };

/** Walls: low x, high x, floor, ceiling, back, front. */
export const WALLS = [
  [0.65, 0.25, 0.2],
  [0.3, 0.55, 0.3],
  [0.4, 0.37, 0.33],
  [0.7, 0.7, 0.7],
  [0.7, 0.68, 0.6],
  [0.6, 0.6, 0.65],
];

export const LAMP_RADIUS = 0.12;

/** The smoke: a billow in the middle of the room. */
export const SMOKE = { min: [1.9, 0.2, 3.0], max: [4.1, 2.8, 5.8], size: [24, 28, 30] };

function hash(x, y, z) {
  let h = Math.imul(x, 73856093) ^ Math.imul(y, 19349663) ^ Math.imul(z, 83492791);
  h = Math.imul(h ^ (h >>> 15), 2246822519);
  h = Math.imul(h ^ (h >>> 13), 3266489917);
  return ((h ^ (h >>> 16)) >>> 0) / 2 ** 32;
}

function noise(x, y, z) {
  const [i, j, k] = [Math.floor(x), Math.floor(y), Math.floor(z)];
  let sum = 0;
  for (let c = 0; c < 8; c++) {
    const [a, b, d] = [c & 1, (c >> 1) & 1, c >> 2];
    sum += (a ? x - i : 1 - x + i) * (b ? y - j : 1 - y + j) * (d ? z - k : 1 - z + k) * hash(i + a, j + b, k + d);
  }
  return sum;
}

/** Densities of the smoke as bytes: none at its borders. */
export const smokeDensity = (() => {
  const [nx, ny, nz] = SMOKE.size;
  const cells = new Uint8Array(nx * ny * nz);
  for (let z = 0, o = 0; z < nz; z++) {
    for (let y = 0; y < ny; y++) {
      for (let x = 0; x < nx; x++, o++) {
        const far = Math.hypot((2 * x + 1) / nx - 1, (2 * y + 1) / ny - 1, (2 * z + 1) / nz - 1);
        const billow = noise(x / 5, y / 5, z / 5) + 0.5 * noise(x / 2.5, y / 2.5, z / 2.5) - 0.75;
        cells[o] = 255 * Math.max(0, Math.min(1, 1.6 * (1 - far) + 1.4 * billow - 0.1)) * (far < 0.95 ? 1 : 0);
      }
    }
  }
  return cells;
})();

/** Extinction of the smoke where density is 1 (m⁻¹), for a slider from 0 to 1. */
export const smokeExtinction = (smoke) => 6 * smoke;

/** The light of the lamp (W·sr⁻¹) for a brightness and a colour. */
export const intensity = ({ colour }) => colour.map((c) => 12 * c);

/** The world for these settings. */
export function describe(settings) {
  const { density, albedo, g, smoke, lamp } = settings;
  const scene = new Scene();
  const [min, max] = BOUNDS;
  const size = max.map((m, i) => m - min[i]);
  const axis = (i, length = size[i]) => [0, 1, 2].map((k) => (k === i ? length : 0));
  WALLS.forEach((colour, wall) => {
    const i = wall >> 1;
    const [j, k] = [(i + 1) % 3, (i + 2) % 3];
    const corner = min.map((m, n) => (n === i && wall & 1 ? max[n] : m));
    scene.quad(corner, axis(j), axis(k), { reflectance: colour });
  });
  for (const { min: low, max: high, colour } of BOXES) scene.block([low, high], { reflectance: colour });
  scene.sphere(BALL.centre, BALL.radius, { reflectance: BALL.colour, twoSided: false });
  const matter = (extinction) => ({ scattering: extinction * albedo, absorption: extinction * (1 - albedo), g });
  const media = [];
  if (density > 0) media.push(Medium.homogeneous({ ...matter(density), box: BOUNDS }));
  if (smoke > 0) {
    media.push(Medium.grid({ ...matter(smokeExtinction(smoke)), size: SMOKE.size, density: smokeDensity, box: [SMOKE.min, SMOKE.max] }));
  }
  // As bright from afar as a point of this intensity.
  const radiance = intensity(settings).map((c) => c / (Math.PI * LAMP_RADIUS ** 2));
  const light = Light.sphere({ centre: lamp, radius: LAMP_RADIUS, radiance });
  return { media, scene, lights: [light], bounds: BOUNDS };
}
