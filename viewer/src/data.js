// What the command put into the page: figures and settings as JSON, meshes and images as base64.
import { MeshoptDecoder } from 'three/addons/libs/meshopt_decoder.module.js';
import { learnMetrics } from './measures.js';

const kBackground = 0;  // its id

function bytesOf(base64) {
  const text = atob(base64.trim());
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; ++i) bytes[i] = text.charCodeAt(i);
  return bytes;
}

// Rows of cells, numbers where a cell is one, null where it is empty.
export function parseCsv(text) {
  const [head, ...lines] = text.trim().split('\n');
  const columns = head.split(',');
  const rows = lines.map((line) => {
    const cells = line.split(',');
    return Object.fromEntries(columns.map((column, i) => {
      const cell = cells[i] ?? '';
      return [column, cell === '' ? null : Number.isNaN(Number(cell)) ? cell : Number(cell)];
    }));
  });
  return { columns, rows };
}

// A value of summary.json: a number, or { value: null, why } where it is undefined.
export function measured(value) {
  return typeof value === 'number' ? value : null;
}

class Recording {
  constructor(json, bytes) {
    Object.assign(this, json);
    this.bytes = bytes;
    this.urls = new Map();
    this.colours = new Map(json.objects.map((object) => [object.id, object.colour]));
    this.names = new Map(json.objects.map((object) => [object.id, object.name]));
  }

  slice([offset, length]) {
    return this.bytes.subarray(offset, offset + length);
  }

  // A URL of an image in the recording.
  image(place) {
    const key = place[0];
    if (!this.urls.has(key)) {
      this.urls.set(key, URL.createObjectURL(new Blob([this.slice(place)], { type: 'image/webp' })));
    }
    return this.urls.get(key);
  }

  imageBlob(place) {
    return new Blob([this.slice(place)], { type: 'image/webp' });
  }

  // Positions in metres, indices, and per vertex error, age, colour (docs/report.md).
  async mesh(chunk, grid = this.grid) {
    await MeshoptDecoder.ready;
    const { vertices, triangles } = chunk;
    const packed = new Uint8Array(12 * vertices);
    MeshoptDecoder.decodeVertexBuffer(packed, vertices, 12, this.slice(chunk.vertex_bytes));
    const indices = new Uint32Array(3 * triangles);
    MeshoptDecoder.decodeIndexBuffer(new Uint8Array(indices.buffer), 3 * triangles, 4,
                                     this.slice(chunk.index_bytes));
    const view = new DataView(packed.buffer);
    const positions = new Float32Array(3 * vertices);
    const error = new Uint8Array(vertices);
    const age = new Uint8Array(vertices);
    const colours = new Uint8Array(3 * vertices);
    for (let v = 0; v < vertices; ++v) {
      for (let axis = 0; axis < 3; ++axis) {
        positions[3 * v + axis] =
          grid.origin_m[axis] + grid.step_m * view.getUint16(12 * v + 2 * axis, true);
        colours[3 * v + axis] = packed[12 * v + 8 + axis];
      }
      error[v] = packed[12 * v + 6];
      age[v] = packed[12 * v + 7];
    }
    return { positions, indices, error, age, colours };
  }
}

function nameOf(run, several, letter) {
  return several ? `${letter}: ${run.title}` : run.title;
}

// The run's rows of frames.csv. Its six digits can round twice where the page rounds again, so the hole
// of the examined frame is the summary's: that of the background, which comes first where there is a true one.
function rowsOf(report, run) {
  const rows = report.csv.rows.filter((row) => row.method === run.method && row.profile === run.profile &&
                                               row.poses === run.poses);
  const first = run.examined?.objects?.[0];
  const exact = first?.id === kBackground ? measured(first.hole_area_cm2) : null;
  return rows.map((row) => (row.frame === run.examined?.frame && exact !== null
    ? { ...row, table_hole_area_cm2: exact } : row));
}

// { command, version, reports: [{ name, summary, csv, pictures, recording }], runs: [...] }, where
// `runs` lists every map of every report.
export function loadData() {
  const data = JSON.parse(document.getElementById('report-data').textContent);
  learnMetrics(data.metrics);
  const reports = data.reports.map((report, r) => {
    const element = document.getElementById(`report-bytes-${r}`);
    const recording = report.record && element
      ? new Recording(report.record, bytesOf(element.textContent)) : null;
    return { ...report, letter: String.fromCharCode(65 + r), csv: parseCsv(report.frames_csv), recording };
  });
  const several = reports.length > 1;
  const runs = reports.flatMap((report, r) => report.summary.runs.map((run) => ({
    ...run,
    report: r,
    colours: data.colours[run.method],
    key: `${r}/${run.folder}`,
    label: nameOf(run, several, report.letter),
    rows: rowsOf(report, run),
    recorded: report.recording?.runs.find((recorded) => recorded.folder === run.folder) ?? null,
    recording: report.recording,
  })));
  return { ...data, reports, runs };
}
