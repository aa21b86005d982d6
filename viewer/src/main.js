import { append, el } from './dom.js';
import { loadData } from './data.js';
import { State } from './state.js';
import { cardsPart, examinedFrame, headerPart, settingsOf } from './summary.js';
import { barPart } from './bar.js';
import { figurePart, tablePicturesPart } from './figure.js';
import { viewPart } from './views.js';
import { plotsPart } from './plots.js';
import { gatesPart } from './gates.js';
import { originPart, tablesPart } from './tables.js';

function start(app) {
  const data = loadData();
  document.title = `${data.reports.map((report) => report.name).join(' and ')}: what the map keeps`;
  const keys = data.reports.flatMap((report) => report.recording?.key_frames ?? []);
  const frames = [...new Set((keys.length ? keys : data.runs.flatMap((run) => run.rows)).map((each) => each.frame))]
    .sort((a, b) => a - b);
  const examined = examinedFrame(data.reports[0]);
  const theme = matchMedia('(prefers-color-scheme: dark)');
  const state = new State({
    shown: new Set(settingsOf(data.runs)[0].map((run) => run.key)),
    frame: frames.includes(examined) ? examined : frames[frames.length - 1],
    dark: theme.matches,
    colour: 'object', pull: 0, hidden: false, truth: false, path: false,
  });
  theme.addEventListener('change', () => state.set({ dark: theme.matches }));
  state.watch(['dark'], () => {
    document.documentElement.dataset.theme = state.get('dark') ? 'dark' : 'light';
  });
  append(app, [
    headerPart(data), cardsPart(data, state), barPart(data, state, frames), figurePart(data, state),
    viewPart(data, state), plotsPart(data, state, frames), tablePicturesPart(data), tablesPart(data),
    gatesPart(data), originPart(data)]);
  window.report = { data, state, frames };
}

const app = document.getElementById('app');
try {
  start(app);
} catch (error) {
  append(app, [el('p', { class: 'message' }, `This report cannot be shown: ${error.message}`)]);
  throw error;
}
