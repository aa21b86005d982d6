// The bar that stays in sight: which maps, which frame.
import { el } from './dom.js';
import { colourOfRun, shortLabel } from './measures.js';
import { settingsOf } from './summary.js';

function mapChips(data, state) {
  const chips = el('div', { class: 'chips', role: 'group', 'aria-label': 'Maps shown' });
  const several = settingsOf(data.runs).length > 1;
  if (several) {
    for (const runs of settingsOf(data.runs)) {
      const [run] = runs;
      const name = `${data.reports.length > 1 ? `${data.reports[run.report].letter}: ` : ''}${run.profile}${
        data.runs.some((other) => other.poses !== run.poses) ? `, ${run.poses === 'gt' ? 'given' : 'tracked'}` : ''}`;
      const button = el('button', {
        type: 'button', class: 'chip setting', title: `Show the maps of ${name}`,
        onclick: () => state.set({ shown: new Set(runs.map((each) => each.key)) }),
      }, name);
      chips.append(button);
      state.watch(['shown'], () => {
        const shown = state.get('shown');
        button.setAttribute('aria-pressed',
          String(shown.size === runs.length && runs.every((each) => shown.has(each.key))));
      });
    }
  }
  for (const run of data.runs) {
    const dot = el('span', { class: 'dot' });
    const text = shortLabel(run, data.runs);
    const button = el('button', {
      type: 'button', class: 'chip', 'data-run': run.key,
      onclick: () => {
        const shown = new Set(state.get('shown'));
        if (shown.has(run.key) && shown.size > 1) shown.delete(run.key);
        else shown.add(run.key);
        state.set({ shown });
      },
    }, dot, text);
    chips.append(button);
    state.watch(['shown', 'dark'], () => {
      button.setAttribute('aria-pressed', String(state.get('shown').has(run.key)));
      dot.style.background = colourOfRun(run, state.get('dark'));
    });
  }
  return chips;
}

export function barPart(data, state, frames) {
  const slider = el('input', {
    type: 'range', id: 'frame', min: 0, max: Math.max(frames.length - 1, 0), step: 1,
    'aria-label': 'Frame',
    oninput: () => state.set({ frame: frames[Number(slider.value)] }),
  });
  const number = el('output', { for: 'frame', class: 'frame-number' });
  let timer = null;
  const stop = () => {
    clearInterval(timer);
    timer = null;
    play.textContent = '▶';
    play.setAttribute('aria-label', 'Play');
  };
  const play = el('button', {
    type: 'button', class: 'play', 'aria-label': 'Play',
    onclick: () => {
      if (timer) return stop();
      play.textContent = '❚❚';
      play.setAttribute('aria-label', 'Pause');
      const step = () => {
        const at = frames.indexOf(state.get('frame'));
        if (at === frames.length - 1 && timer) return stop();
        state.set({ frame: frames[(at + 1) % frames.length] });
      };
      if (frames.indexOf(state.get('frame')) === frames.length - 1) state.set({ frame: frames[0] });
      timer = setInterval(step, 900);
      return undefined;
    },
  }, '▶');
  const theme = el('button', {
    type: 'button', class: 'theme', 'aria-label': 'Switch between light and dark',
    onclick: () => state.set({ dark: !state.get('dark') }),
  }, '◐');
  state.watch(['frame'], () => {
    const at = frames.indexOf(state.get('frame'));
    slider.value = String(at);
    slider.setAttribute('aria-valuetext', `frame ${state.get('frame')}`);
    number.textContent = `frame ${state.get('frame')}`;
  });
  return el('nav', { class: 'bar-top', 'aria-label': 'Maps and frame' },
    mapChips(data, state), el('div', { class: 'time' }, play, slider, number, theme));
}
