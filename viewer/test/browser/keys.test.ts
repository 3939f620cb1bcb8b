// Keys do the same wherever the focus is; text fields alone keep what is typed into them.
import { beforeAll, describe, expect, it } from 'vitest';
import { ready, resize, session, view, withoutPicture } from './support';

describe.skipIf(!ready)('keys', () => {
  const live = session(() => view('hand.xml', '--keyframe', 'open'));
  const paused = (on: boolean): Promise<unknown> => live.page.waitForFunction((wanted) => fork1s?.view.frame?.paused === wanted, on);

  beforeAll(async () => {
    await withoutPicture(live.page);
    await resize(live.page, 1280, 720);
    await live.page.locator('canvas.stage').focus();
    await live.page.keyboard.press('m');
  });

  const PLACES: [string, string][] = [
    ['a button', '.head .bar button >> nth=2'],
    ['a tab', '[role=tab] >> nth=0'],
    ['a checkbox', '.side input[type=checkbox] >> nth=0'],
    ['a list', '.lil-gui.panel select >> nth=0'],
    ['a row of the tree', '[role=treeitem] >> nth=0'],
  ];
  for (const [name, selector] of PLACES)
    it(`space pauses with the focus on ${name}, which stays as it is`, async () => {
      const { page } = live;
      await page.locator(selector).focus();
      const checked = await page.locator('.side input:checked').count();
      const time = await page.evaluate(() => fork1s?.scalar('time') ?? 0);
      await page.keyboard.press('Space');
      await paused(true);
      await page.keyboard.press('Space');
      await paused(false);
      expect(await page.locator('.side input:checked').count()).toBe(checked);
      expect(await page.evaluate(() => fork1s?.scalar('time') ?? 0)).toBeGreaterThanOrEqual(time); // no reset
      await page.keyboard.press('p');
      await page.locator('.plots').waitFor();
      await page.keyboard.press('p');
      await page.locator('.plots').waitFor({ state: 'hidden' });
    });

  it('a checkbox turns by enter', async () => {
    const box = live.page.locator('.side input[type=checkbox]').first();
    const before = await box.isChecked();
    await box.focus();
    await live.page.keyboard.press('Enter');
    expect(await box.isChecked()).toBe(!before);
    await live.page.keyboard.press('Enter');
  });

  it('a text field takes letters and spaces, and escape leaves it', async () => {
    const { page } = live;
    await page.keyboard.press('l');
    const field = page.getByPlaceholder('Find a signal');
    await field.focus();
    await page.keyboard.type('p r');
    expect(await field.inputValue()).toBe('p r');
    expect(await page.locator('.plots').isVisible()).toBe(false);
    await page.keyboard.press('Escape');
    await page.keyboard.press('p');
    await page.locator('.plots').waitFor();
  });

  it('escape leaves picking, the past and a recording, one after the other', async () => {
    const { page } = live;
    await page.keyboard.press('i');
    await page.keyboard.press('?');
    await page.locator('.help').waitFor();
    await page.keyboard.press('Escape');
    await page.locator('.help').waitFor({ state: 'hidden' });
    expect(await page.locator('.pick').isVisible()).toBe(true);
    await page.keyboard.press('Escape');
    await page.locator('.pick').waitFor({ state: 'hidden' });
    await page.keyboard.press('ArrowLeft');
    await page.locator('.timeline input').focus();
    const at = await page.evaluate(() => fork1s?.timeline?.at ?? 0);
    await page.keyboard.press('ArrowLeft');
    expect(await page.evaluate(() => fork1s?.timeline?.at)).toBe(at - 1);
    await page.keyboard.press('Space');
    expect(await page.evaluate(() => fork1s?.timeline?.playing)).toBe(true);
    await page.keyboard.press('Escape');
    await page.locator('.timeline').waitFor({ state: 'detached' });
    await paused(false);
    await page.keyboard.press('r');
    await page.waitForFunction(() => (fork1s?.recorder.frames ?? 0) > 2);
    await page.keyboard.press('Escape');
    await page.locator('.timeline').waitFor();
    await page.keyboard.press('Escape');
    await page.locator('.timeline').waitFor({ state: 'detached' });
  });
});
