// The part of the page that no panel covers.

export interface Area {
  left: number;
  top: number;
  right: number;
  bottom: number;
}

const LEAST_SHARE = 1 / 3; // of the smaller side of the page: in less no model is seen

export function squareSide(area: Area): number {
  return Math.min(area.right - area.left, area.bottom - area.top);
}

/** Where the largest square of the page fits beside the boxes, which may reach beyond it; of several the one with the largest area. */
export function findFreeArea(width: number, height: number, boxes: readonly Area[]): Area {
  let best: Area = { left: 0, top: 0, right: 0, bottom: 0 };
  const surface = (a: Area): number => (a.right - a.left) * (a.bottom - a.top);
  for (const left of [0, ...boxes.map((b) => b.right)])
    for (const right of [width, ...boxes.map((b) => b.left)])
      for (const top of [0, ...boxes.map((b) => b.bottom)])
        for (const bottom of [height, ...boxes.map((b) => b.top)]) {
          const area = { left, top, right, bottom };
          const gain = squareSide(area) - squareSide(best) || surface(area) - surface(best);
          const covered = boxes.some((b) => b.left < right && b.right > left && b.top < bottom && b.bottom > top);
          if (gain > 0 && left >= 0 && top >= 0 && right <= width && bottom <= height && !covered) best = area;
        }
  const least = LEAST_SHARE * Math.min(width, height);
  const [x, extraX] = widen(best.left, best.right, least, width);
  const [y, extraY] = widen(best.top, best.bottom, least, height);
  return { left: x, top: y, right: x + extraX, bottom: y + extraY };
}

/** Start and length of an interval in [0, end] that is at least so long. */
function widen(from: number, to: number, least: number, end: number): [number, number] {
  const length = Math.max(least, to - from);
  return [Math.min(end - length, Math.max(0, (from + to - length) / 2)), length];
}
