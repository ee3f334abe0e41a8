// The atrium with baked light: surfaces by irradiance, fog by in-scattered radiance. See README.md.

import * as THREE from "three";
import { PLYLoader } from "three/addons/loaders/PLYLoader.js";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";

const glsl = await (await fetch("fog.glsl")).text();

/** The uniforms of fog.glsl from what `fogbow bake … -o NAME.json` writes. */
async function probes(name) {
  const about = await (await fetch(`${name}.json`)).json();
  const data = await (await fetch(about.data)).arrayBuffer();
  const arrays = Object.fromEntries(about.arrays.map((a) => [a.name, a]));
  const count = about.counts[0] * about.counts[1] * about.counts[2];
  const read = (a) => (a.type === "u8" ? new Uint8Array(data, a.offset, a.bytes) : new Float32Array(data, a.offset, a.bytes / 4));
  const states = read(arrays.state);
  const extinction = read(arrays.extinction);
  const texture = (name, alpha) => {
    const [texels, numbers] = [new Float32Array(4 * count), read(arrays[name])];
    for (let i = 0; i < count; i++) texels.set([...numbers.subarray(3 * i, 3 * i + 3), alpha(i)], 4 * i);
    const made = new THREE.Data3DTexture(texels, ...about.counts);
    Object.assign(made, { format: THREE.RGBAFormat, type: THREE.FloatType, minFilter: THREE.NearestFilter, magFilter: THREE.NearestFilter, needsUpdate: true });
    return { value: made };
  };
  const uniforms = {
    probes_corner: { value: new THREE.Vector3(...about.box.min) },
    probes_size: { value: new THREE.Vector3(...about.box.max).sub(new THREE.Vector3(...about.box.min)) },
    probes_scale: { value: about.scale },
    probes_numbers: { value: 9 },
    medium: texture("albedo", (i) => (extinction[3 * i] + extinction[3 * i + 1] + extinction[3 * i + 2]) / 3),
    wall0: texture("wall0", () => 0),
    wall1: texture("wall1", () => 0),
  };
  for (let k = 0; k < 9; k++) uniforms[`sh${k}`] = texture(`sh${k}`, (i) => (states[i] === 1 ? 1 : 0));
  return uniforms;
}

const [fog, surfaces] = await Promise.all([probes("fog"), probes("surfaces")]);
const precisions = "precision highp float;\nprecision highp int;\nprecision highp sampler3D;\n";

const scene = new THREE.Scene();
scene.background = new THREE.Color().setRGB(1.2, 1.5, 1.9, THREE.LinearSRGBColorSpace);
const reflectances = {
  floor: [0.45, 0.38, 0.28], stone: [0.42, 0.37, 0.29], column: [0.48, 0.43, 0.34], ceiling: [0.5, 0.42, 0.3], roof: [0.24, 0.11, 0.07],
  "curtain-red": [0.42, 0.03, 0.02], "curtain-green": [0.04, 0.2, 0.03], "curtain-blue": [0.04, 0.1, 0.32],
};
const load = new PLYLoader();
await Promise.all(Object.entries(reflectances).map(async ([name, reflectance]) => {
  const material = new THREE.ShaderMaterial({
    glslVersion: THREE.GLSL3,
    side: THREE.DoubleSide,
    uniforms: { ...surfaces, reflectance: { value: new THREE.Vector3(...reflectance) } },
    vertexShader: "out vec3 place;\nvoid main() { place = position; gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0); }",
    // Faces are flat: the normal is that of the triangle, on the side of the eye; the look-up begins a little before it.
    fragmentShader: `${precisions}${glsl}
uniform vec3 reflectance;
in vec3 place;
out vec4 colour;
void main() {
    vec3 normal = normalize(cross(dFdx(place), dFdy(place)));
    colour = vec4(reflectance / 3.14159265 * in_scattered(place + 0.02 * normal, normal), 1.0);
}`,
  });
  scene.add(new THREE.Mesh(await load.loadAsync(`meshes/atrium-${name}.ply`), material));
}));

const renderer = new THREE.WebGLRenderer({ antialias: false });
document.body.append(renderer.domElement);
const camera = new THREE.PerspectiveCamera(60, 1, 0.05, 200);
camera.position.set(-9, 1.8, 0.4);
const controls = new OrbitControls(camera, renderer.domElement);
controls.target.set(0, 4.2, -0.4);
const target = new THREE.WebGLRenderTarget(1, 1, { type: THREE.HalfFloatType, depthTexture: new THREE.DepthTexture(1, 1, THREE.UnsignedIntType) });

// Fog between the eye and what each pixel shows.
const pass = new THREE.ShaderMaterial({
  glslVersion: THREE.GLSL3,
  uniforms: { ...fog, seen: { value: target.texture }, depths: { value: target.depthTexture }, eye: { value: camera.position }, back: { value: new THREE.Matrix4() } },
  vertexShader: "out vec2 at;\nvoid main() { at = uv; gl_Position = vec4(position.xy, 0.0, 1.0); }",
  fragmentShader: `${precisions}${glsl}
uniform sampler2D seen, depths;
uniform vec3 eye;
uniform mat4 back;
in vec2 at;
out vec4 colour;
void main() {
    vec4 far = back * vec4(2.0 * vec3(at, texture(depths, at).r) - 1.0, 1.0);
    vec3 ray = far.xyz / far.w - eye;
    vec4 before = fog(eye, normalize(ray), length(ray), 48);
    vec3 light = before.rgb + before.a * texture(seen, at).rgb;
    colour = vec4(pow(light / (light + 0.8) * 1.6, vec3(1.0 / 2.2)), 1.0);
}`,
  depthTest: false,
});
const screen = new THREE.Scene().add(new THREE.Mesh(new THREE.PlaneGeometry(2, 2), pass));
screen.children[0].frustumCulled = false;

function draw() {
  const [width, height] = [innerWidth, innerHeight];
  renderer.setSize(width, height);
  target.setSize(width, height);
  camera.aspect = width / height;
  camera.updateProjectionMatrix();
  camera.updateMatrixWorld();
  pass.uniforms.back.value.multiplyMatrices(camera.matrixWorld, camera.projectionMatrixInverse);
  renderer.setRenderTarget(target);
  renderer.render(scene, camera);
  renderer.setRenderTarget(null);
  renderer.render(screen, camera);
  document.title = "Baked fog in three.js: drawn";
}
controls.update();
controls.addEventListener("change", draw);
addEventListener("resize", draw);
draw();
