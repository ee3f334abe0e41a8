/** Light in fog, smoke and clouds. Lengths are metres, angles radians, light is W·m⁻²·sr⁻¹. */

export type Vector = readonly [number, number, number] | Float32Array;
/** One number for all channels, or red, green, blue. */
export type Colour = number | Vector;
/** Two corners, the lower one first. */
export type Box = readonly [Vector, Vector];
/** A box, or a ball. */
export type Place = { box: Box; sphere?: undefined } | { sphere: { centre: Vector; radius: number }; box?: undefined };

/** Angular law of scattering: Henyey and Greenstein by `g`, in (-1, 1), unless told otherwise. */
export type Phase =
  | { phase?: "henyey-greenstein"; g?: number }
  | { phase: "schlick"; k: number }
  | { phase: "rayleigh" }
  | { phase: "draine"; g: number; alpha: number };

export interface Coefficients {
  /** Absorption (m⁻¹). */
  absorption?: Colour;
  /** Scattering (m⁻¹). */
  scattering?: Colour;
  /** Emission (W·m⁻³·sr⁻¹). */
  emission?: Colour;
}

/** A participating medium and where it is. Plain data: nothing to free. Media may overlap; their coefficients add. */
export class Medium {
  private constructor(words: Uint32Array);
  readonly words: Uint32Array;
  /** The same everywhere in its place. */
  static homogeneous(options: Coefficients & Phase & Place): Medium;
  /** Densities in the cells of a box, x fastest, trilinear between cell centres; coefficients are those where density is 1. Bytes: 255 is 1. */
  static grid(
    options: Coefficients & Phase & { box: Box; size: readonly [number, number, number]; density: Float32Array | Uint8Array | readonly number[] },
  ): Medium;
  /** Fractal noise; coefficients are those where density is 1. */
  static noise(
    options: Coefficients &
      Phase &
      Place & {
        frequency?: number;
        octaves?: number;
        lacunarity?: number;
        gain?: number;
        offset?: number;
        amplitude?: number;
        maxDensity?: number;
        seed?: number;
      },
  ): Medium;
}

/** What a surface does to light. Reflectances lie in [0, 1]. Seen from both sides unless `twoSided` is false. */
export type Material = { twoSided?: boolean } & (
  | { kind?: "lambert"; reflectance?: Colour }
  | { kind: "phong"; reflectance?: Colour; specular: Colour; exponent: number }
  | { kind: "mirror"; reflectance?: Colour }
  | { kind: "glass"; eta?: number; reflectance?: Colour; transmittance?: Colour }
  | { kind: "null" }
);

/** Surfaces. Plain data: nothing to free. */
export class Scene {
  constructor();
  /** Three numbers for each vertex, three indices for each triangle (none: the vertices in their order). */
  triangles(positions: Float32Array | readonly number[], indices?: Uint32Array | readonly number[] | null, material?: Material): this;
  /** A parallelogram; its front is on the side of edgeU × edgeV. */
  quad(corner: Vector, edgeU: Vector, edgeV: Vector, material?: Material): this;
  sphere(centre: Vector, radius: number, material?: Material): this;
  /** The six walls of a box, seen from within. */
  room(box: Box, material?: Material): this;
  /** A solid block, seen from outside: light probes know that they are in it. */
  block(box: Box, material?: Material): this;
  readonly words: Uint32Array;
}

/** What shines. Plain data: nothing to free. Quads and balls are surfaces, too. */
export class Light {
  private constructor(words: Uint32Array);
  readonly words: Uint32Array;
  /** Intensity (W·sr⁻¹), or flux (W). */
  static point(options: { position: Vector } & ({ intensity: Colour; flux?: undefined } | { flux: Colour; intensity?: undefined })): Light;
  /** Full within `beam` (rad) of its axis, nothing beyond `cutoff` (rad). */
  static spot(options: { position: Vector; axis: Vector; beam: number; cutoff: number; intensity: Colour }): Light;
  /** Irradiance (W·m⁻²) of a surface across it. */
  static sun(options: { toLight: Vector; irradiance: Colour }): Light;
  /** Shines on the side of edgeU × edgeV. */
  static quad(options: { corner: Vector; edgeU: Vector; edgeV: Vector; radiance: Colour }): Light;
  static sphere(options: { centre: Vector; radius: number; radiance: Colour }): Light;
  /** The same from all around. */
  static sky(options: { radiance: Colour }): Light;
}

export interface WorldDescription {
  media?: readonly Medium[];
  scene?: Scene;
  lights?: readonly Light[];
  /** The box that matters; around all media and surfaces unless told. */
  bounds?: Box;
}

/** A pinhole camera. `fov` is vertical (rad). */
export interface View {
  eye: Vector;
  target: Vector;
  up?: Vector;
  fov?: number;
  width: number;
  height: number;
}

/** Part of a picture, all of it unless told; samples of each pixel from number `first` on. */
export interface Part {
  x?: number;
  y?: number;
  width?: number;
  height?: number;
  first?: number;
  samples?: number;
  seed?: number;
}

/** Where light is asked for. */
export type Asked = { view: View; box?: undefined } | { box: Box; view?: undefined };

export type CachesOptions = Asked & {
  /** Relative error of pictures; 0.02 unless told. */
  error?: number;
  /** Random walks of a record; by the error unless told. */
  walks?: number;
  /** Eye rays that look for places; by the pixels unless told. */
  rays?: number;
  seed?: number;
  /** Whether light straight from lamps is cached, too. */
  single?: boolean;
};

export interface ProbesOptions {
  /** The bounds of the world unless told. */
  box?: Box;
  /** Probes along x, y, z. */
  counts: readonly [number, number, number];
  /** Of spherical harmonics, 0 to 3; 2 unless told. */
  degree?: number;
  /** All light, all but light straight from lamps, or only what was scattered more than once. */
  orders?: "all" | "indirect" | "multiple";
  /** Light that fog scatters (without the scattering coefficient), or light that falls on surfaces. */
  quantity?: "in-scattered" | "irradiance";
  /** Relative standard error at which a bake ends. */
  error?: number;
  /** Directions of a pass. */
  directions?: number;
  /** Passes at most. */
  passes?: number;
  seed?: number;
}

export type Kind = "single" | "surface" | "multiple" | "irradiance";

/** Jobs of the current round: the next one, and where the round ends. Equal when all is done. */
export interface Jobs {
  next: number;
  end: number;
}

/** Probes as 3D textures have them: x fastest, four floats for each. */
export interface Textures {
  counts: [number, number, number];
  /** For each coefficient red, green, blue, and 1 where the probe is valid, else 0. */
  harmonics: Float32Array[];
  /** Albedo, and extinction (m⁻¹). */
  medium: Float32Array;
  /** Planes of two surfaces around probes: a point at an offset o, in cells, is behind one where o · plane > 1. */
  walls: [Float32Array, Float32Array];
}

/** What the library has refused, in its words. */
export class FogbowError extends Error {
  constructor(message: string);
}

/** Lives in the module's memory until it is freed, or until it is collected. */
interface Held {
  free(): void;
  [Symbol.dispose](): void;
}

export interface World extends Held {}
/** Media, surfaces and lights. */
export class World {
  constructor(description: WorldDescription | Uint32Array);
  readonly words: Uint32Array;
  readonly bounds: [[number, number, number], [number, number, number]];
  /** Path-traced picture: unbiased. Red, green, blue of each pixel. */
  pathTrace(view: View, part?: Part): Float32Array;
  /** Path-traced radiance of rays: origin, direction (unit) and length, seven numbers each. */
  radiance(rays: Float32Array | readonly number[], options?: { samples?: number; seed?: number }): Float32Array;
  /** Light scattered at points towards directions (unit), without the scattering coefficient. */
  inScattered(
    points: Float32Array | readonly number[],
    directions: Float32Array | readonly number[],
    options?: { samples?: number; seed?: number },
  ): Float32Array;
  /** Light of the lights scattered once, at points towards directions (unit), without the scattering coefficient. */
  scatteredOnce(points: Float32Array | readonly number[], directions: Float32Array | readonly number[]): Float32Array;
  /** A record of that light, as caches have them: how far it may be used, by its gradient. */
  record(point: Vector, toEye: Vector, options?: { tolerance?: number; least?: number; most?: number }): CacheRecord;
  /** Covariances (m⁻²) of light in the cells of a grid over the bounds: xx, xy, xz, yy, yz, zz of each. */
  covariances(options?: { edge?: number; photons?: number }): { size: [number, number, number]; covariances: Float32Array };
  /** A virtual light in the medium, seen by points towards an eye: clamped, and all of its light; red, green, blue of each point. */
  virtualLight(
    light: { position: Vector; incoming: Vector; flux?: Colour; bound: number; eye: Vector },
    points: Float32Array | readonly number[],
  ): { clamped: Float32Array; all: Float32Array };
}

export interface CacheRecord {
  position: [number, number, number];
  radius: number;
  value: [number, number, number];
  /** Of each channel along x, y and z: three colours. */
  gradient: [[number, number, number], [number, number, number], [number, number, number]];
}

export interface Caches extends Held {}
/** Radiance caches (Jarosz et al. 2008), filled job by job. */
export class Caches {
  constructor(world: World, options: CachesOptions | Uint32Array);
  readonly world: World;
  readonly words: Uint32Array;
  /** Runs jobs, some milliseconds each; whether more are due. To cancel, stop calling; call {@link cancel} to read what is there. */
  fill(jobs?: number): boolean;
  /** Goes on for another view or box. */
  ask(asked: Asked): void;
  /** Ends a fill where it is. What was made counts. */
  cancel(): void;
  readonly jobs: Jobs;
  /** What is being done, in a word or two. */
  readonly stage: string;
  /** Runs one job; what it leaves, for {@link accept} here or in another instance. */
  run(job: number): Uint8Array;
  /** Takes what the next job has left. */
  accept(left: Uint8Array): void;
  picture(view: View, part?: Part): Float32Array;
  radiance(rays: Float32Array | readonly number[], options?: { samples?: number; seed?: number }): Float32Array;
  inScattered(points: Float32Array | readonly number[], directions: Float32Array | readonly number[], options?: { seed?: number }): Float32Array;
  /** Records: position, radius, value, gradient along x, y and z of the value; 16 numbers each. */
  records(kind?: Kind): Float32Array;
  save(): Uint8Array;
  /** Bytes that caches with the same options have saved in the same world. */
  load(bytes: Uint8Array): void;
}

export interface Probes extends Held {}
/** A grid of light probes: fog as 3D textures. */
export class Probes {
  constructor(world: World, options: (ProbesOptions & { caches?: Caches }) | Uint32Array);
  readonly world: World;
  readonly words: Uint32Array;
  readonly counts: [number, number, number];
  readonly degree: number;
  /** Caches that are read where they know the light. */
  caches: Caches | null;
  /** Runs jobs; whether more are due. */
  bake(jobs?: number): boolean;
  /** Bakes anew what has a part in a box, where the world has changed. */
  bakeAnew(box: Box): void;
  readonly jobs: Jobs;
  run(job: number): Uint8Array;
  accept(left: Uint8Array): void;
  /** Relative standard error so far. */
  readonly error: number;
  /** About what share of the work is done. */
  readonly share: number;
  /** Light at points towards directions (unit). */
  values(points: Float32Array | readonly number[], directions: Float32Array | readonly number[]): Float32Array;
  /** Unless `dilated` is false, light has spread into probes in walls: for hardware that mixes all eight around a point. */
  textures(options?: { dilated?: boolean }): Textures;
  save(): Uint8Array;
  load(bytes: Uint8Array): void;
}

/** What the module may be made from. */
export type Source = string | URL | BufferSource | WebAssembly.Module | Response;

/** Makes the module ready; with nothing, from the file beside this one, with SIMD where there is. Calling again changes nothing. */
export function init(source?: Source | Promise<Source>): Promise<void>;
/** Whether WebAssembly has SIMD here. */
export function hasSimd(): boolean;
/** Bytes of memory that the module has. */
export function memoryBytes(): number;
/** Gives back the memory of inputs and outputs. */
export function trim(): void;
export const version: string;
