// The paper's figure: a row a map, columns are frames and the map after the removal.
import { el } from './dom.js';
import { shortLabel } from './measures.js';
import { examinedFrame } from './summary.js';

const kColumns = 4;

function columnsOf(frames, examined) {
  const until = frames.filter((frame) => frame <= examined);
  const count = Math.min(kColumns, until.length);
  return Array.from({ length: count }, (_, i) => until[Math.floor(((i + 1) * until.length) / count) - 1]);
}

export function figurePart(data, state) {
  const part = el('section', { id: 'figure' },
    el('h2', {}, 'The maps over time, and after the moving objects are taken out'));
  const recorded = data.runs.some((run) => run.recorded);
  if (!recorded) {
    for (const report of data.reports) {
      for (const picture of report.pictures) {
        if (!picture.file.startsWith('figure')) continue;
        part.append(el('figure', {}, el('img', { src: picture.data, alt: picture.caption }),
          el('figcaption', {}, data.reports.length > 1 ? `${report.letter}: ` : '', picture.caption)));
      }
    }
    return part;
  }
  const holder = el('div', { class: 'scroll' });
  part.append(holder, el('p', { class: 'quiet' },
    'One colour an object, grey is the room and the table; where a map has no surface, the picture is white. ' +
    'A picture opens its frame in the view below.'));
  state.watch(['shown'], () => {
    const runs = data.runs.filter((run) => run.recorded && state.get('shown').has(run.key));
    if (!runs.length) {
      holder.replaceChildren(el('p', { class: 'message' }, 'These maps were not recorded.'));
      return;
    }
    const [first] = runs;
    const examined = examinedFrame(data.reports[first.report]);
    const columns = columnsOf(first.recorded.key_frames.map((key) => key.frame), examined);
    const picture = (run, place, alt, go) => el('button', { type: 'button', class: 'cell', onclick: go },
      el('img', { src: run.recording.image(place), alt, loading: 'lazy' }));
    const go = (frame, pull) => () => {
      state.set({ frame, pull });
      document.getElementById('view')?.scrollIntoView({ behavior: 'smooth' });
    };
    const hasAfter = runs.some((run) => run.recorded.key_frames.some((key) => key.picture_after));
    const table = el('table', { class: 'figure' },
      el('caption', { class: 'unseen' }, 'Maps by frame'),
      el('thead', {}, el('tr', {}, el('td', {}),
        columns.map((frame) => el('th', { scope: 'col' }, `frame ${frame}`)),
        hasAfter ? el('th', { scope: 'col' }, 'after the removal') : null)),
      el('tbody', {},
        el('tr', {}, el('th', { scope: 'row' }, 'camera'), columns.map((frame) => {
          const key = first.recording.key_frames.find((each) => each.frame === frame);
          return el('td', {}, picture(first, key.colour, `camera image of frame ${frame}`, go(frame, 0)));
        }), hasAfter ? el('td', {}) : null),
        runs.map((run) => el('tr', {}, el('th', { scope: 'row' }, shortLabel(run, data.runs).split(', ').map((word) => el('span', {}, word.replaceAll('/', '/\u200b')))),
          columns.map((frame) => {
            const key = run.recorded.key_frames.find((each) => each.frame === frame);
            return el('td', {}, key ? picture(run, key.picture, `${run.label} at frame ${frame}`, go(frame, 0)) : '–');
          }),
          hasAfter ? el('td', {}, (() => {
            const key = run.recorded.key_frames.find((each) => each.frame === examined);
            return key?.picture_after
              ? picture(run, key.picture_after, `${run.label} after the removal`, go(examined, 1)) : '–';
          })()) : null))));
    holder.replaceChildren(table);
  });
  return part;
}

// The pictures of the table from above, as the comparison made them.
export function tablePicturesPart(data) {
  const pictures = data.reports.flatMap((report) => report.pictures
    .filter((picture) => picture.file.startsWith('table'))
    .map((picture) => ({ ...picture, letter: report.letter })));
  if (!pictures.length) return null;
  return el('section', { id: 'from-above' }, el('h2', {}, 'The table from above, after the removal'),
    pictures.map((picture) => el('figure', {},
      el('img', { src: picture.data, alt: picture.caption, loading: 'lazy' }),
      el('figcaption', {}, data.reports.length > 1 ? `${picture.letter}: ` : '', picture.caption))));
}
