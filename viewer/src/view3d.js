// The maps beside each other in one canvas, seen by one camera.
import * as THREE from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';
import { colourChunk, disposeTree, makeChunk, makeTruth } from './meshes.js';

const kLift_m = 0.4;
const kTruthInwards_m = 0.012;
const kFrustum_m = 0.14;
const kNearFrustum_m = 0.3;  // nearer than that, the frustum would hide what it shows
const kKeptFrames = 4;  // decoded key frames kept a map

function poseMatrix([x, y, z, qx, qy, qz, qw]) {
  return new THREE.Matrix4().compose(new THREE.Vector3(x, y, z),
                                     new THREE.Quaternion(qx, qy, qz, qw), new THREE.Vector3(1, 1, 1));
}

export function webglWorks() {
  try {
    const canvas = document.createElement('canvas');
    return Boolean(canvas.getContext('webgl2'));
  } catch {
    return false;
  }
}

export class View3d {
  // `element` holds a child of class "panel" a map, in the order of setRuns, and gets the canvas.
  constructor(element, onPick) {
    this.element = element;
    this.onPick = onPick;
    this.runs = [];
    this.options = { colour: 'object', pull: 0, hidden: false, truth: false, path: true };
    this.scenes = new Map();   // run key -> THREE.Scene
    this.frames = new Map();   // run key -> Map(frame -> THREE.Group)
    this.renderer = new THREE.WebGLRenderer({ antialias: true, alpha: true, preserveDrawingBuffer: true });
    this.renderer.setScissorTest(true);
    this.renderer.domElement.setAttribute('aria-hidden', 'true');
    element.append(this.renderer.domElement);
    this.camera = new THREE.PerspectiveCamera(50, 1, 0.05, 60);
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, element);
    this.controls.addEventListener('change', () => this.invalidate());
    element.style.touchAction = 'pan-y';
    this.marker = new THREE.Vector3();
    this.hasMarker = false;
    new ResizeObserver(() => this.invalidate()).observe(element);
    this.listenForPicks();
  }

  listenForPicks() {
    let down = null;
    this.element.addEventListener('pointerdown', (event) => { down = [event.clientX, event.clientY]; });
    this.element.addEventListener('pointerup', (event) => {
      if (!down || Math.hypot(event.clientX - down[0], event.clientY - down[1]) > 4) return;
      this.pick(event.clientX, event.clientY);
    });
  }

  invalidate() {
    if (this.pending) return;
    this.pending = true;
    requestAnimationFrame(() => {
      this.pending = false;
      this.render();
    });
  }

  async setRuns(runs) {
    this.runs = runs;
    for (const [key, scene] of this.scenes) {
      if (runs.some((run) => run.key === key)) continue;
      disposeTree(scene);
      this.scenes.delete(key);
      this.frames.delete(key);
    }
    for (const run of runs) {
      if (this.scenes.has(run.key)) continue;
      const scene = new THREE.Scene();
      scene.add(new THREE.HemisphereLight(0xffffff, 0xa09a8c, 2.1));
      const lamp = new THREE.DirectionalLight(0xffffff, 1.7);
      scene.add(lamp, lamp.target);
      scene.userData = { lamp, run };
      this.scenes.set(run.key, scene);
      this.frames.set(run.key, new Map());
    }
    if (this.frame !== undefined) await this.setFrame(this.frame);
  }

  async setFrame(frame) {
    this.frame = frame;
    const turn = (this.turn = (this.turn ?? 0) + 1);
    for (const run of [...this.runs]) {
      const group = await this.group(run, frame);
      // A later call has taken over; what was decoded is kept for it.
      if (turn !== this.turn) return;
      for (const other of this.frames.get(run.key)?.values() ?? []) other.visible = other === group;
    }
    this.hasMarker = false;
    this.apply();
  }

  // The decoded key frame of a map, made at its first use.
  async group(run, frame) {
    const frames = this.frames.get(run.key);
    if (!frames || frames.has(frame)) return frames?.get(frame);
    const key = run.recorded.key_frames.find((each) => each.frame === frame);
    const group = new THREE.Group();
    frames.set(frame, group);
    group.userData = { chunks: [], truth: [], frame };
    for (const chunk of key?.chunks ?? []) {
      const object = makeChunk(await run.recording.mesh(chunk, chunk.grid), chunk, run.recording);
      group.userData.chunks.push(object);
      group.add(object);
    }
    group.userData.camera = this.cameraMarks(run.recording, frame);
    group.add(group.userData.camera);
    this.scenes.get(run.key)?.add(group);
    if (frames.size > kKeptFrames) {
      const [oldest, tree] = [...frames].find(([each]) => each !== frame);
      disposeTree(tree);
      frames.delete(oldest);
    }
    return group;
  }

  // The camera's way so far and ahead, and where it is with what it sees.
  cameraMarks(recording, frame) {
    const marks = new THREE.Group();
    const at = recording.frames.findIndex((each) => each.frame === frame);
    const points = recording.frames.map(({ T_WC }) => new THREE.Vector3(T_WC[0], T_WC[1], T_WC[2]));
    const line = (list, colour, opacity) => new THREE.Line(
      new THREE.BufferGeometry().setFromPoints(list),
      new THREE.LineBasicMaterial({ color: colour, transparent: opacity < 1, opacity }));
    marks.add(line(points.slice(0, at + 1), 0xd55e00, 1), line(points.slice(at), 0xd55e00, 0.3));
    const k = recording.intrinsics;
    const corner = (u, v) => new THREE.Vector3((u - k.cx) / k.fx, (v - k.cy) / k.fy, 1)
      .multiplyScalar(kFrustum_m);
    const corners = [corner(0, 0), corner(k.width, 0), corner(k.width, k.height), corner(0, k.height)];
    const eye = new THREE.Vector3();
    const edges = corners.flatMap((c, i) => [eye, c, c, corners[(i + 1) % 4]]);
    const frustum = new THREE.Group();
    frustum.add(new THREE.LineSegments(new THREE.BufferGeometry().setFromPoints(edges),
                                       new THREE.LineBasicMaterial({ color: 0xd55e00 })));
    const key = recording.key_frames.find((each) => each.frame === frame);
    if (key) {
      const geometry = new THREE.BufferGeometry().setFromPoints(corners);
      geometry.setAttribute('uv', new THREE.Float32BufferAttribute([0, 1, 1, 1, 1, 0, 0, 0], 2));
      geometry.setIndex([0, 2, 1, 0, 3, 2]);
      const material = new THREE.MeshBasicMaterial({ side: THREE.DoubleSide, transparent: true, opacity: 0.85, visible: false });
      createImageBitmap(recording.imageBlob(key.colour), { imageOrientation: 'flipY' }).then((image) => {
        material.map = new THREE.Texture(image);
        material.map.flipY = false;
        material.map.colorSpace = THREE.SRGBColorSpace;
        material.map.needsUpdate = true;
        material.visible = true;
        material.needsUpdate = true;
        this.invalidate();
      });
      frustum.add(new THREE.Mesh(geometry, material));
    }
    if (at >= 0) frustum.applyMatrix4(poseMatrix(recording.frames[at].T_WC));
    marks.add(frustum);
    marks.userData.frustum = frustum;
    return marks;
  }

  setOptions(options) {
    // What moves is elsewhere then.
    if (options.pull !== this.options.pull) this.hasMarker = false;
    Object.assign(this.options, options);
    this.apply();
  }

  // Brings what is shown in line with the options.
  apply() {
    const { colour, pull, hidden, truth, path } = this.options;
    for (const run of this.runs) {
      const group = this.frames.get(run.key)?.get(this.frame);
      if (!group) continue;
      for (const object of group.userData.chunks) {
        const { layer } = object.userData.chunk;
        colourChunk(object, colour);
        if (layer === 'gone') object.visible = pull === 0;
        if (layer === 'revealed' || layer === 'hole') object.visible = pull > 0 || hidden;
        if (layer === 'mover') {
          object.position.z = kLift_m * Math.min(pull, 1);
          const opacity = (hidden ? 0.25 : 1) * Math.min(1, (1 - pull) / 0.25);
          object.visible = opacity > 0.01;
          object.material.transparent = opacity < 1;
          object.material.opacity = opacity;
          object.material.depthWrite = opacity === 1;
          object.material.needsUpdate = true;
        }
      }
      group.userData.camera.visible = path;
      if (truth && !group.userData.asked) {
        group.userData.asked = true;
        this.addTruth(run, group);
      }
      for (const object of group.userData.truth) {
        // What is taken out of the map is not missing from it.
        object.visible = truth && !(object.userData.removed && (pull > 0 || hidden));
      }
    }
    this.invalidate();
  }

  async addTruth(run, group) {
    const { recording } = run;
    const at = recording.frames.find((each) => each.frame === group.userData.frame);
    for (const chunk of recording.truth) {
      const object = makeTruth(await recording.mesh(chunk, chunk.grid), kTruthInwards_m);
      const pose = at?.T_WO[chunk.id];
      if (pose) object.applyMatrix4(poseMatrix(pose));
      object.userData.removed = recording.objects.find((each) => each.id === chunk.id)?.removed;
      group.userData.truth.push(object);
      group.add(object);
    }
    this.apply();
  }

  // Looks as the camera of a key frame did, from `back` times as far.
  lookAsCamera(recording, frame, back = 1) {
    const at = recording.frames.find((each) => each.frame === frame);
    if (!at) return;
    const pose = poseMatrix(at.T_WC);
    const eye = new THREE.Vector3().setFromMatrixPosition(pose);
    const forward = new THREE.Vector3(0, 0, 1).transformDirection(pose);
    const distance = this.distanceToMiddle(recording, eye, forward);
    const target = eye.clone().addScaledVector(forward, distance);
    this.moveTo(target.clone().addScaledVector(forward, -distance * back), target, recording);
  }

  lookFromAbove(recording, frame) {
    const at = recording.frames.find((each) => each.frame === frame);
    if (!at) return;
    const pose = poseMatrix(at.T_WC);
    const eye = new THREE.Vector3().setFromMatrixPosition(pose);
    const forward = new THREE.Vector3(0, 0, 1).transformDirection(pose);
    const distance = this.distanceToMiddle(recording, eye, forward);
    const target = eye.clone().addScaledVector(forward, distance);
    // Not straight down, where "up" has no meaning.
    this.moveTo(target.clone().add(new THREE.Vector3(0, -0.02 * distance, distance * 1.3)), target, recording);
  }

  // How far along the view the moved objects are; two metres where nothing moved.
  distanceToMiddle(recording, eye, forward) {
    const places = recording.frames.flatMap(({ T_WO }) => Object.values(T_WO))
      .map(([x, y, z]) => new THREE.Vector3(x, y, z).sub(eye).dot(forward)).filter((d) => d > 0.1);
    return places.length ? places.reduce((sum, d) => sum + d, 0) / places.length : 2;
  }

  moveTo(eye, target, recording) {
    this.intrinsics = recording.intrinsics;
    this.camera.position.copy(eye);
    this.controls.target.copy(target);
    this.controls.update();
    this.invalidate();
  }

  // Turns by radians, or comes nearer by a factor.
  turn3d(azimuth, height, nearer = 1) {
    const offset = this.camera.position.clone().sub(this.controls.target);
    const flat = Math.hypot(offset.x, offset.y);
    const around = Math.atan2(offset.y, offset.x) + azimuth;
    const up = Math.min(Math.max(Math.atan2(offset.z, flat) + height, -1.5), 1.55);
    const length = offset.length() / nearer;
    offset.set(Math.cos(around) * Math.cos(up), Math.sin(around) * Math.cos(up), Math.sin(up));
    this.camera.position.copy(this.controls.target).addScaledVector(offset, length);
    this.controls.update();
    this.invalidate();
  }

  panels() {
    return [...this.element.querySelectorAll('.panel')];
  }

  // A vertical opening that shows at least what the recording's camera saw.
  fitLens(aspect) {
    const k = this.intrinsics ?? { width: 16, height: 9, fy: 9.4 };
    const tall = k.height / (2 * k.fy);
    const wide = (k.width / k.height) * tall;
    this.camera.aspect = aspect;
    this.camera.fov = (360 / Math.PI) * Math.atan(Math.max(tall, wide / aspect));
    this.camera.updateProjectionMatrix();
  }

  render() {
    const whole = this.element.getBoundingClientRect();
    if (whole.width === 0) return;
    const ratio = Math.min(window.devicePixelRatio, 2);
    const canvas = this.renderer.domElement;
    const size = this.renderer.getSize(new THREE.Vector2());
    if (size.x !== Math.round(whole.width) || size.y !== Math.round(whole.height) ||
        this.renderer.getPixelRatio() !== ratio) {
      this.renderer.setPixelRatio(ratio);
      this.renderer.setSize(Math.round(whole.width), Math.round(whole.height));
    }
    this.renderer.setClearAlpha(0);
    this.renderer.setScissorTest(false);
    this.renderer.clear();
    this.renderer.setScissorTest(true);
    const panels = this.panels();
    this.runs.forEach((run, i) => {
      const panel = panels[i]?.querySelector('.stage')?.getBoundingClientRect();
      const scene = this.scenes.get(run.key);
      if (!panel || !scene || panel.width < 2 || panel.height < 2) return;
      const left = panel.left - whole.left;
      const bottom = whole.bottom - panel.bottom;
      this.renderer.setViewport(left, bottom, panel.width, panel.height);
      this.renderer.setScissor(left, bottom, panel.width, panel.height);
      this.fitLens(panel.width / panel.height);
      const frustum = this.frames.get(run.key)?.get(this.frame)?.userData.camera?.userData.frustum;
      if (frustum) frustum.visible = frustum.position.distanceTo(this.camera.position) > kNearFrustum_m;
      const { lamp } = scene.userData;
      lamp.position.copy(this.camera.position).add(new THREE.Vector3(0, 0, 0.5));
      lamp.target.position.copy(this.controls.target);
      this.renderer.render(scene, this.camera);
      this.placeMarker(panels[i], panel);
    });
    canvas.dataset.renders = String(Number(canvas.dataset.renders ?? 0) + 1);
  }

  placeMarker(panel, box) {
    const mark = panel.querySelector('.mark');
    const at = this.marker.clone().project(this.camera);
    const visible = this.hasMarker && at.z < 1 && Math.abs(at.x) < 1 && Math.abs(at.y) < 1;
    mark.hidden = !visible;
    if (!visible) return;
    mark.style.left = `${((at.x + 1) / 2) * box.width}px`;
    mark.style.top = `${((1 - at.y) / 2) * box.height}px`;
  }

  // What is at a place of the window; tells onPick.
  pick(x, y) {
    const panels = this.panels();
    const i = panels.findIndex((panel) => {
      const box = panel.querySelector('.stage').getBoundingClientRect();
      return x >= box.left && x < box.right && y >= box.top && y < box.bottom;
    });
    if (i < 0 || !this.runs[i]) return;
    const run = this.runs[i];
    const group = this.frames.get(run.key)?.get(this.frame);
    if (!group) return;
    const box = panels[i].querySelector('.stage').getBoundingClientRect();
    this.fitLens(box.width / box.height);
    const caster = new THREE.Raycaster();
    caster.setFromCamera(new THREE.Vector2((2 * (x - box.left)) / box.width - 1,
                                           1 - (2 * (y - box.top)) / box.height), this.camera);
    const [hit] = caster.intersectObjects(group.userData.chunks.filter((object) => object.visible), false);
    this.hasMarker = Boolean(hit);
    if (hit) this.marker.copy(hit.point);
    this.invalidate();
    this.onPick(run, hit ? this.describe(hit) : null);
  }

  describe(hit) {
    const { mesh, chunk, recording } = hit.object.userData;
    // The nearest corner's measures.
    const position = hit.object.geometry.getAttribute('position');
    const local = hit.object.worldToLocal(hit.point.clone());
    const corners = [hit.face.a, hit.face.b, hit.face.c];
    const distance = (v) => new THREE.Vector3().fromBufferAttribute(position, v).distanceTo(local);
    const v = corners.reduce((best, each) => (distance(each) < distance(best) ? each : best));
    return {
      name: recording.names.get(chunk.id) ?? null,  // of none of the true objects
      id: chunk.id,
      layer: chunk.layer,
      error_mm: mesh.error[v] === 255 ? null : 1e3 * mesh.error[v] * recording.error_step_m,
      age_frames: mesh.age[v] === 255 ? null : Math.round(mesh.age[v] * recording.age_step_frames),
      at: local.toArray(),  // what moves is lifted
    };
  }
}
