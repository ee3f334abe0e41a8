import type { Asked, Box, CachesOptions, Kind, Part, ProbesOptions, Source, Textures, View, WorldDescription } from "./fogbow.js";

export interface Progress {
  /** What is being done, in a word or two. */
  stage: string;
  /** Jobs of this round that are done, and how many it has. How many rounds there will be nobody knows. */
  done: number;
  of: number;
  /** Of a bake: relative standard error, and about what share is done. */
  error?: number;
  share?: number;
}

export interface RunOptions {
  signal?: AbortSignal;
  onProgress?: (progress: Progress) => void;
}

interface Remote {
  /** Frees its memory in all workers. */
  free(): Promise<void>;
}

export interface RemoteWorld extends Remote {
  /** Path-traced picture; rows are dealt out among the workers. */
  pathTrace(view: View, part?: Part): Promise<Float32Array>;
}

export interface RemoteCaches extends Remote {
  /** Fills; whether to the end, which `signal` may prevent. */
  fill(options?: RunOptions): Promise<boolean>;
  ask(asked: Asked): Promise<unknown>;
  picture(view: View, part?: Part): Promise<Float32Array>;
  inScattered(points: Float32Array | readonly number[], directions: Float32Array | readonly number[], options?: { seed?: number }): Promise<Float32Array>;
  records(kind?: Kind): Promise<Float32Array>;
  save(): Promise<Uint8Array>;
  load(bytes: Uint8Array): Promise<unknown>;
}

export interface RemoteProbes extends Remote {
  /** Bakes; whether to the end. */
  bake(options?: RunOptions): Promise<boolean>;
  bakeAnew(box: Box): Promise<unknown>;
  values(points: Float32Array | readonly number[], directions: Float32Array | readonly number[]): Promise<Float32Array>;
  /** As far as it is baked; may be asked for while it is. */
  textures(options?: { dilated?: boolean }): Promise<Textures>;
  save(): Promise<Uint8Array>;
  load(bytes: Uint8Array): Promise<unknown>;
}

/** Workers, each with an instance of its own. The same bits for any number of them. */
export class Workers {
  private constructor();
  /** One worker, or `count`. */
  static start(options?: { count?: number; wasm?: Exclude<Source, Response> | Promise<Exclude<Source, Response>> }): Promise<Workers>;
  readonly count: number;
  world(description: WorldDescription | Uint32Array): Promise<RemoteWorld>;
  caches(world: RemoteWorld, options: CachesOptions): Promise<RemoteCaches>;
  probes(world: RemoteWorld, options: ProbesOptions & { caches?: RemoteCaches }): Promise<RemoteProbes>;
  /** Ends all of them. */
  close(): void;
  [Symbol.dispose](): void;
}
