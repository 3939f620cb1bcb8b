// A program, a browser, a page.
import { spawn, type ChildProcess } from 'node:child_process';
import { existsSync } from 'node:fs';
import { isAbsolute, join } from 'node:path';
import { chromium, type Browser, type BrowserContextOptions, type Page } from 'playwright-core';
import { afterAll, beforeAll, inject } from 'vitest';
import type { App } from '../../src/app';

export const BINARY = process.env['FORK1S_BINARY'] ?? '';
export const SOURCE = process.env['FORK1S_SOURCE_DIR'] ?? '';
const BROWSER = inject('browser'); // started by one_browser.ts
export const ready = existsSync(BINARY) && BROWSER !== '';

declare global {
  var fork1s: App | undefined;
}

export interface Program {
  address: string;
  process: ChildProcess;
  stop(): Promise<void>;
}

/** `fork1s view` and a page on it. A test may put another in the place of either. */
export interface Session {
  program: Program;
  browser: Browser;
  page: Page;
}

/** One session for all tests of the block that this is called in; `starts` runs before the first of them. */
export function session(starts: () => Promise<Program>): Session {
  const live = {} as Session;
  beforeAll(async () => {
    live.program = await starts();
    live.browser = await launch();
    live.page = await open(live.browser, live.program.address);
    await running(live.page);
  });
  afterAll(async () => {
    await live.browser?.close();
    await live.program?.stop();
  });
  return live;
}

/** Starts `fork1s ARGUMENTS` and waits for the address it prints. */
export function start(...args: string[]): Promise<Program> {
  const child = spawn(BINARY, [...args, '--json'], { stdio: ['ignore', 'pipe', 'pipe'] });
  return new Promise((resolve, reject) => {
    let text = '';
    let errors = '';
    child.stderr.on('data', (data: Buffer) => (errors += data.toString()));
    child.stdout.on('data', (data: Buffer) => {
      text += data.toString();
      const found = /"address":"([^"]+)"/.exec(text);
      if (!found?.[1]) return;
      const stop = (): Promise<void> =>
        new Promise((done) => {
          if (child.exitCode !== null || child.signalCode !== null) return done();
          child.once('exit', () => done());
          child.kill();
        });
      resolve({ address: found[1], process: child, stop });
    });
    child.once('exit', (code) => reject(new Error(`fork1s ended with ${code}: ${errors}`)));
  });
}

/** Of a scene of this project, or of a file by its full path. */
export const view = (scene: string, ...args: string[]): Promise<Program> =>
  start('view', isAbsolute(scene) ? scene : join(SOURCE, 'scenes', scene), '--no-open', ...(args.includes('--port') ? [] : ['--port', '0']), ...args);

/** The browser of all tests, with nothing open in it. Closing it closes what was opened through it. */
export const launch = (): Promise<Browser> => chromium.connect(BROWSER);

// Drawn in software a picture takes both cores of a small machine for a tenth of a second, and no test looks at more
// than a few: four a second, by a page that is not looked at one in two seconds, leave the cores to what is tested.
const PICTURE_MS = 250;
const UNSEEN_PICTURE_MS = 2000;
declare global {
  var pictureTime: number; // ms
}
function drawSeldom(milliseconds: number): void {
  globalThis.pictureTime = milliseconds;
  const draw = window.requestAnimationFrame.bind(window);
  window.requestAnimationFrame = (callback) => window.setTimeout(() => draw(callback), globalThis.pictureTime);
}

/** Runs something that does not look at the page. */
export async function unseen(page: Page, task: () => Promise<void>): Promise<void> {
  await page.evaluate((time) => (globalThis.pictureTime = time), UNSEEN_PICTURE_MS);
  await task();
  await page.evaluate((time) => (globalThis.pictureTime = time), PICTURE_MS);
}

/** For tests of what stands around the picture: nothing is drawn into it any more, which in software takes seconds. */
export const withoutPicture = (page: Page): Promise<void> =>
  page.evaluate(() => {
    if (fork1s) fork1s.view.stage.render = () => undefined;
  });

/** Opens a page and fails the test on any error in it. */
export async function open(browser: Browser, address: string, options: BrowserContextOptions = {}): Promise<Page> {
  const page = await browser.newPage({ viewport: { width: 480, height: 320 }, ...options });
  await page.addInitScript(drawSeldom, PICTURE_MS);
  page.setDefaultTimeout(120_000); // a page drawn in software beside other work loads in 30 s or not: no test is about that
  page.on('pageerror', (error) => {
    throw error;
  });
  // A shader that does not compile draws nothing and says so here only.
  page.on('console', (message) => {
    const text = message.text();
    if (/^WebSocket connection to/.test(text)) return; // of a page that tries again while its program is gone
    if (message.type() === 'error' || /WebGL/.test(text)) throw new Error(text);
  });
  await page.goto(address);
  return page;
}

/** Gives the page another size and waits until it has taken it, which is after the call. */
export async function resize(page: Page, width: number, height: number): Promise<void> {
  await page.setViewportSize({ width, height });
  await page.waitForFunction(([w, h]) => fork1s?.view.stage.camera.view?.width === w && fork1s.view.stage.camera.view.height === h, [width, height] as const);
}

/** Waits until the page has drawn frames of the stream. */
export async function running(page: Page): Promise<void> {
  await page.waitForFunction(() => (fork1s?.framesTaken ?? 0) > 2 && (fork1s?.view.framesDrawn ?? 0) > 2);
}

/** Where a body's origin is on the page. */
export function screenOf(page: Page, body: string, point: [number, number, number] = [0, 0, 0]): Promise<{ x: number; y: number }> {
  return page.evaluate(
    ([name, p]) => {
      if (!fork1s?.view.scene) throw new Error('no scene');
      return fork1s.screenOf(fork1s.view.scene.bodies.findIndex((b) => b.name === name), p);
    },
    [body, point] as const,
  );
}

export function poseOf(page: Page, body: string): Promise<number[]> {
  return page.evaluate((name) => {
    const at = fork1s?.view.scene?.bodies.findIndex((b) => b.name === name) ?? -1;
    return fork1s?.view.poses()[at]?.p ?? [];
  }, body);
}
