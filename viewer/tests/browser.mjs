// The report in a real, headless Chromium: node browser.mjs DEPENDENCIES TSDFPP CHROMIUM FOLDER
// [--update]. Makes a small comparison in FOLDER, its reports, and uses them as a reader would.
// --update writes the reference pictures in references/ anew.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { cpSync, mkdirSync, readdirSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { dirname, join, resolve } from 'node:path';
import { fileURLToPath, pathToFileURL } from 'node:url';
import { compareImages } from './perceptual.mjs';

const [dependencies, tsdfpp, chromiumPath, folder] = process.argv.slice(2);
const update = process.argv.includes('--update');
const { chromium } = createRequire(join(resolve(dependencies), 'node_modules', 'x.js'))('playwright-core');
const references = join(dirname(fileURLToPath(import.meta.url)), 'references');
const scenes = resolve(dirname(fileURLToPath(import.meta.url)), '../../scenes');
const kSlow_ms = 240000;  // a loaded machine with a software renderer
const kBad = '<img src=x onerror="window.pwned=1"></script><script>window.pwned=1</script>';

// What `tsdfpp gate` writes, as far as the page reads it.
const gate = (name, verdict, more = {}) => ({
  name, verdict, why: '', experiment: 'mini', metric: 'm', of: 'movers_accuracy_rmse_mm - reference', cells: 'method tsdf++/anchored',
  bounds: { min: -0.1, max: 0.1 }, bounds_because: 'A twentieth of a pixel.', confidence: 1, replicates: ['seed=1;'],
  values: [0], mean: 0, interval: [0, 0], ...more,
});
const kGates = {
  schema: 1, profile: 'quick', sabotage: 'none', program: '0.1.0 abc', renderer: 'llvmpipe', mujoco: '3.17.0', machine: 'a processor',
  exit_code: 1,
  controls: [{ name: 'static', verdict: 'pass', why: '', metric: 'completion', methods: ['tsdf', 'open3d/10'], greatest_spread: 0.004, allowed_spread: 0.03 }],
  gates: [
    gate('hidden-table', 'pass', { bounds: { min: 0.99 }, mean: 0.99861, interval: [0.9981, 0.9992] }),
    gate('car-distance', 'fail', {
      mean: 0.2345678, interval: [0.2345678, 0.2345678], why: '0.234568 to 0.234568, expected from -0.1 to 0.1',
      explanation: { replicate: 'seed=1;', frame: 16, object: 'car', picture: 'car-distance.png' },
    }),
    gate('size', 'invalid', { mean: { value: null, why: 'no reference' }, interval: undefined, why: 'there is no reference' }),
  ],
  sabotages: [{ name: 'frozen-object', words: 'objects keep the first pose', caught: true, gates: [gate('car-distance', 'fail')] },
    { name: 'depth-scale', words: 'depth times 1.005', caught: false, gates: [gate('size', 'inconclusive')] }],
};

function command(...parts) {
  execFileSync(tsdfpp, parts, { stdio: ['ignore', 'ignore', 'inherit'] });
}

// A comparison of 16 frames, its report, one without a recording, and one whose every name is bad.
function makeRuns() {
  rmSync(folder, { recursive: true, force: true });
  mkdirSync(folder, { recursive: true });
  const run = join(folder, 'run');
  command('compare', join(scenes, 'mini.toml'), '--out', run, '--until', '16', '--every', '8', '--profiles', 'paper',
          '--methods', 'tsdf,tsdf++/anchored', '--record');
  writeFileSync(join(run, 'gates.json'), JSON.stringify(kGates));
  mkdirSync(join(run, 'pictures'));
  cpSync(join(run, readdirSync(run).find((name) => /^table-.*png$/.test(name))), join(run, 'pictures', 'car-distance.png'));
  command('report', run);
  const plain = join(folder, 'plain');
  cpSync(run, plain, { recursive: true });
  rmSync(join(plain, 'record'), { recursive: true });
  command('report', plain);
  const bad = join(folder, 'bad');
  cpSync(run, bad, { recursive: true });
  const edit = (name, change) => {
    const value = JSON.parse(readFileSync(join(bad, name), 'utf8'));
    change(value);
    writeFileSync(join(bad, name), JSON.stringify(value));
  };
  edit('summary.json', (summary) => {
    summary.sequence = kBad;
    summary.command = kBad;
    summary.runs.forEach((each) => {
      each.title = `${each.title} ${kBad}`;
      each.examined.objects.forEach((object) => { object.name = kBad; });
      each.settings[kBad] = kBad;
    });
  });
  edit('gates.json', (gates) => {
    gates.gates.forEach((each) => { each.name = `${each.name} ${kBad}`; each.why = kBad; each.bounds_because = kBad; each.of = kBad; });
    gates.sabotages.forEach((each) => { each.words = kBad; });
    gates.controls.forEach((each) => { each.metric = kBad; });
  });
  edit('record/record.json', (record) => record.objects.forEach((object) => { object.name = kBad; }));
  // What was edited by hand has other sizes than the run noted.
  edit('run.json', (note) => note.files.forEach((file) => { file.bytes = null; }));
  command('report', bad);
  command('report', run, '--compare', plain, '--out', join(folder, 'both.html'));
  makeMore(run);
  makeOther(run);
  makeUnknown(run);
}

// A run of which no true background is known, as of others' sets, compared with the run both ways round. The hole of its
// first object is none in the table.
function makeUnknown(run) {
  const unknown = join(folder, 'unknown');
  cpSync(run, unknown, { recursive: true });
  const [head, ...lines] = readFileSync(join(run, 'frames.csv'), 'utf8').trim().split('\n');
  const isOfTable = head.split(',').map((column) => column.startsWith('table_'));
  const emptied = lines.map((line) => line.split(',').map((cell, i) => (isOfTable[i] ? '' : cell)).join(','));
  writeFileSync(join(unknown, 'frames.csv'), [head, ...emptied].join('\n') + '\n');
  const summary = JSON.parse(readFileSync(join(unknown, 'summary.json'), 'utf8'));
  summary.runs.forEach(({ examined }) => { examined.objects.shift(); examined.objects[0].hole_area_cm2 = 7.5; });
  writeFileSync(join(unknown, 'summary.json'), JSON.stringify(summary));
  const note = JSON.parse(readFileSync(join(unknown, 'run.json'), 'utf8'));
  note.files.forEach((file) => { file.bytes = null; });
  writeFileSync(join(unknown, 'run.json'), JSON.stringify(note));
  command('report', unknown);
  command('report', run, '--compare', unknown, '--out', join(folder, 'run-unknown.html'));
  command('report', unknown, '--compare', run, '--out', join(folder, 'unknown-run.html'));
}

// A run of other key frames beside the run; it has an object that is nobody's, and much to be said of it.
function makeOther(run) {
  const other = join(folder, 'denser');
  command('compare', join(scenes, 'mini.toml'), '--out', other, '--until', '16', '--every', '4', '--profiles', 'paper',
          '--methods', 'tsdf++/anchored', '--record');
  const edit = (name, change) => {
    const value = JSON.parse(readFileSync(join(other, name), 'utf8'));
    change(value);
    writeFileSync(join(other, name), JSON.stringify(value));
  };
  edit('summary.json', (summary) => {
    summary.failed = [{ title: 'tsdf, paper', folder: 'tsdf-paper-gt', frame: 5, failure: 'out of memory' }];
    summary.truth = 'A reconstruction stands in for the true surface.';
    summary.runs[0].remarks = ['something odd'];
    summary.runs[0].segmentation = 'depth';
  });
  edit('record/record.json', (record) => {
    record.runs[0].position_error_mm[2] = null;
    record.runs[0].key_frames.forEach((key) => key.chunks.filter((chunk) => chunk.layer === 'mover').forEach((chunk) => { chunk.id = 65535; }));
  });
  edit('run.json', (note) => note.files.forEach((file) => { file.bytes = null; }));
  command('report', run, '--compare', other, '--out', join(folder, 'denser.html'));
  command('report', other);
}

// A run with more of everything in its frames.csv, compared with the run.
function makeMore(run) {
  const more = join(folder, 'more');
  cpSync(run, more, { recursive: true });
  const [head, ...lines] = readFileSync(join(run, 'frames.csv'), 'utf8').trim().split('\n');
  const isMeasured = head.split(',').map((column) => !['frame', 'method', 'profile', 'poses'].includes(column));
  const raised = lines.map((line) => line.split(',').map((cell, i) => (cell && isMeasured[i] ? Number(cell) + 1 : cell)).join(','));
  writeFileSync(join(more, 'frames.csv'), [head, ...raised].join('\n') + '\n');
  const summary = JSON.parse(readFileSync(join(more, 'summary.json'), 'utf8'));
  // The page takes this one column from the summary.
  summary.runs.forEach((each) => { each.examined.objects[0].hole_area_cm2 += 1; });
  writeFileSync(join(more, 'summary.json'), JSON.stringify(summary));
  const note = JSON.parse(readFileSync(join(more, 'run.json'), 'utf8'));
  note.files.forEach((file) => { file.bytes = null; });
  writeFileSync(join(more, 'run.json'), JSON.stringify(note));
  command('report', run, '--compare', more, '--out', join(folder, 'other.html'));
}

const tests = [];
const test = (name, body) => tests.push({ name, body });

// A page that fails the test on any error, message of the console, or request to anywhere.
async function open(browser, file, options = {}) {
  const page = await browser.newPage({ viewport: { width: 1280, height: 900 }, colorScheme: 'light', ...options });
  page.setDefaultTimeout(kSlow_ms);
  page.faults = [];
  page.on('console', (message) => {
    // A software renderer says that reading its pixels is slow.
    if (['error', 'warning'].includes(message.type()) && !/GPU stall due to ReadPixels/.test(message.text())) {
      page.faults.push(message.text());
    }
  });
  page.on('pageerror', (error) => page.faults.push(error.message));
  page.on('dialog', (dialog) => { page.faults.push(`dialog ${dialog.message()}`); dialog.dismiss(); });
  page.on('request', (request) => {
    if (!/^(file|data|blob):/.test(request.url())) page.faults.push(`request ${request.url()}`);
  });
  await page.goto(pathToFileURL(file).href);
  await page.waitForFunction(() => window.report);
  return page;
}

const report = (name) => join(folder, name, 'report.html');

// The 3-D view, drawn, with nothing left to do.
async function showView(page) {
  await page.locator('#view').scrollIntoViewIfNeeded();
  await page.waitForFunction(() => document.getElementById('view').view?.renderer);
  await settled(page);
}

async function settled(page) {
  await page.waitForFunction(() => {
    const { view } = document.getElementById('view');
    const ready = view.runs.every((run) => view.frames.get(run.key)?.get(view.frame)?.userData?.camera);
    return ready && view.frame === window.report.state.get('frame');
  });
  await page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => requestAnimationFrame(done)))));
}

// The canvas as a PNG, 320 pixels wide, drawn now.
function snapshot(page) {
  return page.evaluate(() => {
    const { view } = document.getElementById('view');
    view.render();
    const from = view.renderer.domElement;
    const to = document.createElement('canvas');
    to.width = 320;
    to.height = Math.round((320 * from.height) / from.width);
    const context = to.getContext('2d');
    context.fillStyle = '#f1efea';
    context.fillRect(0, 0, to.width, to.height);
    context.imageSmoothingQuality = 'high';
    context.drawImage(from, 0, 0, to.width, to.height);
    return to.toDataURL('image/png');
  });
}

async function matchesReference(page, name) {
  const picture = await snapshot(page);
  const path = join(references, `${name}.png`);
  if (update) {
    mkdirSync(references, { recursive: true });
    writeFileSync(path, Buffer.from(picture.split(',')[1], 'base64'));
    return;
  }
  const reference = `data:image/png;base64,${readFileSync(path).toString('base64')}`;
  const difference = await compareImages(page, picture, reference);
  if (!difference.alike) writeFileSync(join(folder, `${name}-now.png`), Buffer.from(picture.split(',')[1], 'base64'));
  assert.ok(difference.alike, `${name} differs from its reference: ${JSON.stringify(difference)}; see ${folder}`);
}

const set = (page, values) => page.evaluate((changes) => window.report.state.set(changes), values);

test('loads quietly, says its verdict, asks for nothing', async (browser) => {
  const page = await open(browser, report('run'));
  assert.match(await page.locator('h1').textContent(), /can no longer see/);
  assert.match(await page.locator('.verdict').textContent(), /tsdf\+\+\/anchored keeps \d+\.\d % of the hidden table/);
  assert.equal(await page.locator('.card').count(), 3);
  assert.equal(await page.locator('table.figure tbody tr').count(), 3);
  const broken = await page.evaluate(async () => {
    const images = [...document.images];
    images.forEach((image) => { image.loading = 'eager'; });
    await Promise.all(images.map((image) => image.decode().catch(() => {})));
    return images.filter((image) => image.naturalWidth === 0).map((image) => image.alt);
  });
  assert.deepEqual(broken, []);
  return page;
});

test('the view draws, and the pictures are those of the references', async (browser) => {
  const page = await open(browser, report('run'));
  await showView(page);
  await matchesReference(page, 'view-in-place');
  const before = await snapshot(page);
  await set(page, { pull: 1 });
  await settled(page);
  await matchesReference(page, 'view-pulled-away');
  const after = await snapshot(page);
  // The comparison sees what matters here: a car that is gone, another colouring.
  assert.ok(!(await compareImages(page, before, after)).alike, 'the comparison is blind');
  await set(page, { colour: 'error' });
  await settled(page);
  assert.ok(!(await compareImages(page, after, await snapshot(page))).alike, 'colouring by error changes nothing');
  await set(page, { colour: 'object', pull: 0, frame: 8 });
  await settled(page);
  await matchesReference(page, 'view-frame-8');
  return page;
});

test('the slider moves the frame everywhere, by mouse and by keyboard', async (browser) => {
  const page = await open(browser, report('run'));
  await showView(page);
  assert.equal(await page.locator('.frame-number').textContent(), 'frame 16');
  const colour = page.locator('.images img').first();
  const image = await colour.getAttribute('src');
  await page.locator('#frame').focus();
  await page.keyboard.press('ArrowLeft');
  await settled(page);
  assert.equal(await page.locator('.frame-number').textContent(), 'frame 8');
  assert.notEqual(await colour.getAttribute('src'), image);
  assert.equal(await page.evaluate(() => document.getElementById('view').view.frame), 8);
  await page.locator('.play').click();
  await page.waitForFunction(() => window.report.state.get('frame') === 16);
  return page;
});

test('pulling the objects away shows what is remembered and what is lost', async (browser) => {
  const page = await open(browser, report('run'));
  await showView(page);
  const shown = () => page.evaluate(() => {
    const { view } = document.getElementById('view');
    return view.runs.map((run) => Object.fromEntries(view.frames.get(run.key).get(view.frame).userData.chunks
      .map((object) => [object.userData.chunk.layer, object.visible])));
  });
  for (const layers of await shown()) assert.ok(layers.mover && !layers.revealed && !layers.hole);
  await page.locator('#pull').evaluate((slider) => { slider.value = '50'; slider.dispatchEvent(new Event('input')); });
  const half = await shown();
  assert.ok(half.some((layers) => layers.revealed), 'no map remembers anything');
  assert.ok(half.some((layers) => layers.hole), 'no map lost anything');
  await page.locator('#pull').evaluate((slider) => { slider.value = '100'; slider.dispatchEvent(new Event('input')); });
  for (const layers of await shown()) assert.ok(!layers.mover && !layers.gone);
  return page;
});

test('a click in the view says what is there, and so does Enter', async (browser) => {
  const page = await open(browser, report('run'));
  await showView(page);
  await page.evaluate(() => {
    const { view } = document.getElementById('view');
    view.lookAsCamera(window.report.data.reports[0].recording, window.report.state.get('frame'));
  });
  await settled(page);
  // Where the car is on the screen, by its own vertices.
  const place = await page.evaluate(() => {
    const { view } = document.getElementById('view');
    const run = view.runs[1];
    const car = view.frames.get(run.key).get(view.frame).userData.chunks.find((o) => o.userData.chunk.layer === 'mover');
    car.geometry.computeBoundingSphere();
    const at = car.geometry.boundingSphere.center.clone().project(view.camera);
    const box = view.panels()[1].querySelector('.stage').getBoundingClientRect();
    return { x: box.left + ((at.x + 1) / 2) * box.width, y: box.top + ((1 - at.y) / 2) * box.height };
  });
  await page.mouse.click(place.x, place.y);
  const said = await page.locator('.picked').textContent();
  assert.match(said, /anchored.*car \(id 1\).* mm from the true surface; .*; at -?\d/);
  // The marks are placed when the panels are drawn again.
  await page.waitForFunction(() => [...document.querySelectorAll('.mark')].filter((mark) => !mark.hidden).length === 2);
  await page.locator('.panels').focus();
  await page.keyboard.press('Enter');
  assert.notEqual(await page.locator('.picked').textContent(), said);
  const eye = () => page.evaluate(() => document.getElementById('view').view.camera.position.toArray());
  const before = await eye();
  await page.keyboard.press('ArrowRight');
  assert.notDeepEqual(await eye(), before);
  return page;
});

test('plots show values and a click on one jumps to the frame', async (browser) => {
  const page = await open(browser, report('run'));
  const chart = page.locator('[data-chart="Memory of the map"] .u-over');
  await chart.scrollIntoViewIfNeeded();
  const box = await chart.boundingBox();
  await page.mouse.move(box.x + 0.3 * box.width, box.y + 0.5 * box.height);
  await page.waitForFunction(() => /\d MB/.test(document.querySelector('[data-chart="Memory of the map"] .u-legend').textContent));
  await page.mouse.click(box.x + 0.3 * box.width, box.y + 0.5 * box.height);
  assert.equal(await page.evaluate(() => window.report.state.get('frame')), 8);
  await page.mouse.click(box.x + 0.97 * box.width, box.y + 0.5 * box.height);
  assert.equal(await page.evaluate(() => window.report.state.get('frame')), 16);
  return page;
});

test('tables sort and leave as CSV', async (browser) => {
  const page = await open(browser, report('run'));
  const table = page.locator('[data-table="figures"]');
  const column = async () => (await table.locator('tbody tr td:nth-child(2)').allTextContents()).map(Number);
  // A busy machine may take in a click after it was sent.
  const sorted = (way) => table.locator(`th:nth-child(2)[aria-sort="${way}"]`).waitFor();
  await table.locator('thead button').nth(1).click();
  await sorted('ascending');
  const up = await column();
  assert.deepEqual(up, [...up].sort((a, b) => a - b));
  await table.locator('thead button').nth(1).click();
  await sorted('descending');
  assert.deepEqual(await column(), [...up].reverse());
  assert.equal(await table.locator('[aria-sort="descending"]').count(), 1);
  const [download] = await Promise.all([page.waitForEvent('download'), table.locator('.save').click()]);
  const path = join(folder, 'figures.csv');
  await download.saveAs(path);
  const lines = readFileSync(path, 'utf8').trim().split('\n');
  assert.equal(lines.length, 3);
  assert.match(lines[0], /^Map,Hidden table kept \(%\),/);
  return page;
});

test('the verdicts of the gates stand in words, with the picture behind a failure', async (browser) => {
  const page = await open(browser, report('run'));
  assert.match(await page.locator('header a[href="#gates"]').textContent(), /^1 of 3 gates hold \(profile quick\), 1 of 2 sabotages are caught\.$/);
  const table = page.locator('[data-table="gates"]');
  assert.deepEqual(await table.locator('tbody .badge').allTextContents(), ['✓ pass', '✓ pass', '✗ fail', '! invalid']);
  const row = table.locator('tbody tr', { hasText: 'car-distance' });
  assert.deepEqual((await row.locator('td').allTextContents()).slice(1, 3), ['0.2346', '-0.1 to 0.1']);
  await table.locator('thead button', { hasText: 'Verdict' }).click();
  assert.equal(await table.locator('tbody .badge').first().textContent(), '✗ fail');
  assert.match(await page.locator('.behind').first().textContent(), /car-distance is fail: 0\.234568.*Worst at seed=1; frame 16 car\./);
  assert.equal(await page.locator('.behind img').count(), 1);
  assert.deepEqual(await page.locator('[data-table="sabotages"] .badge').allTextContents(), ['✓ caught', '✗ not caught']);
  const colours = await page.locator('[data-table="gates"] .badge').evaluateAll((all) => all.map((each) => getComputedStyle(each).color));
  assert.equal(new Set(colours).size, 3);
  return page;
});

test('a malicious name does nothing but be shown', async (browser) => {
  const page = await open(browser, report('bad'));
  await showView(page);
  await page.evaluate(() => scrollTo(0, document.body.scrollHeight));
  await page.waitForTimeout(300);
  assert.equal(await page.evaluate(() => window.pwned), undefined);
  assert.ok((await page.locator('.kicker').textContent()).includes(kBad));
  assert.ok((await page.locator('.legend').textContent()).includes(kBad));
  assert.equal(await page.locator('img[src="x"]').count(), 0);
  return page;
});

test('what gets in as markup is still refused by the policy', async (browser) => {
  const page = await open(browser, report('run'));
  await page.evaluate(() => {
    const box = document.createElement('div');
    box.innerHTML = '<img src="data:," onerror="window.pwned=1">';
    document.body.append(box);
  });
  await page.waitForTimeout(300);
  assert.equal(await page.evaluate(() => window.pwned), undefined);
  page.faults = page.faults.filter((fault) => !/Content Security Policy/.test(fault));
  return page;
});

test('two comparisons stand beside each other', async (browser) => {
  const page = await open(browser, join(folder, 'both.html'));
  assert.equal(await page.locator('[data-table="figures"] tbody tr').count(), 4);
  const words = await page.locator('[data-table="compared"] tbody tr td:last-child').allTextContents();
  assert.ok(words.length > 10 && words.every((word) => word === 'same'));
  return page;
});

test('where no true background is known there is no hole in the table', async (browser) => {
  const page = await open(browser, report('unknown'));
  const heads = await page.locator('[data-table="figures"] thead button').allTextContents();
  const hole = heads.findIndex((head) => head.startsWith('Hole in the table'));
  assert.ok(hole > 0, `${heads}`);
  const cells = await page.locator('[data-table="figures"] tbody tr').evaluateAll(
    (all, at) => all.map((row) => row.children[at].textContent), hole);
  assert.deepEqual(cells, ['–', '–']);
  return page;
});

for (const [file, has, lacks, word] of [['run-unknown', 2, 3, 'only in A'], ['unknown-run', 3, 2, 'only in B']]) {
  test(`a figure that one comparison has is ${word}`, async (browser) => {
    const page = await open(browser, join(folder, `${file}.html`));
    const rows = await page.locator('[data-table="compared"] tbody tr').evaluateAll(
      (all) => all.map((row) => [...row.children].map((cell) => cell.textContent)));
    const one = rows.filter((row) => row[lacks] === '–');
    assert.ok(one.length > 3 && one.every((row) => row[has] !== '–' && row[5] === word), JSON.stringify(one));
    assert.ok(rows.filter((row) => row[lacks] !== '–').every((row) => row[5] === 'same'));
    return page;
  });
}

test('a metric has the unit, the digits and the direction of its row', async (browser) => {
  const page = await open(browser, join(folder, 'other.html'));
  const heads = await page.locator('[data-table="figures"] thead button').allTextContents();
  const rows = await page.locator('[data-table="compared"] tbody tr').evaluateAll(
    (all) => all.map((row) => [...row.children].map((cell) => cell.textContent)));
  let compared = 0;
  for (const { words, unit, better, decimals } of JSON.parse(execFileSync(tsdfpp, ['metric', 'list', '--json'], { encoding: 'utf8' }))) {
    const title = words[0].toUpperCase() + words.slice(1);
    const shown = unit || '%';
    for (const [, , a, b, change, so] of rows.filter((row) => row[1] === title)) {
      assert.ok(heads.includes(`${title} ${shown}`), `${title} ${shown} is not among ${heads}`);
      for (const value of [a, b].filter((each) => each !== '–')) {
        assert.ok(value.endsWith(` ${shown}`), `${title}: ${value}`);
        assert.equal((value.split(' ')[0].split('.')[1] ?? '').length, unit ? decimals : decimals - 2, `${title}: ${value}`);
      }
      if (b === '–') continue;
      assert.ok(Number(change) > 0, `${title}: ${change}`);
      assert.equal(so, better === 'higher' ? 'better' : 'worse', title);
      ++compared;
    }
  }
  assert.ok(compared > 10, `${compared} of ${rows.length} rows`);
  return page;
});

test('two comparisons with other key frames share the slider, and say what is not recorded', async (browser) => {
  const page = await open(browser, join(folder, 'denser.html'));
  assert.deepEqual(await page.evaluate(() => window.report.frames), [4, 8, 12, 16]);
  await showView(page);
  const keys = await page.evaluate(() => window.report.data.runs.map((run) => run.key));
  await page.evaluate((all) => window.report.state.set({ shown: new Set(all), frame: 12 }), keys);
  await settled(page);
  assert.equal(await page.locator('#frame').inputValue(), '2');
  const titles = await page.locator('.panel-title').allTextContents();
  assert.equal(titles.filter((title) => title.endsWith(', not recorded at this frame')).length, 2, titles.join(' | '));
  const at12 = await page.locator('.images img').first().getAttribute('src');
  await set(page, { frame: 8 });
  assert.notEqual(await page.locator('.images img').first().getAttribute('src'), at12);
  return page;
});

test('what went wrong is said, and what nobody measured is not', async (browser) => {
  const page = await open(browser, report('denser'));
  const notes = await page.locator('.notes').textContent();
  for (const words of ['tsdf, paper failed at frame 5, and is not shown: out of memory', 'stands in for', 'something odd']) {
    assert.ok(notes.includes(words), notes);
  }
  assert.match(await page.locator('.images').textContent(), /which these maps were not given/);
  await showView(page);
  await page.evaluate(() => {
    const { view } = document.getElementById('view');
    view.lookAsCamera(window.report.data.reports[0].recording, window.report.state.get('frame'));
  });
  await settled(page);
  const pick = () => page.evaluate(() => {
    const { view } = document.getElementById('view');
    const run = view.runs[0];
    const car = view.frames.get(run.key).get(view.frame).userData.chunks.find((o) => o.userData.chunk.layer === 'mover');
    car.geometry.computeBoundingSphere();
    car.updateWorldMatrix(true, false);
    const at = car.geometry.boundingSphere.center.clone().applyMatrix4(car.matrixWorld).project(view.camera);
    const box = view.panels()[0].querySelector('.stage').getBoundingClientRect();
    view.pick(box.left + ((at.x + 1) / 2) * box.width, box.top + ((1 - at.y) / 2) * box.height);
    return document.querySelector('.picked').textContent;
  });
  const said = await pick();
  assert.match(said, /none of the true objects'; at/);
  const height = (text) => Number(text.match(/, (-?[\d.]+) m\.$/)[1]);
  // Lifted by 20 cm, it is at the place that the map has it at.
  await set(page, { pull: 0.5 });
  await settled(page);
  assert.match(await page.locator('.picked').textContent(), /^Drag to turn/);
  assert.ok(Math.abs(height(await pick()) - height(said)) < 0.03, said);
  return page;
});

test('without a recording there are still pictures, plots and tables', async (browser) => {
  const page = await open(browser, report('plain'));
  assert.match(await page.locator('#view').textContent(), /without --record/);
  assert.ok(await page.locator('#figure img').count() >= 1);
  await page.locator('.u-over').first().waitFor();
  return page;
});

test('a phone has no sideways scroll, in the dark, and its text can be read', async (browser) => {
  const page = await open(browser, report('run'), { viewport: { width: 390, height: 844 }, colorScheme: 'dark', isMobile: true, hasTouch: true });
  await showView(page);
  const widths = await page.evaluate(() => [document.documentElement.scrollWidth, innerWidth]);
  assert.ok(widths[0] <= widths[1], `the page is ${widths[0]} wide on a screen of ${widths[1]}`);
  assert.equal(await page.evaluate(() => document.documentElement.dataset.theme), 'dark');
  return page;
});

for (const colorScheme of ['light', 'dark']) {
  test(`text has the contrast of WCAG AA (4.5) in ${colorScheme}`, async (browser) => {
    const page = await open(browser, report('run'), { colorScheme });
    const poor = await page.evaluate(() => {
      const channels = (text) => text.match(/[\d.]+/g).map(Number);
      const light = ([r, g, b]) => [r, g, b].map((c) => c / 255)
        .map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4))
        .reduce((sum, c, i) => sum + [0.2126, 0.7152, 0.0722][i] * c, 0);
      const background = (element) => {
        for (let each = element; each; each = each.parentElement) {
          const colour = channels(getComputedStyle(each).backgroundColor);
          if (colour.length === 3 || colour[3] > 0.99) return colour;
        }
        return [255, 255, 255];
      };
      const found = [];
      for (const element of document.querySelectorAll('main *')) {
        const text = [...element.childNodes].some((node) => node.nodeType === 3 && node.textContent.trim());
        if (!text || element.closest('.u-over')) continue;
        const [a, b] = [light(channels(getComputedStyle(element).color)), light(background(element))].sort((x, y) => y - x);
        if ((a + 0.05) / (b + 0.05) < 4.5) found.push(`${element.className || element.tagName}: ${element.textContent.slice(0, 30)}`);
      }
      return found;
    });
    assert.deepEqual(poor, []);
    return page;
  });
}

test('without WebGL the view is pictures', async (_, launch) => {
  const browser = await launch(['--disable-3d-apis']);
  const page = await open(browser, report('run'));
  page.faults = [];  // Chromium itself says that there is no WebGL
  await page.locator('#view .still img').first().waitFor();
  assert.equal(await page.locator('#view .still img').count(), 2);
  const before = await page.locator('#view .still img').first().getAttribute('src');
  await page.locator('#pull').evaluate((slider) => { slider.value = '100'; slider.dispatchEvent(new Event('input')); });
  assert.notEqual(await page.locator('#view .still img').first().getAttribute('src'), before);
  await page.locator('.u-over').first().waitFor();
  return page;
});

async function run() {
  makeRuns();
  const launch = (more = []) => chromium.launch({
    executablePath: chromiumPath, timeout: kSlow_ms,
    args: ['--no-sandbox', '--disable-dev-shm-usage', '--force-color-profile=srgb',
           ...(more.length ? more : ['--use-angle=swiftshader', '--enable-unsafe-swiftshader'])],
  });
  const browsers = [];
  const launched = async (more) => { browsers.push(await launch(more)); return browsers.at(-1); };
  const browser = await launched();
  let failures = 0;
  for (const { name, body } of tests) {
    const start = Date.now();
    let fault = null;
    try {
      const page = await body(browser, launched);
      if (page.faults.length) fault = `the page says: ${page.faults.join(' | ')}`;
      await page.close();
    } catch (error) {
      fault = error.stack;
    }
    console.log(`${fault ? 'FAILED' : 'ok'}  ${name} (${((Date.now() - start) / 1000).toFixed(1)} s)`);
    if (fault) {
      console.log(`    ${fault}`);
      ++failures;
    }
  }
  for (const each of browsers) await each.close();
  console.log(failures ? `${failures} of ${tests.length} tests failed` : `${tests.length} tests passed`);
  process.exitCode = failures ? 1 : 0;
}
await run();
