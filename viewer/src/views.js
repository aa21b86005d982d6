// The section of the 3-D view: panels, its controls, and pictures where there is no WebGL.
import { el, fixed } from './dom.js';
import { cssRamp, kErrorFull_m, kLost, kRemembered } from './meshes.js';
import { shortLabel } from './measures.js';
import { View3d, webglWorks } from './view3d.js';

const kColours = [['object', 'Object'], ['seen', 'Camera colour'], ['error', 'Error'], ['age', 'Age']];
const kLayerWords = {
  common: '', hole: 'hidden, and lost', gone: 'goes with the moving objects', revealed: 'hidden, and remembered', mover: 'taken out by the slider',
};

const kHint = 'Drag to turn, wheel or pinch to come nearer, click to ask what is there. Keys: arrows turn, + and − come nearer, ' +
  'Enter asks at the middle of the first map.';

function legend(state, recording) {
  const part = el('div', { class: 'legend' });
  state.watch(['colour'], () => {
    const colour = state.get('colour');
    part.replaceChildren();
    const swatch = (rgb, text) => {
      const box = el('span', { class: 'swatch' });
      box.style.background = `rgb(${rgb.join(' ')})`;
      part.append(el('span', { class: 'entry' }, box, text));
    };
    const gradient = (kind, low, high) => {
      const box = el('span', { class: 'ramp' });
      box.style.background = `linear-gradient(to right, ${cssRamp(kind).join(',')})`;
      part.append(el('span', { class: 'entry' }, low, box, high));
    };
    if (colour === 'object') {
      for (const object of recording.objects) swatch(object.colour, object.name);
      swatch(kRemembered, 'hidden, and remembered');
      swatch(kLost, 'hidden, and lost');
    } else if (colour === 'seen') {
      part.append('The colour that the map holds.');
    } else if (colour === 'error') {
      gradient('error', '0', `${1e3 * kErrorFull_m} mm or more from the true surface`);
    } else {
      gradient('age', 'seen now', `${Math.round(254 * recording.age_step_frames)} frames ago`);
      swatch([120, 120, 120], 'never seen by the camera');
    }
  });
  return part;
}

function switchBox(state, name, text, title) {
  const box = el('input', { type: 'checkbox', onchange: () => state.set({ [name]: box.checked }) });
  state.watch([name], () => { box.checked = state.get(name); });
  return el('label', { class: 'switch', title }, box, text);
}

function panelOf(run, all) {
  return el('div', { class: 'panel', 'data-run': run.key },
    el('div', { class: 'panel-title' }, shortLabel(run, all)),
    el('div', { class: 'stage' }, el('span', { class: 'mark', hidden: true })));
}

// Pictures in place of the view, from the recorded camera.
function pictures(runs, state) {
  const holder = el('div', { class: 'panels still' });
  state.watch(['frame', 'shown', 'pull'], () => {
    holder.replaceChildren(...runs().map((run) => {
      const key = run.recorded.key_frames.find((each) => each.frame === state.get('frame'));
      const place = state.get('pull') > 0 && key?.picture_after ? key.picture_after : key?.picture;
      return el('div', { class: 'panel' }, el('div', { class: 'panel-title' }, run.label),
        place ? el('img', { src: run.recording.image(place), alt: `${run.label} at frame ${key.frame}` }) : '–');
    }));
  });
  return holder;
}

function pullControl(state) {
  const pull = el('input', {
    type: 'range', id: 'pull', min: 0, max: 100, step: 1,
    oninput: () => state.set({ pull: Number(pull.value) / 100 }),
  });
  state.watch(['pull'], () => { pull.value = String(Math.round(100 * state.get('pull'))); });
  return el('label', { class: 'pull', for: 'pull' }, 'Pull the moving objects away', pull);
}

function colourControl(state) {
  const select = el('select', { id: 'colour-by', onchange: () => state.set({ colour: select.value }) },
    kColours.map(([value, text]) => el('option', { value }, text)));
  state.watch(['colour'], () => { select.value = state.get('colour'); });
  return el('label', { class: 'choice', for: 'colour-by' }, 'Colour', select);
}

// What moves the camera; `view` says which view there is, if any yet.
function cameraButtons(recording, state, view) {
  const button = (text, action) => el('button', { type: 'button', onclick: () => view() && action(view()) }, text);
  return el('span', { class: 'buttons' },
    button('Camera’s view', (of) => of.lookAsCamera(recording, state.get('frame'))),
    button('From above', (of) => of.lookFromAbove(recording, state.get('frame'))),
    button('Reset', (of) => of.lookAsCamera(recording, state.get('frame'), 1.12)));
}

// What was asked for in a panel, in words.
function describe(run, hit) {
  if (!hit) return `${run.label}: nothing there.`;
  const place = hit.at.map((x) => x.toFixed(3)).join(', ');
  if (hit.layer === 'hole') {
    return `${run.label}: table that was seen, is hidden, and is lost; at ${place} m.`;
  }
  if (hit.name === null) return `${run.label}: surface that is none of the true objects'; at ${place} m.`;
  const words = kLayerWords[hit.layer];
  const error = hit.error_mm === null ? 'more than 51 mm' : `${fixed(hit.error_mm, 1)} mm`;
  const age = hit.age_frames === null ? 'never seen by the camera'
    : hit.age_frames === 0 ? 'in sight now' : `last in sight ${hit.age_frames} frames ago`;
  return `${run.label}: ${hit.name} (id ${hit.id})${words ? `, ${words}` : ''}; ${error} from the true surface; ${age}; at ${place} m.`;
}

// Comparisons may have been recorded at different frames.
function nameWhatIsThere(panels, runs, frame) {
  runs.forEach((run, i) => {
    const isThere = run.recorded.key_frames.some((key) => key.frame === frame);
    panels.children[i].querySelector('.panel-title').textContent =
      `${shortLabel(run, runs)}${isThere ? '' : ', not recorded at this frame'}`;
  });
}

// The view shows what the state says.
function follow(view, panels, runs, recording, state) {
  state.watch(['shown'], () => {
    for (const old of view.panels()) old.remove();
    panels.prepend(...runs().map((run) => panelOf(run, runs())));
    panels.dataset.count = String(runs().length);
    nameWhatIsThere(panels, runs(), state.get('frame'));
    view.setRuns(runs());
  });
  state.watch(['colour', 'pull', 'hidden', 'truth', 'path'], () => view.setOptions({
    colour: state.get('colour'), pull: state.get('pull'), hidden: state.get('hidden'),
    truth: state.get('truth'), path: state.get('path'),
  }));
  let first = true;
  state.watch(['frame'], () => {
    view.setFrame(state.get('frame'));
    nameWhatIsThere(panels, runs(), state.get('frame'));
    if (first) view.lookAsCamera(recording, state.get('frame'), 1.12);
    first = false;
  });
}

function listenToKeys(panels, view) {
  const step = 0.12;
  const keys = {
    ArrowLeft: () => view.turn3d(-step, 0), ArrowRight: () => view.turn3d(step, 0),
    ArrowUp: () => view.turn3d(0, step), ArrowDown: () => view.turn3d(0, -step),
    '+': () => view.turn3d(0, 0, 1.15), '=': () => view.turn3d(0, 0, 1.15), '-': () => view.turn3d(0, 0, 1 / 1.15),
    Enter: () => {
      const box = view.panels()[0].querySelector('.stage').getBoundingClientRect();
      view.pick(box.left + box.width / 2, box.top + box.height / 2);
    },
  };
  panels.addEventListener('keydown', (event) => {
    if (!keys[event.key] || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    keys[event.key]();
  });
}

// Calls `start` once, when the element comes near the window.
function whenNear(element, start) {
  new IntersectionObserver((entries, observer) => {
    if (!entries.some((entry) => entry.isIntersecting)) return;
    observer.disconnect();
    start();
  }, { rootMargin: '300px' }).observe(element);
}

export function viewPart(data, state) {
  const recording = data.reports.find((report) => report.recording)?.recording;
  const part = el('section', { id: 'view' }, el('h2', {}, 'Look for yourself'));
  if (!recording) {
    part.append(el('p', { class: 'message' },
      data.reports.some((report) => report.summary.stopped)
        ? 'This comparison ended early, so there are no meshes to show here.'
        : 'This comparison was made without --record, so there are no meshes to show here.'));
    return part;
  }
  const runs = () => data.runs.filter((run) => run.recorded && state.get('shown').has(run.key));
  const pull = recording.objects.some((object) => object.removed) ? pullControl(state) : null;
  if (!webglWorks()) {
    part.append(
      el('p', { class: 'message' }, 'This browser has no WebGL, so here are pictures in place of the 3-D view.'),
      el('div', { class: 'controls' }, pull), pictures(runs, state));
    return part;
  }

  const picked = el('output', { class: 'picked', 'aria-live': 'polite' });
  // What was asked for is of one frame, and of what is shown.
  state.watch(['frame', 'shown', 'pull'], () => { picked.textContent = kHint; });
  const panels = el('div', { class: 'panels', tabindex: 0, role: 'application', 'aria-label': '3-D view of the maps' });
  part.append(
    el('div', { class: 'controls' }, pull, colourControl(state),
      switchBox(state, 'hidden', 'See through', 'The moving objects become glass, and what is remembered under them shows'),
      switchBox(state, 'truth', 'True surface', 'The true surface, in teal, just behind the map: it shows where the map has none, or nothing was seen'),
      switchBox(state, 'path', 'Camera', 'The way of the camera, and what it sees at this frame'),
      cameraButtons(recording, state, () => part.view)),
    panels, legend(state, recording), picked);
  // Decoding and drawing begin when the view comes near the window.
  whenNear(part, () => {
    part.view = new View3d(panels, (run, hit) => { picked.textContent = describe(run, hit); });
    follow(part.view, panels, runs, recording, state);
    listenToKeys(panels, part.view);
  });
  return part;
}
