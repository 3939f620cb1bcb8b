// One browser for all files of tests: its start, and the shaders it has compiled, are paid for once.
import { existsSync } from 'node:fs';
import { chromium } from 'playwright-core';
import type { TestProject } from 'vitest/node';

declare module 'vitest' {
  interface ProvidedContext {
    browser: string;
  }
}

const CHROMIUM = [process.env['FORK1S_CHROMIUM'] ?? '', '/usr/bin/chromium', '/usr/bin/chromium-browser'].find((p) => p && existsSync(p));

/** Gives the tests the browser's address; none where there is no browser. */
export default async function setup(project: TestProject): Promise<(() => Promise<void>) | undefined> {
  if (!CHROMIUM) {
    project.provide('browser', '');
    return undefined;
  }
  const server = await chromium.launchServer({
    executablePath: CHROMIUM,
    args: [
      '--headless',
      '--no-sandbox',
      // On the processor, the same everywhere; FORK1S_GPU=1 is for what is measured (frames.test.ts).
      ...(process.env['FORK1S_GPU'] === '1' ? ['--ignore-gpu-blocklist', '--use-gl=angle'] : ['--use-angle=swiftshader', '--enable-unsafe-swiftshader']),
      '--disable-quic',
      '--no-first-run',
      '--disable-background-networking',
      '--disable-component-update',
      '--disable-sync',
    ],
  });
  project.provide('browser', server.wsEndpoint());
  return () => server.close();
}
