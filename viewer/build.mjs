// Bundles src/ with three.js and uPlot into one HTML file: node build.mjs DEPENDENCIES OUT.
// DEPENDENCIES is the folder whose node_modules has what package-lock.json names. The file has a
// place for data (see docs/report.md) and a policy by which a browser runs this script and no
// other, and loads nothing.
import { createHash } from 'node:crypto';
import { readFileSync, writeFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { dirname, join, resolve } from 'node:path';
import { fileURLToPath } from 'node:url';

const [dependencies, out] = process.argv.slice(2);
if (!dependencies || !out) {
  console.error('usage: node build.mjs DEPENDENCIES OUT');
  process.exit(2);
}
const here = dirname(fileURLToPath(import.meta.url));
const modules = join(resolve(dependencies), 'node_modules');
const esbuild = createRequire(join(modules, 'x.js'))('esbuild');

async function bundle(entry) {
  const result = await esbuild.build({
    entryPoints: [join(here, 'src', entry)],
    bundle: true,
    minify: true,
    write: false,
    format: 'iife',
    target: ['es2020'],
    nodePaths: [modules],
    legalComments: 'none',
    logLevel: 'warning',
  });
  return result.outputFiles[0].text.trim();
}

function licence(name) {
  return `${name}: ${readFileSync(join(modules, name, 'LICENSE'), 'utf8').trim()}`;
}

const hash = (text) => `'sha256-${createHash('sha256').update(text).digest('base64')}'`;
// Inside <script> nothing may look like its end.
const script = `/*! ${['three', 'uplot'].map(licence).join('\n\n').replaceAll('*/', '* /')} */\n${
  (await bundle('main.js')).replaceAll('</script', '<\\/script').replaceAll('<!--', '<\\!--')}`;
const style = await bundle('style.css');
const policy = [
  "default-src 'none'",
  `script-src ${hash(script)} 'wasm-unsafe-eval'`,
  `style-src ${hash(style)}`,
  'img-src data: blob:',
  "base-uri 'none'",
  "form-action 'none'",
].join('; ');

const page = readFileSync(join(here, 'src', 'page.html'), 'utf8');
const fill = (text, name, value) => {
  const mark = `{{${name}}}`;
  if (text.split(mark).length !== 2) throw new Error(`page.html must have ${mark} once`);
  return text.split(mark).join(value);
};
writeFileSync(out, fill(fill(fill(page, 'policy', policy), 'style', style), 'script', script));
