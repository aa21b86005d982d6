// Verdicts of the gates (docs/gates.md), where the command was given some.
import { el } from './dom.js';
import { measured } from './data.js';
import { gatesSummary } from './summary.js';
import { sortableTable } from './tables.js';

const kMarks = { pass: '✓', caught: '✓', fail: '✗', 'not caught': '✗', inconclusive: '?', invalid: '!' };

// The word says it; mark and colour only help.
function badge(verdict) {
  return el('span', { class: 'badge', 'data-verdict': verdict }, `${kMarks[verdict] ?? '·'} ${verdict}`);
}

const number = (value) => (value === null || value === undefined ? null : Number(value.toPrecision(4)));

function boundsText({ min, max }) {
  if (min !== undefined && max !== undefined) return `${number(min)} to ${number(max)}`;
  return min !== undefined ? `at least ${number(min)}` : `at most ${number(max)}`;
}

function valueText(gate) {
  const mean = measured(gate.mean);
  if (mean === null) return null;
  const [low, high] = gate.interval ?? [mean, mean];
  return low === high ? String(number(mean)) : `${number(mean)} (${number(low)} to ${number(high)})`;
}

function gatesTable({ controls, gates }) {
  return sortableTable('gates', [
    { title: 'Gate' }, { title: 'Verdict', draw: badge },
    { title: 'Now', about: 'Mean over the seeds; in brackets its interval, or the least and greatest' },
    { title: 'Expected' }, { title: 'Figure', long: true }, { title: 'Because', long: true },
  ], [
    ...controls.map((control) => [`${control.name} (control)`, control.verdict,
      number(control.greatest_spread), `at most ${number(control.allowed_spread)}`,
      `spread of ${control.metric} over ${(control.methods ?? []).join(', ')}`, control.why || null]),
    ...gates.map((gate) => [gate.name, gate.verdict, valueText(gate), boundsText(gate.bounds), `${gate.of} (${gate.cells})`,
      gate.bounds_because]),
  ].map((row) => row.map((cell) => (cell === null ? null : String(cell)))));
}

function sabotagesTable({ sabotages }) {
  if (!sabotages.length) return null;
  return [el('h3', {}, 'Broken on purpose, one thing at a time'), sortableTable('sabotages', [
    { title: 'Sabotage' }, { title: 'Verdict', draw: badge },
    { title: 'What is broken', long: true }, { title: 'Noticed by', long: true },
  ], sabotages.map((sabotage) => [sabotage.name, sabotage.caught ? 'caught' : 'not caught', sabotage.words,
    sabotage.gates.map((gate) => (gate.verdict === 'fail' ? gate.name : `${gate.name} is ${gate.verdict}`)).join(', ')]))];
}

// What is behind a gate that does not hold.
function explained(gate, picture) {
  const { replicate, frame, object } = gate.explanation ?? {};
  return el('figure', { class: 'behind' },
    el('figcaption', {}, el('b', {}, gate.name), ` is ${gate.verdict}: ${gate.why ?? ''}.`,
      gate.explanation ? ` Worst at ${[replicate, `frame ${frame}`, object].filter(Boolean).join(' ')}.` : null),
    picture ? el('img', { src: picture, alt: `${gate.name} at frame ${frame}`, loading: 'lazy' }) : null);
}

export function gatesPart(data) {
  const { gates } = data;
  if (!gates) return null;
  return el('section', { id: 'gates' }, el('h2', {}, 'Gates'),
    el('p', {}, `${gatesSummary(gates)}.`),
    gates.sabotage !== 'none' ? el('p', { class: 'message' }, `This was a run with something broken on purpose: ${gates.sabotage}.`) : null,
    gatesTable(gates),
    gates.gates.filter((gate) => gate.verdict !== 'pass').map((gate) => explained(gate, gates.pictures[gate.name])),
    sabotagesTable(gates),
    el('p', { class: 'quiet' }, ['tsdfpp ' + gates.program, gates.renderer, gates.mujoco ? `MuJoCo ${gates.mujoco}` : null,
      gates.machine].filter(Boolean).join('; ')));
}
