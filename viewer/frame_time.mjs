// How long the 3-D view of a report takes to draw so many triangles: node frame_time.mjs DEPENDENCIES
// CHROMIUM REPORT [TRIANGLES, 500000 by default] [OPTIONS OF CHROMIUM]. Draws each map's surface several
// times over, a little apart, until that many are on the screen; turns the camera and prints the least and the median
// time a frame, waiting for its pixels, and what drew it.
import { createRequire } from 'node:module';
import { join, resolve } from 'node:path';
import { pathToFileURL } from 'node:url';

const [dependencies, chromiumPath, report, triangles = '500000', ...options] = process.argv.slice(2);
if (!report) {
  console.error('usage: node frame_time.mjs DEPENDENCIES CHROMIUM REPORT [TRIANGLES] [OPTIONS OF CHROMIUM]');
  process.exit(2);
}
const { chromium } = createRequire(join(resolve(dependencies), 'node_modules', 'x.js'))('playwright-core');
const kSlow_ms = 240000;
const browser = await chromium.launch({
  executablePath: chromiumPath, timeout: kSlow_ms,
  args: ['--no-sandbox', '--disable-dev-shm-usage',
         ...(options.length ? options : ['--use-angle=swiftshader', '--enable-unsafe-swiftshader'])],
});
const page = await browser.newPage({ viewport: { width: 1440, height: 900 } });
page.setDefaultTimeout(kSlow_ms);
await page.goto(pathToFileURL(report).href);
await page.waitForFunction(() => window.report);
await page.locator('#view').scrollIntoViewIfNeeded();
await page.waitForFunction(() => {
  const { view } = document.getElementById('view');
  return view && view.runs.length && view.runs.every((run) => view.frames.get(run.key)?.get(view.frame)?.userData?.camera);
});
const measured = await page.evaluate((wanted) => {
  const { view } = document.getElementById('view');
  const groups = view.runs.map((run) => view.frames.get(run.key).get(view.frame));
  const surfaces = groups.map((group) => group.userData.chunks.filter((each) => each.visible));
  const gl = view.renderer.getContext();
  const pixel = new Uint8Array(4);
  const draw = () => {
    const start = performance.now();
    view.render();
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
    return performance.now() - start;
  };
  const once = surfaces.flat().reduce((sum, each) => sum + each.geometry.index.count / 3, 0);
  const times = Math.ceil(wanted / once);
  for (let k = 1; k < times; ++k) {
    surfaces.forEach((list, g) => list.forEach((each) => {
      const copy = each.clone();
      copy.position.z += 0.002 * k;
      groups[g].add(copy);
    }));
  }
  draw();
  const frames = [];
  for (let i = 0; i < 10; ++i) {
    view.camera.position.applyAxisAngle(view.camera.up, 0.02);
    view.camera.updateMatrixWorld();
    frames.push(draw());
  }
  frames.sort((a, b) => a - b);
  const info = gl.getExtension('WEBGL_debug_renderer_info');
  return { triangles: once * times, least: frames[0], median: frames[5], width: view.renderer.domElement.width,
    height: view.renderer.domElement.height, renderer: gl.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : gl.RENDERER) };
}, Number(triangles));
console.log(`${measured.triangles} triangles on ${measured.width} x ${measured.height} pixels: least ${
  measured.least.toFixed(0)} ms a frame, median ${measured.median.toFixed(0)} ms; ${measured.renderer}`);
await browser.close();
