import { describe, expect, it } from 'vitest';
import { COLORS, DARK, LIGHT, type Theme } from '../../src/scene/theme';

const channels = (color: number): number[] => [(color >> 16) & 255, (color >> 8) & 255, color & 255];
/** Relative luminance and contrast of the Web Content Accessibility Guidelines. */
const luminance = (rgb: number[]): number => {
  const [r = 0, g = 0, b = 0] = rgb.map((c) => (c / 255 <= 0.04045 ? c / 255 / 12.92 : ((c / 255 + 0.055) / 1.055) ** 2.4));
  return 0.2126 * r + 0.7152 * g + 0.0722 * b;
};
const contrast = (a: number[], b: number[]): number => {
  const [low = 0, high = 0] = [luminance(a), luminance(b)].sort((x, y) => x - y);
  return (high + 0.05) / (low + 0.05);
};
/** The ground's grid is blended: its strong lines by half. */
const gridLine = (theme: Theme): number[] => {
  const page = channels(theme.background);
  return channels(theme.line).map((c, i) => 0.5 * c + 0.5 * (page[i] ?? 0));
};

describe.each([
  ['light', LIGHT],
  ['dark', DARK],
])('%s', (_, theme) => {
  it('has a grid that can be told from the ground, and is no stripe', () => {
    const seen = contrast(gridLine(theme), channels(theme.background));
    expect(seen).toBeGreaterThan(1.2);
    expect(seen).toBeLessThan(4);
  });
  it('has colours of roles that stand out from the page', () => {
    for (const color of [COLORS.interface, COLORS.interior, COLORS.free, COLORS.contact])
      expect(contrast(channels(color), channels(theme.background))).toBeGreaterThan(2);
  });
});
