// Within a page: what shaders of baked fog answer at points and in directions, by WebGL2 and by WebGPU. Tests serve it as /asked.mjs (browser.mjs).

/** So many random points in a box and a twentieth around it, and directions; four numbers each, the fourth of a point from 0 to `depth`. */
export function questions(count, low, size, depth) {
  let state = 1;
  const random = () => {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    return state / 2 ** 32;
  };
  const [points, directions] = [new Float32Array(4 * count), new Float32Array(4 * count)];
  for (let i = 0; i < points.length; i += 4) {
    points.set([...size.map((s, k) => low[k] + s * (1.1 * random() - 0.05)), depth * random()], i);
    const [z, a] = [2 * random() - 1, 2 * Math.PI * random()];
    const r = Math.sqrt(1 - z * z);
    directions.set([r * Math.cos(a), r * Math.sin(a), z, 0], i);
  }
  return { points, directions };
}

/**
 * Answers by WebGL2: a function from an expression of `point` and `direction` to four numbers each. `volumes` are { name, size, data }; `uniforms`
 * { name: ["3f", numbers] }; points fill a square of `width` columns.
 */
export function byWebGL({ glsl, width, points, directions, volumes, uniforms }) {
  const [W, H] = [width, points.length / 4 / width];
  const gl = new OffscreenCanvas(W, H).getContext("webgl2");
  gl.getExtension("EXT_color_buffer_float");
  const ask = (body) => {
    const program = gl.createProgram();
    const sources = [
      [gl.VERTEX_SHADER, "#version 300 es\nvoid main() { gl_Position = vec4(vec2(gl_VertexID & 1, gl_VertexID >> 1) * 4.0 - 1.0, 0.0, 1.0); }"],
      [gl.FRAGMENT_SHADER, `#version 300 es\nprecision highp float;\nprecision highp int;\nprecision highp sampler3D;\n${glsl}
uniform highp sampler2D points, directions;
out vec4 colour;
void main() {
    vec4 point = texelFetch(points, ivec2(gl_FragCoord.xy), 0);
    vec3 direction = texelFetch(directions, ivec2(gl_FragCoord.xy), 0).xyz;
    colour = ${body};
}`],
    ];
    for (const [kind, source] of sources) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    gl.useProgram(program);
    let unit = 0;
    const place = (name) => gl.getUniformLocation(program, name);
    const bind = (kind, name, upload) => {
      if (!place(name)) return;
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(kind, gl.createTexture());
      upload();
      for (const filter of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(kind, filter, gl.NEAREST);
      gl.uniform1i(place(name), unit++);
    };
    const flat = (data) => () => gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, W, H, 0, gl.RGBA, gl.FLOAT, data);
    bind(gl.TEXTURE_2D, "points", flat(points));
    bind(gl.TEXTURE_2D, "directions", flat(directions));
    for (const { name, size, data } of volumes) {
      bind(gl.TEXTURE_3D, name, () => gl.texImage3D(gl.TEXTURE_3D, 0, gl.RGBA32F, ...size, 0, gl.RGBA, gl.FLOAT, data));
    }
    for (const [name, [kind, numbers]] of Object.entries(uniforms)) gl[`uniform${kind}`](place(name), ...numbers);
    gl.activeTexture(gl.TEXTURE15);
    const target = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, target);
    flat(null)();
    gl.bindFramebuffer(gl.FRAMEBUFFER, gl.createFramebuffer());
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, target, 0);
    gl.viewport(0, 0, W, H);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    const all = new Float32Array(points.length);
    gl.readPixels(0, 0, W, H, gl.RGBA, gl.FLOAT, all);
    return all;
  };
  return { ask, error: () => gl.getError() };
}

/** The same by WebGPU, for all `bodies` at once: their answers, and what was refused. `probes` are the bytes of the uniform. */
export async function byWebGPU({ wgsl, points, directions, volumes, probes, bodies }) {
  const adapter = await navigator.gpu.requestAdapter();
  const device = await adapter.requestDevice();
  device.pushErrorScope("validation");
  const [count, each] = [points.length / 4, bodies.length];
  const pipeline = device.createComputePipeline({
    layout: "auto",
    compute: {
      module: device.createShaderModule({
        code: `${wgsl}
@group(1) @binding(0) var<storage, read> points: array<vec4<f32>>;
@group(1) @binding(1) var<storage, read> directions: array<vec4<f32>>;
@group(1) @binding(2) var<storage, read_write> answers: array<vec4<f32>>;
@compute @workgroup_size(64) fn ask(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < arrayLength(&points) {
        let point = points[id.x];
        let direction = directions[id.x].xyz;
        ${bodies.map((body, k) => `answers[${each}u * id.x + ${k}u] = ${body};`).join("\n        ")}
    }
}`,
      }),
      entryPoint: "ask",
    },
  });
  const buffer = (data, usage) => {
    const made = device.createBuffer({ size: data.byteLength, usage: usage | GPUBufferUsage.COPY_DST });
    device.queue.writeBuffer(made, 0, data);
    return { buffer: made };
  };
  const volume = ({ size, data }) => {
    const texture = device.createTexture({ size, dimension: "3d", format: "rgba32float", usage: GPUTextureUsage.TEXTURE_BINDING | GPUTextureUsage.COPY_DST });
    device.queue.writeTexture({ texture }, data, { bytesPerRow: 16 * size[0], rowsPerImage: size[1] }, size);
    return texture.createView();
  };
  const bytes = 16 * each * count;
  const told = device.createBuffer({ size: bytes, usage: GPUBufferUsage.STORAGE | GPUBufferUsage.COPY_SRC });
  const readable = device.createBuffer({ size: bytes, usage: GPUBufferUsage.MAP_READ | GPUBufferUsage.COPY_DST });
  const groups = [
    [buffer(probes, GPUBufferUsage.UNIFORM), ...volumes.map(volume)],
    [buffer(points, GPUBufferUsage.STORAGE), buffer(directions, GPUBufferUsage.STORAGE), { buffer: told }],
  ];
  const encoder = device.createCommandEncoder();
  const pass = encoder.beginComputePass();
  pass.setPipeline(pipeline);
  groups.forEach((resources, number) => {
    const entries = resources.map((resource, binding) => ({ binding, resource }));
    pass.setBindGroup(number, device.createBindGroup({ layout: pipeline.getBindGroupLayout(number), entries }));
  });
  pass.dispatchWorkgroups(Math.ceil(count / 64));
  pass.end();
  encoder.copyBufferToBuffer(told, 0, readable, 0, bytes);
  device.queue.submit([encoder.finish()]);
  await readable.mapAsync(GPUMapMode.READ);
  const answers = new Float32Array(readable.getMappedRange());
  const refused = (await device.popErrorScope())?.message ?? "";
  const of = (which) => Float32Array.from({ length: 4 * count }, (_, i) => answers[4 * each * (i >> 2) + 4 * which + (i & 3)]);
  return { answers: bodies.map((_, which) => of(which)), refused };
}
