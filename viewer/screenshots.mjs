// Pictures of a report for the documents: node screenshots.mjs DEPENDENCIES CHROMIUM REPORT FOLDER.
import { mkdirSync } from 'node:fs';
import { createRequire } from 'node:module';
import { join, resolve } from 'node:path';
import { pathToFileURL } from 'node:url';

const [dependencies, chromiumPath, report, folder] = process.argv.slice(2);
if (!folder) {
  console.error('usage: node screenshots.mjs DEPENDENCIES CHROMIUM REPORT FOLDER');
  process.exit(2);
}
const { chromium } = createRequire(join(resolve(dependencies), 'node_modules', 'x.js'))('playwright-core');
const kSlow_ms = 240000;

const browser = await chromium.launch({
  executablePath: chromiumPath, timeout: kSlow_ms,
  args: ['--no-sandbox', '--disable-dev-shm-usage', '--use-angle=swiftshader', '--enable-unsafe-swiftshader'],
});
mkdirSync(folder, { recursive: true });

async function open(options) {
  const page = await browser.newPage(options);
  page.setDefaultTimeout(kSlow_ms);
  await page.goto(pathToFileURL(report).href);
  await page.waitForFunction(() => window.report);
  return page;
}

async function drawn(page) {
  await page.locator('#view').scrollIntoViewIfNeeded();
  await page.waitForFunction(() => {
    const { view } = document.getElementById('view');
    return view && view.runs.length && view.runs.every((run) => view.frames.get(run.key)?.get(view.frame)?.userData?.camera);
  });
  await page.waitForTimeout(1500);
}

const shoot = (page, name, options = {}) => page.screenshot({ path: join(folder, name), type: 'jpeg', quality: 82, ...options });
const set = (page, values) => page.evaluate((changes) => window.report.state.set(changes), values);
const top = async (page, selector) => {
  await page.evaluate((each) => document.querySelector(each).scrollIntoView(), selector);
  await page.waitForTimeout(1200);
};

const desktop = await open({ viewport: { width: 1280, height: 800 }, colorScheme: 'light' });
await desktop.waitForTimeout(1200);
await shoot(desktop, 'report-top.jpg');
await set(desktop, { pull: 0.5 });
await drawn(desktop);
await top(desktop, '#view');
await shoot(desktop, 'report-view.jpg', { clip: { x: 0, y: 0, width: 1280, height: 660 } });
await set(desktop, { pull: 0, colour: 'error' });
await drawn(desktop);
await shoot(desktop, 'report-error.jpg', { clip: { x: 0, y: 0, width: 1280, height: 660 } });
await set(desktop, { dark: true });
await top(desktop, '#plots');
await shoot(desktop, 'report-plots.jpg');

const phone = await open({ viewport: { width: 390, height: 844 }, colorScheme: 'dark', isMobile: true, hasTouch: true, deviceScaleFactor: 1.5 });
await set(phone, { pull: 0.5 });
await drawn(phone);
await top(phone, '#view');
await shoot(phone, 'report-phone.jpg');
await browser.close();
