// The columns of frames.csv that the page knows: what to call them and how to show them. Unknown
// columns are shown by their names.

const percent = { scale: 100, unit: '%', decimals: 1, better: 1 };

const standardError = (of) => ({
  scale: 1, unit: 'cm²', decimals: 1, better: 0, title: `${of}, standard error`, about: 'Of the sampling of the map alone',
});

export const kMeasures = {
  table_preservation_behind_other: {
    ...percent, title: 'Hidden table kept',
    about: 'Share of the table that was seen, is hidden behind a moving object now, and is within one voxel of the map once the objects are taken out',
  },
  table_retention_behind_other: {
    ...percent, title: 'Hidden table retained',
    about: 'The same, over what the map had of it when it was last visible',
  },
  table_hole_area_cm2: {
    scale: 1, unit: 'cm²', decimals: 0, better: -1, title: 'Hole',
    about: 'Area of hidden table that the map no longer has',
  },
  visible_completion: {
    ...percent, title: 'Visible surface mapped',
    about: 'Share of all surface that is visible now and that the visible scene has',
  },
  table_visible_completion: {
    ...percent, title: 'Visible table mapped', about: 'The same of the table',
  },
  movers_completion: {
    ...percent, title: 'Moving objects mapped',
    about: 'Mean share of what was seen of each moving object and is still in the map',
  },
  ghost_area_cm2: {
    scale: 1, unit: 'cm²', decimals: 0, better: -1, title: 'Ghosts',
    about: 'Area of surface in the map where there is nothing, in space that was seen to be free',
  },
  ghost_area_cm2_se: standardError('Ghosts'),
  revealed_ghost_area_cm2: {
    scale: 1, unit: 'cm²', decimals: 0, better: -1, title: 'Ghosts after the removal',
    about: 'Area of surface where there is nothing, once the moving objects are taken out, in space that was seen to be free or held one of them',
  },
  revealed_ghost_area_cm2_se: standardError('Ghosts after the removal'),
  revealed_unseen_area_cm2: {
    scale: 1, unit: 'cm²', decimals: 0, better: -1, title: 'Surface in unseen space after the removal',
    about: 'Area of surface where there is nothing, once the moving objects are taken out, in space that nobody has seen to be free',
  },
  revealed_unseen_area_cm2_se: standardError('Surface in unseen space after the removal'),
  sanity_all: {
    ...percent, title: 'Pixels as seen',
    about: 'Share of mapped pixels where the map, seen from the camera, has the right depth and object',
  },
  sanity_least: {
    ...percent, title: 'Pixels as seen, worst object', about: 'The same of the worst object',
  },
  seam_share: {
    ...percent, decimals: 2, better: -1, title: 'Seams',
    about: 'Share of the background pixels beside objects where the map, seen from the camera, shows nothing, or only what lies behind',
  },
  seam_area_cm2: {
    scale: 1, unit: 'cm²', decimals: 1, better: -1, title: 'Ring',
    about: 'Area of background that is missing beside objects, in the visible scene',
  },
  bulge_share: {
    ...percent, decimals: 2, better: -1, title: 'Bulges',
    about: 'Share of the background pixels beside objects where the map, seen from the camera, shows something in front of it',
  },
  table_preservation_any_label: {
    ...percent, title: 'Hidden table kept, any label',
    about: 'As hidden table kept, whatever object the surface is said to belong to',
  },
  table_label_purity: {
    ...percent, title: 'Label purity',
    about: 'Share of the surface labelled background that is background',
  },
};

export function measureOf(column) {
  return kMeasures[column] ?? { title: column, unit: '', scale: 1, decimals: 3, better: 0, about: '' };
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
