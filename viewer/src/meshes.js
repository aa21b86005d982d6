// Recorded meshes as three.js objects, coloured by object, by what the camera saw, by error or by age.
import * as THREE from 'three';

export const kErrorFull_m = 0.02;
export const kRemembered = [124, 77, 255];
export const kLost = [215, 25, 28];
const kRoom = [205, 203, 198];

// Colour ramps: error goes from pale over orange to dark red, age from yellow to dark blue, both
// with falling lightness so that they read without hue.
const kErrorStops = [[247, 244, 233], [253, 204, 110], [240, 120, 50], [190, 30, 40], [90, 0, 40]];
const kAgeStops = [[253, 231, 120], [110, 206, 100], [34, 150, 140], [50, 90, 142], [60, 20, 80]];

function ramp(stops, t) {
  const at = Math.min(Math.max(t, 0), 1) * (stops.length - 1);
  const i = Math.min(Math.floor(at), stops.length - 2);
  return stops[i].map((low, c) => low + (at - i) * (stops[i + 1][c] - low));
}

export function cssRamp(kind) {
  const stops = kind === 'error' ? kErrorStops : kAgeStops;
  return stops.map((stop) => `rgb(${stop.join(' ')})`);
}

// three.js shades in linear light.
const kLinear = Float32Array.from({ length: 256 }, (_, i) => {
  const c = i / 255;
  return 255 * (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4);
});

const kTables = {};
function table(recording, mode) {
  const key = `${mode} ${recording.age_step_frames}`;
  kTables[key] ??= Array.from({ length: 256 }, (_, i) => {
    if (mode === 'error') return ramp(kErrorStops, (i * recording.error_step_m) / kErrorFull_m);
    return i === 255 ? [120, 120, 120] : ramp(kAgeStops, i / 254);
  });
  return kTables[key];
}

// Fills `out` (linear, 8 bits) for a chunk's decoded mesh.
function paint(out, mesh, chunk, recording, mode) {
  const vertices = mesh.error.length;
  const flat = chunk.layer === 'revealed' ? kRemembered : chunk.layer === 'hole' ? kLost
    : chunk.id === 0 ? kRoom : recording.colours.get(chunk.id) ?? [128, 128, 128];
  // A hole is no surface of the map, and of an object that there is not nothing was measured.
  const isMeasured = chunk.layer !== 'hole' && recording.names.has(chunk.id);
  const lookup = !isMeasured ? null : mode === 'error' || mode === 'age' ? table(recording, mode) : null;
  for (let v = 0; v < vertices; ++v) {
    for (let c = 0; c < 3; ++c) {
      const value = lookup ? lookup[mode === 'error' ? mesh.error[v] : mesh.age[v]][c]
        : mode === 'seen' && chunk.layer !== 'hole' ? mesh.colours[3 * v + c] : flat[c];
      out[3 * v + c] = kLinear[Math.round(value)];
    }
  }
}

export function makeChunk(mesh, chunk, recording) {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute('position', new THREE.BufferAttribute(mesh.positions, 3));
  geometry.setAttribute('color', new THREE.BufferAttribute(new Uint8Array(3 * mesh.error.length), 3, true));
  geometry.setIndex(new THREE.BufferAttribute(mesh.indices, 1));
  geometry.computeVertexNormals();
  const material = new THREE.MeshLambertMaterial({ vertexColors: true, side: THREE.DoubleSide });
  const object = new THREE.Mesh(geometry, material);
  object.userData = { mesh, chunk, recording, mode: null };
  return object;
}

export function colourChunk(object, mode) {
  const { mesh, chunk, recording } = object.userData;
  if (object.userData.mode === mode) return;
  object.userData.mode = mode;
  const colours = object.geometry.getAttribute('color');
  paint(colours.array, mesh, chunk, recording, mode);
  colours.needsUpdate = true;
}

// A true surface, pushed in by `inwards_m` so that it shows only where the map in front of it is
// missing.
export function makeTruth(mesh, inwards_m) {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute('position', new THREE.BufferAttribute(mesh.positions.slice(), 3));
  geometry.setIndex(new THREE.BufferAttribute(mesh.indices, 1));
  geometry.computeVertexNormals();
  const positions = geometry.getAttribute('position');
  const normals = geometry.getAttribute('normal');
  for (let i = 0; i < positions.array.length; ++i) positions.array[i] -= inwards_m * normals.array[i];
  return new THREE.Mesh(geometry, new THREE.MeshLambertMaterial({
    color: 0x007f7f, transparent: true, opacity: 0.6, side: THREE.DoubleSide,
  }));
}

export function disposeTree(root) {
  root.traverse((object) => {
    object.geometry?.dispose();
    object.material?.map?.dispose();
    object.material?.dispose();
  });
  root.removeFromParent();
}
