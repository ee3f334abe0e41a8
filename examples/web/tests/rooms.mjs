// Worlds of the tests: a box of smoke, and a hall with columns into which the sun shines.

/** Smoke: values of a hash on a coarse lattice, mixed in between. */
export function smokeDensity(n) {
  const hash = (x, y, z) => {
    let h = Math.imul(x, 73856093) ^ Math.imul(y, 19349663) ^ Math.imul(z, 83492791);
    h = Math.imul(h ^ (h >>> 15), 2246822519);
    h = Math.imul(h ^ (h >>> 13), 3266489917);
    return ((h ^ (h >>> 16)) >>> 0) / 2 ** 32;
  };
  const noise = (x, y, z) => {
    const [i, j, k] = [x, y, z].map(Math.floor);
    let sum = 0;
    for (let c = 0; c < 8; c++) {
      const [a, b, d] = [c & 1, (c >> 1) & 1, c >> 2];
      const weight = (a ? x - i : 1 - x + i) * (b ? y - j : 1 - y + j) * (d ? z - k : 1 - z + k);
      sum += weight * hash(i + a, j + b, k + d);
    }
    return sum;
  };
  const density = new Float32Array(n ** 3);
  for (let z = 0, o = 0; z < n; z++) {
    for (let y = 0; y < n; y++) {
      for (let x = 0; x < n; x++, o++) {
        const value = noise(x / 8, y / 8, z / 8) + 0.5 * noise(x / 4, y / 4, z / 4);
        density[o] = Math.max(0, 2.5 * (value - 0.65));
      }
    }
  }
  return density;
}

export function smokeBox({ Medium, Scene, Light }) {
  const box = [[-1, -1, -1], [1, 1, 1]];
  const white = { reflectance: 0.7 };
  const scene = new Scene()
    .quad([-1, -1, -1], [2, 0, 0], [0, 0, 2], white)
    .quad([-1, 1, -1], [0, 0, 2], [2, 0, 0], white)
    .quad([-1, -1, -1], [0, 2, 0], [2, 0, 0], white)
    .quad([-1, -1, -1], [0, 0, 2], [0, 2, 0], { reflectance: [0.6, 0.1, 0.1] })
    .quad([1, -1, -1], [0, 2, 0], [0, 0, 2], { reflectance: [0.1, 0.5, 0.1] });
  const smoke = Medium.grid({ size: [32, 32, 32], density: smokeDensity(32), scattering: 3.8, absorption: 0.2, box });
  const lamp = Light.quad({ corner: [-0.25, 0.99, -0.25], edgeU: [0.5, 0, 0], edgeV: [0, 0, 0.5], radiance: [17, 15, 12] });
  return {
    world: { media: [smoke], scene, lights: [lamp] },
    view: { eye: [0, 0, 4], target: [0, 0, 0], fov: 0.6, width: 64, height: 64 },
    probes: { counts: [8, 8, 8], error: 0.1, passes: 24 },
  };
}

export function atrium({ Medium, Scene, Light }) {
  const box = [[0, 0, 0], [8, 5, 12]];
  const stone = { reflectance: [0.6, 0.55, 0.45] };
  const scene = new Scene()
    .quad([0, 0, 0], [0, 0, 12], [8, 0, 0], { reflectance: [0.35, 0.3, 0.28] })
    .quad([0, 0, 0], [0, 5, 0], [0, 0, 12], stone)
    .quad([8, 0, 0], [0, 0, 12], [0, 5, 0], stone)
    .quad([0, 0, 0], [8, 0, 0], [0, 5, 0], stone)
    .quad([0, 0, 12], [0, 5, 0], [8, 0, 0], stone);
  // A roof of beams, open in between.
  for (let z = 0; z < 12; z += 2) scene.quad([0, 5, z], [8, 0, 0], [0, 0, 1.25], stone);
  // Columns of eight sides, by triangles.
  const side = Math.SQRT1_2;
  const ring = [[1, 0], [side, side], [0, 1], [-side, side], [-1, 0], [-side, -side], [0, -1], [side, -side]];
  for (const x of [2, 6]) {
    for (let z = 2; z < 12; z += 4) {
      const positions = ring.flatMap(([a, b]) => [x + 0.3 * a, 0, z + 0.3 * b, x + 0.3 * a, 5, z + 0.3 * b]);
      const indices = ring.flatMap((_, i) => [2 * i, 2 * i + 1, (2 * i + 2) % 16, (2 * i + 2) % 16, 2 * i + 1, (2 * i + 3) % 16]);
      scene.triangles(positions, indices, stone);
    }
  }
  scene.sphere([4, 0.8, 6], 0.8, { reflectance: [0.2, 0.35, 0.6] });
  const haze = Medium.homogeneous({ scattering: 0.08, absorption: 0.01, g: 0.6, box });
  const sun = Light.sun({ toLight: [0.36, 0.8, 0.48], irradiance: [30, 27, 22] });
  return {
    world: { media: [haze], scene, lights: [sun, Light.sky({ radiance: [0.4, 0.6, 1] })], bounds: box },
    view: { eye: [4, 1.7, 11], target: [4, 2, 0], fov: 1.1, width: 64, height: 64 },
    probes: { counts: [8, 5, 12], error: 0.1, passes: 16 },
  };
}
