// Tables that sort by a click on a title and leave as CSV.
import { download, el } from './dom.js';
import { measureOf, metricColumns, shortLabel, textOf, valueOf } from './measures.js';
import { measured } from './data.js';
import { examinedRow, examinedText } from './summary.js';

function csvCell(value) {
  const text = value === null || value === undefined ? '' : String(value);
  return /[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
}

// columns: [{ title, about, unit, decimals, long, draw }], the first of words; rows: lists of words or
// numbers. `long` words may break into lines; `draw` makes an element of a cell.
export function sortableTable(name, columns, rows) {
  const cellOf = (column, cell) => {
    if (column.draw) return column.draw(cell);
    return typeof cell === 'number' ? cell.toFixed(column.decimals ?? 0) : cell ?? '–';
  };
  const body = el('tbody');
  let order = { column: -1, up: true };
  const draw = () => {
    const list = [...rows];
    if (order.column >= 0) {
      const sign = order.up ? 1 : -1;
      list.sort((a, b) => {
        const [x, y] = [a[order.column], b[order.column]];
        // What has no value stays at the end.
        if (x === null || y === null) return (x === null) - (y === null);
        return sign * (typeof x === 'number' && typeof y === 'number' ? x - y : String(x).localeCompare(String(y)));
      });
    }
    body.replaceChildren(...list.map((row) => el('tr', {}, row.map((cell, c) => (c === 0
      ? el('th', { scope: 'row' }, cell)
      : el('td', { class: columns[c].long ? 'long' : null }, cellOf(columns[c], cell)))))));
    heads.forEach((head, c) => {
      if (c === order.column) head.setAttribute('aria-sort', order.up ? 'ascending' : 'descending');
      else head.removeAttribute('aria-sort');
    });
  };
  const heads = columns.map((column, c) => el('th', { scope: 'col', title: column.about, class: column.long ? 'long' : null },
    el('button', {
      type: 'button',
      onclick: () => {
        order = { column: c, up: order.column === c ? !order.up : true };
        draw();
      },
    }, column.title, column.unit ? el('span', { class: 'quiet' }, ` ${column.unit}`) : null)));
  draw();
  const save = el('button', {
    type: 'button', class: 'save',
    onclick: () => download(`${name}.csv`, [columns.map((column) => csvCell(
      column.unit ? `${column.title} (${column.unit})` : column.title)), ...rows.map((row) => row.map(csvCell))]
      .map((line) => line.join(',')).join('\n') + '\n', 'text/csv'),
  }, 'Download CSV');
  return el('div', { class: 'table', 'data-table': name },
    el('div', { class: 'scroll' }, el('table', {}, el('thead', {}, el('tr', {}, heads)), body)), save);
}

function figuresTable(data) {
  const columns = [...new Set(data.reports.flatMap((report) => report.csv.columns))]
    .filter((column) => !['frame', 'method', 'profile', 'poses', 'mesh_s', 'evaluate_s'].includes(column));
  const times = [['track', 'Track'], ['update_poses', 'Move'], ['fuse', 'Fuse'], ['mesh_scene', 'Mesh']];
  const median = (run, step) => run.times?.[step]?.median_ms ?? null;
  return sortableTable('figures', [
    { title: 'Map' },
    ...columns.map((column) => measureOf(column)),
    ...times.map(([, title]) => ({ title, unit: 'ms', decimals: 1, about: 'Median a frame' })),
    { title: 'Memory', unit: 'MB', decimals: 1 },
  ], data.runs.map((run) => {
    const row = examinedRow(data, run);
    return [shortLabel(run, data.runs), ...columns.map((column) => valueOf(row, column)), ...times.map(([step]) => median(run, step)),
      run.map?.bytes ? run.map.bytes / 1e6 : null];
  }));
}

function objectsTable(data) {
  const scale = (value) => { const number = measured(value); return number === null ? null : 100 * number; };
  return sortableTable('objects', [
    { title: 'Map' }, { title: 'Object' },
    { title: 'Mapped of what was seen', unit: '%', decimals: 1, about: 'Completion at one voxel' },
    { title: 'Mapped of what is visible', unit: '%', decimals: 1 },
    { title: 'Hidden and kept', unit: '%', decimals: 1 },
    { title: 'Hidden', unit: 'cm²', decimals: 0 },
    { title: 'Mean error', unit: 'mm', decimals: 2, about: 'Mean distance of the map to the true surface' },
    { title: 'Label purity', unit: '%', decimals: 1 },
  ], data.runs.flatMap((run) => (run.examined?.objects ?? []).map((object) => {
    const mean = measured(object.accuracy?.mean_m);
    return [shortLabel(run, data.runs), `${object.name} (${object.id})`, scale(object.completion), scale(object.visible_completion),
      scale(object.preservation), object.hidden_area_cm2 ?? null, mean === null ? null : 1e3 * mean, scale(object.label_purity)];
  })));
}

function tracksTable(data) {
  const rows = data.runs.flatMap((run) => Object.entries(run.trajectories ?? {}).map(([id, track]) => {
    const value = (name, scale) => { const number = measured(track[name]); return number === null ? null : scale * number; };
    return [shortLabel(run, data.runs), Number(id), track.frames, value('ate_rmse_m', 1e3), value('rotation_rmse_deg', 1), value('rpe_rmse_m', 1e3)];
  }));
  if (!rows.length) return null;
  return [el('h3', {}, 'Paths of the moving objects'), sortableTable('paths', [
    { title: 'Map' }, { title: 'Object', decimals: 0 }, { title: 'Frames', decimals: 0 },
    { title: 'ATE', unit: 'mm', decimals: 2 }, { title: 'Rotation', unit: 'deg', decimals: 3 },
    { title: 'RPE', unit: 'mm', decimals: 3 },
  ], rows)];
}

// What a metric says of two reports, each a value or null where it is undefined.
function comparedWord(x, y, measure, reports) {
  if (y === null) return `only in ${reports[0].letter}`;
  if (x === null) return `only in ${reports[1].letter}`;
  if (Math.abs(y - x) < 0.5 * 10 ** -measure.decimals) return 'same';
  return (y - x) * measure.better > 0 ? 'better' : 'worse';
}

// A row a map that both reports have: the first, the second, and the difference.
function comparedTable(data) {
  if (data.reports.length < 2) return null;
  const rows = [];
  for (const a of data.runs.filter((run) => run.report === 0)) {
    const b = data.runs.find((run) => run.report === 1 && run.folder === a.folder);
    if (!b) continue;
    for (const column of metricColumns()) {
      const [x, y] = [a, b].map((run) => valueOf(examinedRow(data, run), column));
      if (x === null && y === null) continue;
      const measure = measureOf(column);
      const change = x === null || y === null ? null : y - x;
      rows.push([a.title, measure.title, textOf(x, measure), textOf(y, measure), change,
        comparedWord(x, y, measure, data.reports)]);
    }
  }
  const [a, b] = data.reports;
  return [el('h3', {}, `${b.letter} (${b.name}) against ${a.letter} (${a.name})`), sortableTable('compared', [
    { title: 'Map' }, { title: 'Measure' }, { title: a.letter }, { title: b.letter },
    { title: 'Change', decimals: 2 }, { title: 'So' }], rows)];
}

export function tablesPart(data) {
  const frame = examinedText(data);
  return el('section', { id: 'tables' }, el('h2', {}, 'Figures'),
    el('h3', {}, `All maps at ${frame}`), figuresTable(data), comparedTable(data),
    el('h3', {}, `Object by object at ${frame}`), objectsTable(data), tracksTable(data));
}

function settingsTable(data) {
  const names = [...new Set(data.runs.flatMap((run) => Object.keys(run.settings ?? {})))];
  return sortableTable('settings', [{ title: 'Map' }, ...names.map((name) => ({ title: name }))],
    data.runs.map((run) => [shortLabel(run, data.runs), ...names.map((name) => {
      const value = run.settings?.[name];
      return value === undefined ? null : String(value);
    })]));
}

export function originPart(data) {
  const copy = (text) => {
    const button = el('button', {
      type: 'button',
      onclick: () => navigator.clipboard?.writeText(text).then(
        () => { button.textContent = 'Copied'; }, () => { button.textContent = 'Not allowed here'; }),
    }, 'Copy');
    return el('div', { class: 'command' }, el('code', {}, text), button);
  };
  const facts = (report) => {
    const { summary } = report;
    const list = [
      ['sequence', summary.sequence], ['frames', `${summary.first_frame} to ${summary.last_frame}, evaluated every ${summary.every}`],
      ['taken out', (summary.removed ?? []).length ? `objects ${summary.removed.join(', ')} after frame ${summary.reveal_frame ?? '–'}` : 'nothing'],
      ['made by', `${summary.generator} ${summary.version}`], ['cores', summary.cores],
      ...Object.entries(summary).filter(([key]) => ['seed', 'renderer', 'backend', 'mujoco', 'machine'].includes(key)),
      ['rendering or reading', `${summary.read_s?.toFixed(1)} s`], ['all', `${summary.total_s?.toFixed(1)} s`],
      ...report.files.map((file) => [file.name, `${file.bytes} bytes, ${file.hash}`]),
    ];
    return el('dl', {}, list.map(([name, value]) => [el('dt', {}, name), el('dd', {}, typeof value === 'object' ? JSON.stringify(value) : value)]));
  };
  return el('section', { id: 'origin' }, el('h2', {}, 'How this was made'),
    data.reports.map((report) => [
      el('h3', {}, data.reports.length > 1 ? `${report.letter}: ${report.name}` : report.name),
      copy(report.summary.command), facts(report)]),
    el('h3', {}, 'This page'), copy(data.command),
    el('p', { class: 'quiet' }, `tsdfpp ${data.version}. The full meshes lie in the folders of the maps, beside this page.`),
    el('h3', {}, 'Settings'), settingsTable(data));
}
