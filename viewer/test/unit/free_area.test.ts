import { describe, expect, it } from 'vitest';
import { findFreeArea, squareSide } from '../../src/ui/free_area';

describe('the area that nothing covers', () => {
  it('is the page without panels', () => {
    expect(findFreeArea(390, 844, [])).toEqual({ left: 0, top: 0, right: 390, bottom: 844 });
  });

  it('lies between the head and the legend of a phone', () => {
    const head = { left: 12, top: 12, right: 378, bottom: 120 };
    const legend = { left: 12, top: 440, right: 378, bottom: 832 };
    expect(findFreeArea(390, 844, [head, legend])).toEqual({ left: 0, top: 120, right: 390, bottom: 440 });
  });

  it('lies beside a panel where that leaves a larger square', () => {
    const head = { left: 0, top: 0, right: 300, bottom: 100 };
    const side = { left: 0, top: 110, right: 200, bottom: 390 };
    expect(findFreeArea(844, 390, [head, side])).toEqual({ left: 300, top: 0, right: 844, bottom: 390 });
  });

  it('does not follow a panel that reaches out of the page', () => {
    const head = { left: 0, top: 0, right: 300, bottom: 100 };
    const low = { left: 0, top: 900, right: 300, bottom: 950 };
    expect(findFreeArea(300, 600, [head, low])).toEqual({ left: 0, top: 100, right: 300, bottom: 600 });
  });

  it('is a third of the smaller side where panels leave less, and within the page', () => {
    for (const cover of [{ left: 0, top: 0, right: 300, bottom: 590 }, { left: 0, top: 0, right: 300, bottom: 600 }]) {
      const area = findFreeArea(300, 600, [cover]);
      expect(squareSide(area)).toBeGreaterThanOrEqual(100);
      expect(Math.max(area.bottom - 600, area.right - 300, -area.left, -area.top)).toBeLessThanOrEqual(1e-9);
    }
  });
});
