import { defineConfig } from 'vitest/config';

// Each test drives a real program and a real browser without a GPU: slow, and nothing here asserts a time.
export default defineConfig({
  test: {
    include: ['test/browser/**/*.test.ts'],
    globalSetup: 'test/browser/one_browser.ts',
    testTimeout: 120_000,
    hookTimeout: 120_000,
    fileParallelism: false,
    expect: { poll: { timeout: 30_000 } }, // of 1 s a page under load took more
  },
});
