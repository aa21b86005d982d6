// The top of the page: the question, the verdict, three numbers.
import { el, fixed } from './dom.js';
import { colourOfRun, measureOf, textOf, valueOf } from './measures.js';

const kNumbers = ['table_preservation_behind_other', 'table_hole_area_cm2', 'movers_completion'];
// Of the maps of one setting, the one that the page is about.
const kHeroes = ['tsdf++/anchored', 'tsdf++', 'tsdf++/literal', 'volumes'];

export function examinedFrame(report) {
  return report.summary.reveal_frame ?? report.summary.last_frame;
}

// "frame 96", or "frame 96 (A), 64 (B)" where comparisons are examined at different ones.
export function examinedText(data) {
  const frames = data.reports.map(examinedFrame);
  if (frames.every((frame) => frame === frames[0])) return `frame ${frames[0]}`;
  return `frame ${frames.map((frame, i) => `${frame} (${data.reports[i].letter})`).join(', ')}`;
}

export function examinedRow(data, run) {
  const frame = examinedFrame(data.reports[run.report]);
  return run.rows.find((row) => row.frame === frame) ?? run.rows[run.rows.length - 1];
}

// The settings (report, profile, poses) that were run, each with its maps.
export function settingsOf(runs) {
  const settings = new Map();
  for (const run of runs) {
    const key = `${run.report} ${run.profile} ${run.poses}`;
    if (!settings.has(key)) settings.set(key, []);
    settings.get(key).push(run);
  }
  return [...settings.values()];
}

export function heroOf(runs) {
  return kHeroes.map((method) => runs.find((run) => run.method === method)).find(Boolean) ??
         runs[runs.length - 1];
}

function settingText(data, run) {
  const several = data.reports.length > 1 ? `${data.reports[run.report].letter}, ` : '';
  return `${several}profile ${run.profile}, ${run.poses === 'gt' ? 'given poses' : 'tracked poses'}`;
}

// "keeps 99.2 % of the hidden table and 90 % of the moving objects"
function keeps(data, run) {
  const row = examinedRow(data, run);
  const parts = [];
  const table = valueOf(row, kNumbers[0]);
  const objects = valueOf(row, kNumbers[2]);
  if (table !== null) parts.push(`${fixed(table, 1)} % of the hidden table`);
  if (objects !== null) parts.push(`${fixed(objects, 1)} % of the moving objects`);
  return parts.length ? parts.join(' and ') : null;
}

function verdictLine(data, runs) {
  const hero = heroOf(runs);
  const baseline = runs.find((run) => run.method === 'tsdf' && run !== hero);
  const ours = keeps(data, hero);
  if (!ours) {
    return el('p', {}, `${settingText(data, hero)}: nothing that was seen is hidden by a moving object at frame ${
      examinedFrame(data.reports[hero.report])}, so there is nothing to keep.`);
  }
  const theirs = baseline ? keeps(data, baseline) : null;
  return el('p', {},
    el('b', {}, hero.method), ` keeps ${ours}`,
    theirs ? [', ', el('b', {}, baseline.method), ` ${theirs}`] : null,
    el('span', { class: 'quiet' }, ` (${settingText(data, hero)})`), '.');
}

// "11 of 12 gates hold (profile quick), 13 of 13 sabotages are caught"
export function gatesSummary({ controls, gates, sabotages, profile }) {
  const held = gates.filter((gate) => gate.verdict === 'pass').length;
  const bad = controls.filter((control) => control.verdict !== 'pass').length;
  const caught = sabotages.filter((sabotage) => sabotage.caught).length;
  return [`${held} of ${gates.length} gates hold (profile ${profile})`,
    bad ? `${bad} of ${controls.length} controls fail` : null,
    sabotages.length ? `${caught} of ${sabotages.length} sabotages are caught` : null].filter(Boolean).join(', ');
}

// What keeps a comparison from being what it seems: maps that failed, an early end, a stand-in for the truth, what the
// maps remark.
function notesOf({ summary }) {
  const adapters = (summary.adapters ?? []).filter((each) => each.failure);
  return [
    summary.stopped ? `It ended early: ${summary.stopped}` : null,
    summary.truth ?? null,
    ...(summary.failed ?? []).map((each) => `${each.title} failed at frame ${each.frame}, and is not shown: ${each.failure}`),
    ...adapters.map((each) => `${each.name} failed, and is not shown: ${each.failure}`),
    ...summary.runs.flatMap((run) => (run.remarks ?? []).map((remark) => `${run.title}: ${remark}`)),
  ].filter(Boolean);
}

function notesPart(data) {
  const notes = data.reports.flatMap((report) => notesOf(report)
    .map((note) => el('li', {}, data.reports.length > 1 ? `${report.letter}: ` : '', note)));
  return notes.length ? el('ul', { class: 'message notes' }, notes) : null;
}

export function headerPart(data) {
  const report = data.reports[0];
  const { summary } = report;
  return el('header', { class: 'top' },
    el('p', { class: 'kicker' }, data.reports.map((each) => each.name).join(' and '),
      ` · sequence ${summary.sequence} · frames ${summary.first_frame} to ${summary.last_frame}`),
    el('h1', {}, 'What does a map keep of what it can no longer see?'),
    el('div', { class: 'verdict' }, settingsOf(data.runs).map((runs) => verdictLine(data, runs))),
    notesPart(data),
    data.gates ? el('p', { class: 'quiet' }, el('a', { href: '#gates' }, `${gatesSummary(data.gates)}.`)) : null);
}

function card(data, column, runs, dark) {
  const measure = measureOf(column);
  const hero = heroOf(runs);
  const values = runs.map((run) => valueOf(examinedRow(data, run), column));
  const most = measure.unit === '%' ? 100 : Math.max(...values.filter((value) => value !== null), 1e-9);
  const value = valueOf(examinedRow(data, hero), column);
  const number = value === null ? '–' : value.toFixed(measure.decimals);
  return el('section', { class: 'card' },
    el('h3', {}, measure.title),
    el('p', { class: 'big' }, number, el('span', { class: 'unit' }, ` ${measure.unit}`),
      el('span', { class: 'of' }, hero.method)),
    el('ul', { class: 'bars' }, runs.map((run, i) => {
      const bar = el('span', { class: 'bar' });
      bar.style.width = `${values[i] === null ? 0 : Math.max(0.5, (100 * values[i]) / most)}%`;
      bar.style.background = colourOfRun(run, dark);
      return el('li', {}, el('span', { class: 'name' }, run.method),
        el('span', { class: 'track' }, bar), el('span', { class: 'value' }, textOf(values[i], measure)));
    })),
    el('p', { class: 'about' }, `${measure.about}.`));
}

// The cards of the setting that the shown maps begin with.
export function cardsPart(data, state) {
  const part = el('div', { class: 'cards' });
  state.watch(['shown', 'dark'], () => {
    const first = data.runs.find((run) => state.get('shown').has(run.key)) ?? data.runs[0];
    const runs = settingsOf(data.runs).find((list) => list.includes(first));
    part.replaceChildren(...kNumbers.map((column) => card(data, column, runs, state.get('dark'))));
  });
  return part;
}
