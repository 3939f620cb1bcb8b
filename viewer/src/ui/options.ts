// What the page shows, as its controls stand.
import type { AnatomyOptions } from '../scene/anatomy_view';
import type { Colouring } from '../scene/colouring';
import type { ShapeChoice } from '../scene/shapes';

export interface ViewOptions extends AnatomyOptions, ShapeChoice {
  colouring: Colouring;
  forces: boolean;
  cones: boolean;
  arrowScale: number; // mm per N, 0: automatic
  frames: boolean;
  shadows: boolean;
  follow: boolean;
  world: boolean; // the still world's shapes
  reference: boolean;
  compliance: boolean;
  ghostOffset: number; // m
  copies: number;
}

export const defaultOptions = (colouring: Colouring): ViewOptions => ({
  colouring,
  forces: true,
  cones: false,
  arrowScale: 0,
  frames: false,
  shadows: true,
  follow: true,
  world: true,
  shapes: 'visual',
  hiddenGroups: new Set(),
  axes: false,
  centers: false,
  inertia: false,
  tendons: true,
  reference: false,
  compliance: false,
  ghostOffset: 0,
  copies: 1,
});
