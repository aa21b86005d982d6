// What the columns of frames.csv are called and how they are shown. All of it is the program's table of metrics
// (`tsdfpp metric list --json`), which the page's data has. Unknown columns are shown by their names.

const kDirections = { higher: 1, lower: -1 };
const kErrorEnd = '_se';  // of the column with a metric's standard error

// By column. `better` is 1 or -1; a standard error has none.
const measures = new Map();

function sentence(words) {
  return words.charAt(0).toUpperCase() + words.slice(1);
}

// Shares and ratios have no unit; they are shown in %, to the same digit.
function measureOfMetric({ words, unit, better, decimals, definition }) {
  const share = unit === '';
  return {
    title: sentence(words), about: sentence(definition), better: kDirections[better],
    scale: share ? 100 : 1, unit: share ? '%' : unit, decimals: share ? Math.max(0, decimals - 2) : decimals,
  };
}

function errorOf({ title, unit, scale, decimals }) {
  return { title: `${title}, standard error`, about: 'Of the sampling of the map alone', unit, scale, decimals: decimals + 1 };
}

export function learnMetrics(metrics) {
  for (const metric of metrics) {
    const measure = measureOfMetric(metric);
    measures.set(metric.name, measure);
    measures.set(metric.name + kErrorEnd, errorOf(measure));
  }
}

export function isKnown(column) {
  return measures.has(column);
}

// Those of which more or less is better, in the table's order.
export function metricColumns() {
  return [...measures.keys()].filter((column) => measures.get(column).better);
}

export function measureOf(column) {
  return measures.get(column) ?? { title: column, unit: '', scale: 1, decimals: 3, about: '' };
}

export function valueOf(row, column) {
  const value = row?.[column];
  return typeof value === 'number' ? value * measureOf(column).scale : null;
}

export function textOf(value, measure) {
  if (value === null || value === undefined) return '–';
  const space = measure.unit === '' ? '' : ' ';
  return `${value.toFixed(measure.decimals)}${space}${measure.unit}`;
}

// A map's name without what all of `all` share.
export function shortLabel(run, all) {
  const parts = run.label.split(', ');
  const others = all.map((other) => other.label.split(', '));
  return parts.filter((part, i) => i === 0 || others.some((other) => other[i] !== part)).join(', ');
}

// The method's colour, as mapper/method_info.cc has it; a dash a truncation profile.
export function colourOfRun(run, dark) {
  return (run.colours ?? ['#444444', '#cccccc'])[dark ? 1 : 0];
}

export function dashOfRun(run, runs) {
  const settings = [...new Set(runs.map((other) => `${other.report} ${other.profile} ${other.poses}`))];
  const patterns = [[], [8, 5], [2, 4], [12, 4, 2, 4]];
  return patterns[settings.indexOf(`${run.report} ${run.profile} ${run.poses}`) % patterns.length];
}
