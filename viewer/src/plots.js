// Plots over the frames, with the images of the chosen frame beside them.
import uPlot from 'uplot';
import { el, themeColour } from './dom.js';
import { colourOfRun, dashOfRun, isKnown, measureOf, shortLabel, valueOf } from './measures.js';
import { nearestFrame } from './state.js';

const kFromCsv = ['table_preservation_behind_other', 'table_hole_area_cm2', 'movers_completion',
  'visible_completion', 'ghost_area_cm2', 'revealed_ghost_area_cm2', 'revealed_unseen_area_cm2'];
const kHeight = 190;

function seriesFromCsv(column) {
  return (run) => run.rows.map((row) => [row.frame, valueOf(row, column)]);
}

function framesOf(run) {
  return run.recording.frames.map((each) => each.frame);
}

function perFrame(read) {
  return (run) => {
    if (!run.recorded) return [];
    return framesOf(run).map((frame, i) => [frame, read(run.recorded, i)]);
  };
}

function worstPositionError(run) {
  const worst = new Map();
  for (const list of Object.values(run.recorded?.position_error_mm ?? {})) {
    for (const [frame, error] of list ?? []) worst.set(frame, Math.max(worst.get(frame) ?? 0, error));
  }
  return [...worst].sort((a, b) => a[0] - b[0]);
}

const kSteps = {
  // Older recordings have three of the steps alone.
  all: ['All steps', (r, i) => r.all_ms?.[i] ?? r.track_ms[i] + r.update_poses_ms[i] + r.fuse_ms[i]],
  fuse: ['Fuse', (r, i) => r.fuse_ms[i]],
  move: ['Move the objects', (r, i) => r.update_poses_ms[i]],
  track: ['Track', (r, i) => r.track_ms[i]],
};

function chartsOf(data) {
  const has = (column) => data.runs.some((run) => run.rows.some((row) => typeof row[column] === 'number'));
  const known = kFromCsv.filter(has);
  // Columns that the page does not know are still plotted.
  const skipped = new Set(['frame', 'method', 'profile', 'poses', 'mesh_s', 'evaluate_s']);
  const unknown = [...new Set(data.reports.flatMap((report) => report.csv.columns))]
    .filter((column) => !skipped.has(column) && !isKnown(column) && has(column));
  const charts = [...known, ...unknown].map((column) => {
    const measure = measureOf(column);
    return { title: measure.title, unit: measure.unit, decimals: measure.decimals, about: measure.about,
             read: seriesFromCsv(column), points: true };
  });
  if (data.runs.some((run) => worstPositionError(run).some(([, error]) => error > 0.001))) {
    charts.push({ title: 'Position error of the worst moving object', unit: 'mm', decimals: 1,
                  about: 'Distance of the mapped from the true position, both from the first common frame on', read: worstPositionError });
  }
  if (data.runs.some((run) => run.recorded)) {
    charts.push({ title: 'Time a frame', unit: 'ms', decimals: 1, steps: true,
                  about: 'On the machine that made the comparison, where the maps took turns; rare slow frames go over the edge' });
    charts.push({ title: 'Memory of the map', unit: 'MB', decimals: 1, about: 'Blocks and tables', read: perFrame((r, i) => r.memory_mb[i] ?? null) });
  }
  return charts;
}

function alignedData(lists) {
  const frames = [...new Set(lists.flatMap((list) => list.map(([frame]) => frame)))].sort((a, b) => a - b);
  return [frames, ...lists.map((list) => {
    const values = new Map(list);
    return frames.map((frame) => values.get(frame) ?? null);
  })];
}

// A line at the frame that is shown.
function markFrame(u, frame) {
  const x = u.valToPos(frame, 'x', true);
  const { ctx } = u;
  ctx.save();
  ctx.strokeStyle = themeColour('--accent');
  ctx.lineWidth = 1.5 * devicePixelRatio;
  ctx.setLineDash([4 * devicePixelRatio, 3 * devicePixelRatio]);
  ctx.beginPath();
  ctx.moveTo(x, u.bbox.top);
  ctx.lineTo(x, u.bbox.top + u.bbox.height);
  ctx.stroke();
  ctx.restore();
}

// A rare slow frame must not flatten all others: the scale ends above 98 % of the values.
function usual(u, high) {
  const values = u.data.slice(1).flat().filter((value) => value !== null).sort((a, b) => a - b);
  return values.length ? Math.min(high, 1.3 * values[Math.floor(0.98 * (values.length - 1))]) : high;
}

function rangeOf(low, high, unit) {
  if (low === null || high === null) return [0, 1];
  const room = Math.max((high - low) * 0.08, Math.abs(high) * 0.01, 1e-6);
  if (unit === '%') return [Math.max(0, low - room), Math.min(100.5, high + room)];
  return [low >= 0 ? Math.max(0, low - (high - low) * 4) : low - room, high + room];
}

function plotOptions(chart, data, state, runs, width) {
  const dark = state.get('dark');
  const line = themeColour('--line');
  const text = themeColour('--quiet');
  const axis = { stroke: text, grid: { stroke: line, width: 1 }, ticks: { stroke: line, width: 1 }, font: '12px system-ui, sans-serif' };
  const show = (u, value) => (value === null || value === undefined ? '–' : `${value.toFixed(chart.decimals)} ${chart.unit}`);
  return {
    width, height: kHeight,
    cursor: { sync: { key: 'frames', scales: ['x', null] }, drag: { x: false, y: false }, focus: { prox: 24 } },
    scales: { x: { time: false }, y: { range: (u, low, high) => rangeOf(low, chart.steps ? usual(u, high) : high, chart.unit) } },
    axes: [{ ...axis, size: 28 }, { ...axis, size: 52 }],
    series: [
      { label: 'frame', value: (u, value) => (value === null || value === undefined ? '–' : String(value)) },
      ...runs.map((run) => ({
        label: shortLabel(run, runs), stroke: colourOfRun(run, dark), width: 2, dash: dashOfRun(run, data.runs),
        points: { show: Boolean(chart.points), size: 6 }, spanGaps: true, value: show,
      })),
    ],
    hooks: { draw: [(u) => markFrame(u, state.get('frame'))] },
  };
}

function makeChart(chart, data, state, frames) {
  const holder = el('div', { class: 'plot' });
  let step = 'all';
  const steps = chart.steps ? el('select', {
    'aria-label': 'Step',
    onchange: () => { step = steps.value; draw(); },
  }, Object.entries(kSteps).map(([value, [text]]) => el('option', { value }, text))) : null;
  const part = el('figure', { class: 'chart', 'data-chart': chart.title },
    el('figcaption', { title: chart.about }, el('b', {}, chart.title),
      chart.unit ? el('span', { class: 'quiet' }, `, ${chart.unit}`) : null, steps), holder);
  const width = () => Math.max(holder.clientWidth, 200);
  let plot = null;

  function draw() {
    plot?.destroy();
    const runs = data.runs.filter((run) => state.get('shown').has(run.key));
    const read = chart.steps ? perFrame(kSteps[step][1]) : chart.read;
    plot = new uPlot(plotOptions(chart, data, state, runs, width()), alignedData(runs.map(read)), holder);
    plot.over.addEventListener('click', () => {
      const at = plot.cursor.idx;
      if (at === null || at === undefined) return;
      state.set({ frame: nearestFrame(frames, plot.data[0][at]) });
    });
  }

  // Drawn once it is laid out, and again for other maps or another theme.
  const ready = new Promise((resolve) => requestAnimationFrame(resolve));
  let drawn = false;
  ready.then(() => {
    drawn = true;
    draw();
    new ResizeObserver(() => plot?.setSize({ width: width(), height: kHeight })).observe(holder);
  });
  state.watch(['shown', 'dark'], () => drawn && draw());
  state.watch(['frame'], () => plot?.redraw(false));
  return part;
}

// Whether maps of the report were given the recorded masks.
function takesMasks(report) {
  return report.summary.runs.some((run) => (run.segmentation ?? 'gt') === 'gt');
}

function imagesPart(data, state) {
  const recorded = data.reports.filter((report) => report.recording);
  if (!recorded.length) return null;
  const title = el('h3', {});
  const images = ['colour', 'depth', 'mask'].map((kind) => {
    const image = el('img', {});
    const caption = el('figcaption', {});
    return { kind, image, caption, part: el('figure', {}, image, caption) };
  });
  state.watch(['frame', 'shown'], () => {
    const frame = state.get('frame');
    const keyOf = (report) => report.recording.key_frames.find((each) => each.frame === frame);
    const isShown = (report) => data.runs.some((run) => data.reports[run.report] === report && state.get('shown').has(run.key));
    const report = recorded.find((each) => isShown(each) && keyOf(each)) ?? recorded.find(keyOf);
    title.textContent = `Frame ${frame}, as the maps saw it`;
    for (const { part } of images) part.hidden = !report;
    if (!report) return;
    const [near, far] = report.recording.depth_range_m;
    const words = {
      colour: 'Colour',
      depth: `Depth, ${near.toFixed(1)} m (red) to ${far.toFixed(1)} m (blue)`,
      mask: takesMasks(report) ? 'Mask, a colour an object' : 'The sequence’s mask, which these maps were not given',
    };
    for (const { kind, image, caption } of images) {
      image.src = report.recording.image(keyOf(report)[kind]);
      image.alt = caption.textContent = words[kind];
    }
  });
  return el('aside', { class: 'images' }, title, images.map((each) => each.part));
}

export function plotsPart(data, state, frames) {
  return el('section', { id: 'plots' }, el('h2', {}, 'Over time'),
    el('p', { class: 'quiet' }, 'Point at a line for its values; a click takes the page to the nearest recorded frame.'),
    el('div', { class: 'with-images' },
      el('div', { class: 'charts' }, chartsOf(data).map((chart) => makeChart(chart, data, state, frames))),
      imagesPart(data, state)));
}
