// What a world is made of, as plain data, and as the words that the module reads. Nothing here needs the module.

const F = new Float32Array(1);
const U = new Uint32Array(F.buffer);

/** 32-bit words, to be handed to the module. */
export class Words {
  #words = [];
  #parts = [];

  integer(value, name) {
    if (!Number.isInteger(value) || value < 0 || value > 0xffffffff) {
      throw new TypeError(`${name} must be an integer from 0 to 2^32 - 1, not ${value}`);
    }
    this.#words.push(value);
    return this;
  }

  float(value, name) {
    if (typeof value !== "number") throw new TypeError(`${name} must be a number, not ${value}`);
    F[0] = value;
    this.#words.push(U[0]);
    return this;
  }

  vector(value, name) {
    if (value?.length !== 3) throw new TypeError(`${name} must be three numbers`);
    for (let i = 0; i < 3; i++) this.float(value[i], name);
    return this;
  }

  /** A number for all three channels, or one for each. */
  colour(value, name) {
    return this.vector(typeof value === "number" ? [value, value, value] : value, name);
  }

  /** A typed array of four-byte elements, or bytes that are filled up to words. */
  array(value) {
    this.#flush();
    if (value.BYTES_PER_ELEMENT === 4) {
      this.#parts.push(new Uint32Array(value.buffer, value.byteOffset, value.length));
    } else {
      const bytes = new Uint8Array(Math.ceil(value.length / 4) * 4);
      bytes.set(value);
      this.#parts.push(new Uint32Array(bytes.buffer));
    }
    return this;
  }

  append(words) {
    return this.array(words);
  }

  #flush() {
    if (this.#words.length) this.#parts.push(Uint32Array.from(this.#words));
    this.#words = [];
  }

  done() {
    this.#flush();
    const all = new Uint32Array(this.#parts.reduce((sum, part) => sum + part.length, 0));
    let at = 0;
    for (const part of this.#parts) {
      all.set(part, at);
      at += part.length;
    }
    return all;
  }
}

export function typed(value, Type, name) {
  if (value instanceof Type) return value;
  if (Array.isArray(value)) return Type.from(value);
  throw new TypeError(`${name} must be a ${Type.name} or an array`);
}

function lobe({ phase = "henyey-greenstein", g = 0, k = 0, alpha = 0 }) {
  switch (phase) {
    case "henyey-greenstein": return g === 0 ? [0, 0, 0] : [1, g, 0];
    case "schlick": return [2, k, 0];
    case "rayleigh": return [3, 0, 0];
    case "draine": return [4, g, alpha];
    default: throw new TypeError(`there is no phase function "${phase}"`);
  }
}

function place(words, { box, sphere }, isBox) {
  if (box && !sphere) {
    if (box.length !== 2) throw new TypeError("box must be two corners");
    words.integer(0, "place").vector(box[0], "box[0]").vector(box[1], "box[1]");
  } else if (sphere && !box && !isBox) {
    words.integer(1, "place").vector(sphere.centre, "sphere.centre").float(sphere.radius, "sphere.radius");
  } else {
    throw new TypeError(isBox ? "a grid needs a box" : "a medium needs either a box or a sphere");
  }
}

function matter(kind, options, isBox = false) {
  const { absorption = 0, scattering = 0, emission = 0 } = options;
  const words = new Words().integer(kind, "kind");
  words.colour(absorption, "absorption").colour(scattering, "scattering").colour(emission, "emission");
  words.vector(lobe(options), "phase");
  place(words, options, isBox);
  return words;
}

/** A participating medium and where it is. */
export class Medium {
  constructor(words) {
    this.words = words;
    Object.freeze(this);
  }

  static homogeneous(options) {
    return new Medium(matter(0, options).done());
  }

  static grid(options) {
    const { size, density } = options;
    if (size?.length !== 3) throw new TypeError("size must be three integers");
    const isBytes = density instanceof Uint8Array || density instanceof Uint8ClampedArray;
    const cells = isBytes ? density : typed(density, Float32Array, "density");
    if (cells.length !== size[0] * size[1] * size[2]) {
      throw new RangeError(`density has ${cells.length} cells, and size says ${size.join(" x ")}`);
    }
    const words = matter(isBytes ? 2 : 1, options, true);
    for (const n of size) words.integer(n, "size");
    return new Medium(words.array(cells).done());
  }

  static noise(options) {
    const { frequency = 1, octaves = 3, lacunarity = 2, gain = 0.5, offset = 0.5, amplitude = 1, maxDensity = 1, seed = 0 } = options;
    const words = matter(3, options).float(frequency, "frequency").integer(octaves, "octaves");
    words.float(lacunarity, "lacunarity").float(gain, "gain").float(offset, "offset");
    words.float(amplitude, "amplitude").float(maxDensity, "maxDensity").integer(seed, "seed");
    return new Medium(words.done());
  }
}

const KINDS = { lambert: 0, phong: 1, mirror: 2, glass: 3, null: 4 };

/** Surfaces: triangles, quadrilaterals and spheres. */
export class Scene {
  #materials = [];
  #vertices = [];
  #vertexCount = 0;
  #triangles = [];
  #triangleCount = 0;
  #quads = new Words();
  #quadCount = 0;
  #spheres = new Words();
  #sphereCount = 0;

  #material(options = {}) {
    const { kind = "lambert", reflectance = 0.5, specular = 0, exponent = 10, transmittance = 1, eta = 1.5, twoSided = true } = options;
    if (!(kind in KINDS)) throw new TypeError(`there is no surface "${kind}"`);
    const words = new Words().integer(KINDS[kind], "kind").integer(twoSided ? 2 : 1, "sides");
    const first = options.reflectance === undefined && (kind === "glass" || kind === "mirror") ? 1 : reflectance;
    words.colour(kind === "null" ? 0 : first, "reflectance");
    words.colour(kind === "phong" ? specular : kind === "glass" ? transmittance : 0, kind === "phong" ? "specular" : "transmittance");
    words.float(kind === "phong" ? exponent : kind === "glass" ? eta : 0, kind === "phong" ? "exponent" : "eta");
    this.#materials.push(words.done());
    return this.#materials.length - 1;
  }

  triangles(positions, indices, material) {
    const vertices = typed(positions, Float32Array, "positions");
    if (vertices.length % 3) throw new RangeError("positions are three numbers for each vertex");
    const corners = indices === null || indices === undefined
      ? Uint32Array.from({ length: vertices.length / 3 }, (_, i) => i)
      : typed(indices, Uint32Array, "indices");
    if (corners.length % 3) throw new RangeError("indices are three for each triangle");
    const own = this.#material(material);
    const quadruples = new Uint32Array((corners.length / 3) * 4);
    for (let i = 0, o = 0; i < corners.length; i += 3) {
      for (let k = 0; k < 3; k++) {
        if (corners[i + k] >= vertices.length / 3) {
          throw new RangeError(`triangle ${i / 3}: vertex ${corners[i + k]} is none of ${vertices.length / 3}`);
        }
        quadruples[o++] = corners[i + k] + this.#vertexCount;
      }
      quadruples[o++] = own;
    }
    this.#vertices.push(vertices.slice());
    this.#vertexCount += vertices.length / 3;
    this.#triangles.push(quadruples);
    this.#triangleCount += corners.length / 3;
    return this;
  }

  quad(corner, edgeU, edgeV, material) {
    this.#quads.vector(corner, "corner").vector(edgeU, "edgeU").vector(edgeV, "edgeV").integer(this.#material(material), "material");
    this.#quadCount++;
    return this;
  }

  sphere(centre, radius, material) {
    this.#spheres.vector(centre, "centre").float(radius, "radius").integer(this.#material(material), "material");
    this.#sphereCount++;
    return this;
  }

  /** Six walls, seen from within. */
  room(box, material) {
    return this.#sides(box, material, true);
  }

  /** A solid block, seen from outside. */
  block(box, material) {
    return this.#sides(box, { twoSided: false, ...material }, false);
  }

  #sides([min, max], material, isRoom) {
    const axis = (i) => [0, 1, 2].map((k) => (k === i ? max[i] - min[i] : 0));
    for (let i = 0; i < 3; i++) {
      const edges = [axis((i + 1) % 3), axis((i + 2) % 3)];
      const back = [edges[1], edges[0]];
      this.quad(min, ...(isRoom ? edges : back), material);
      this.quad(Object.assign([...min], { [i]: max[i] }), ...(isRoom ? back : edges), material);
    }
    return this;
  }

  get words() {
    const words = new Words().integer(this.#materials.length, "materials");
    for (const material of this.#materials) words.append(material);
    words.integer(this.#vertexCount, "vertices");
    for (const part of this.#vertices) words.array(part);
    words.integer(this.#triangleCount, "triangles");
    for (const part of this.#triangles) words.array(part);
    const quads = this.#quads.done();
    const spheres = this.#spheres.done();
    return words.integer(this.#quadCount, "quads").append(quads).integer(this.#sphereCount, "spheres").append(spheres).done();
  }
}

/** What shines. */
export class Light {
  constructor(words) {
    this.words = words;
    Object.freeze(this);
  }

  static #of(kind, light, name) {
    return new Words().integer(kind, "kind").colour(light, name);
  }

  static point({ position, intensity, flux }) {
    const sr = 4 * Math.PI;
    const light = intensity ?? (typeof flux === "number" ? flux / sr : flux?.map((c) => c / sr));
    return new Light(Light.#of(0, light, "intensity or flux").vector(position, "position").done());
  }

  static spot({ position, axis, beam, cutoff, intensity }) {
    const words = Light.#of(1, intensity, "intensity").vector(position, "position").vector(axis, "axis");
    return new Light(words.float(beam, "beam").float(cutoff, "cutoff").done());
  }

  static sun({ toLight, irradiance }) {
    return new Light(Light.#of(2, irradiance, "irradiance").vector(toLight, "toLight").done());
  }

  static quad({ corner, edgeU, edgeV, radiance }) {
    const words = Light.#of(3, radiance, "radiance").vector(corner, "corner");
    return new Light(words.vector(edgeU, "edgeU").vector(edgeV, "edgeV").done());
  }

  static sphere({ centre, radius, radiance }) {
    return new Light(Light.#of(4, radiance, "radiance").vector(centre, "centre").float(radius, "radius").done());
  }

  static sky({ radiance }) {
    return new Light(Light.#of(5, radiance, "radiance").done());
  }
}

const WORLD_VERSION = 1;

/** The words of a world. */
export function worldWords({ media = [], scene = new Scene(), lights = [], bounds }) {
  const words = new Words().integer(WORLD_VERSION, "version");
  words.vector(bounds ? bounds[0] : [NaN, NaN, NaN], "bounds[0]").vector(bounds ? bounds[1] : [0, 0, 0], "bounds[1]");
  words.integer(media.length, "media");
  for (const medium of media) words.append(medium.words);
  words.append(scene.words).integer(lights.length, "lights");
  for (const light of lights) words.append(light.words);
  return words.done();
}

/** The words of a view. */
export function viewWords({ eye, target, up = [0, 1, 0], fov = Math.PI / 3, width, height }, words = new Words()) {
  words.vector(eye, "view.eye").vector(target, "view.target").vector(up, "view.up").float(fov, "view.fov");
  return words.integer(width, "view.width").integer(height, "view.height");
}

/** The words of a part of a picture. */
export function pictureWords(view, { x = 0, y = 0, width, height, first = 0, samples = 1, seed = 0 } = {}) {
  const words = viewWords(view).integer(x, "x").integer(y, "y");
  words.integer(width ?? view.width - x, "width").integer(height ?? view.height - y, "height");
  return words.integer(first, "first").integer(samples, "samples").integer(seed, "seed").done();
}

/** The words of caches. */
export function cachesWords({ error = 0.02, walks = 0, rays = 0, seed = 0, single = false, view, box }) {
  const words = new Words().float(error, "error").integer(walks, "walks").integer(rays, "rays").integer(seed, "seed");
  return askedWords({ view, box }, words.integer(single ? 1 : 0, "single"));
}

/** The words of where light is asked for. */
export function askedWords({ view, box }, words = new Words()) {
  if (!view === !box) throw new TypeError("caches are asked for either a view or a box");
  if (view) return viewWords(view, words.integer(1, "asked")).done();
  if (box.length !== 2) throw new TypeError("box must be two corners");
  return words.integer(0, "asked").vector(box[0], "box[0]").vector(box[1], "box[1]").done();
}

const ORDERS = { all: 0, indirect: 1, multiple: 2 };
const QUANTITIES = { "in-scattered": 0, irradiance: 1 };

/** The words of probes. */
export function probesWords({ box, counts, degree = 2, orders = "all", quantity = "in-scattered", error = 0.02, directions = 0, passes = 0, seed = 0 }) {
  if (counts?.length !== 3) throw new TypeError("counts must be three integers");
  if (!(quantity in QUANTITIES)) throw new TypeError(`there is no quantity "${quantity}"`);
  if (!(orders in ORDERS)) throw new TypeError(`there are no orders "${orders}"`);
  const words = new Words().vector(box ? box[0] : [NaN, NaN, NaN], "box[0]").vector(box ? box[1] : [0, 0, 0], "box[1]");
  for (const count of counts) words.integer(count, "counts");
  words.integer(degree, "degree").integer(ORDERS[orders], "orders");
  words.integer(QUANTITIES[quantity], "quantity").float(error, "error");
  return words.integer(directions, "directions").integer(passes, "passes").integer(seed, "seed").done();
}
