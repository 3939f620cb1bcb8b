// Searches the built site as a reader does, in a browser, from the disk and from a server, for what users look for.
//
//   node tools/search_docs.mjs SITE VIEWER_WORK      VIEWER_WORK: the folder of playwright-core's node_modules
import { existsSync, readFileSync } from 'node:fs';
import { createServer } from 'node:http';
import { createRequire } from 'node:module';
import { join, resolve } from 'node:path';
import { pathToFileURL } from 'node:url';

const [site, work] = process.argv.slice(2).map((folder) => resolve(folder));
const { chromium } = createRequire(join(work, 'package.json'))('playwright-core');

// Each text has to lead to a section of the page beside it, among the first five results.
const SEARCHES = [
  ['gripper', 'gripper_in_ten_minutes.html'],
  ['fingertip stiffness', 'hand_stiffness.html'],
  ['URDF', 'legs_and_urdf.html'],
  ['friction_use', 'formats.html'],
  ['fit_stiffness', 'sweeps.html'],
  ['ComputeInertia', 'api_cpp.html'],
  ['SetControl', 'api_cpp.html'],
  ['gain.must_stay', 'formats.html'],
  ['control tables', 'formats.html'],
  ['relinearization', 'method.html'],
  ['--controls', 'command_line.html'],
  ['fork1s run --controls FILE.csv', 'command_line.html'],
  ['"--read-time"', 'command_line.html'],
  ['--no-open', 'command_line.html'],
  ['--stiffness-scale', 'command_line.html'],
  ['--against mujoco', 'command_line.html'],
];

const server = createServer((request, response) => {
  try {
    const path = join(site, decodeURIComponent(new URL(request.url, 'http://localhost').pathname));
    const type = { html: 'text/html', js: 'text/javascript', css: 'text/css', json: 'application/json' }[path.split('.').pop()];
    const content = readFileSync(path);
    response.writeHead(200, type ? { 'Content-Type': type } : {}).end(content);
  } catch {
    response.writeHead(404).end();
  }
});
await new Promise((done) => server.listen(0, '127.0.0.1', done));
const browser = await chromium.launch({
  executablePath: ['/usr/bin/chromium', '/usr/bin/chromium-browser'].find((path) => existsSync(path)),
  args: ['--no-sandbox'],
});
let failures = 0;
for (const base of [pathToFileURL(site).href, `http://127.0.0.1:${server.address().port}`]) {
  const from = base.startsWith('file:') ? 'from the disk' : 'from a server';
  const page = await browser.newPage({ viewport: { width: 1280, height: 720 } });
  for (const [text, wanted] of SEARCHES) {
    await page.goto('about:blank');
    await page.goto(`${base}/index.html?q=${encodeURIComponent(text)}`);
    const result = page.locator('.md-search-result__item > .md-search-result__link');
    await result.first().waitFor({ state: 'attached', timeout: 5_000 }).catch(() => undefined);
    const found = await result.evaluateAll((all) => all.slice(0, 5).map((link) => link.pathname.split('/').pop()));
    if (found.includes(wanted)) continue;
    process.stderr.write(`docs: a search ${from} for "${text}" does not lead to ${wanted} but to: ${found.join(', ') || 'nothing'}\n`);
    ++failures;
  }
  await page.close();
}
await browser.close();
server.close();
if (failures > 0) process.exit(1);
process.stdout.write(`docs: ${SEARCHES.length} searches lead where they should, from the disk and from a server\n`);
