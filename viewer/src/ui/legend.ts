// What colours and lengths mean.
import { COLORS } from '../scene/theme';
import type { Frame } from '../wire/messages';
import type { View } from '../view';
import { element, shortUnit, withUnit } from './dom';

/** Below this multiple of its contact forces a grasp is called near to ejecting its object. */
const SAFE_LOAD_FACTOR = 1.3;

const css = (color: number): string => `#${color.toString(16).padStart(6, '0')}`;
const FULL = 0x8a63c4; // also the compliance ellipsoids
const REFERENCE = 0x7a8794;

export class Legend {
  private readonly root: HTMLElement;
  private shown = '';

  constructor(parent: HTMLElement) {
    this.root = element('div', 'legend box', parent);
    this.root.setAttribute('role', 'note');
    this.root.setAttribute('aria-label', 'Legend');
  }

  show(view: View, frame: Frame, loadFactor: number): void {
    const { colouring, forces, arrowScale } = view.options;
    const parts: [string, string][] = [];
    if (colouring === 'gaps') parts.push(['bar', `joint gap 0 to ${withUnit(1000 * view.fullGap, 'mm')}`]);
    else if (colouring === 'error') parts.push(['bar', `estimated error 0 to ${withUnit(1000 * view.fullGap, 'mm')}`]);
    else if (colouring === 'friction') parts.push(['bar', 'friction in use 0 to 100 %']);
    else if (colouring !== 'file') parts.push([css(COLORS.interface), 'interface']);
    if (colouring === 'roles') parts.push([css(COLORS.interior), 'interior'], [css(COLORS.free), 'free']);
    if (view.marked.size > 0 || view.selected !== null) parts.push([css(COLORS.pull), 'chosen']);
    if (forces && frame.contacts.length > 0) {
      const { scale } = view.contacts;
      const newtons = arrowScale > 0 ? 10 : nice((0.1 * view.modelSize) / scale);
      parts.push([css(COLORS.contact), `contact force: arrow ${shortUnit(1000 * newtons * scale, 'mm')} = ${shortUnit(newtons, 'N')}`]);
    }
    const { options, scene } = view;
    const drawn: [boolean, number, string][] = [
      [frame.pulls.length > 0, COLORS.pull, 'pull'],
      [options.cones && frame.contacts.length > 0, COLORS.cone, 'friction cone'],
      [view.anatomy.drawsHinges, COLORS.hinge, 'hinge axis'],
      [view.anatomy.drawsSlides, COLORS.slide, 'slide axis'],
      [options.centers, COLORS.center, 'centre of mass'],
      [options.inertia, COLORS.center, 'box of inertia'],
      [options.tendons && (scene?.tendons.length ?? 0) > 0, COLORS.tendon, 'tendon'],
      [options.frames, 0xd0413e, 'x'],
      [options.frames, 0x3f9b72, 'y'],
      [options.frames, 0x2f7fd8, 'z'],
      [options.reference, REFERENCE, 'reference pose'],
      [view.fullShown, FULL, 'full simulation'],
    ];
    for (const [on, color, label] of drawn) if (on) parts.push([css(color), label]);
    if (options.compliance && view.ellipsoids.newtons > 0)
      parts.push([css(FULL), `compliance: motion under ${shortUnit(view.ellipsoids.newtons, 'N')}`]);
    if (Number.isFinite(loadFactor))
      parts.push(['', `grasp load factor ${withUnit(loadFactor, '').trim()}${loadFactor < SAFE_LOAD_FACTOR ? ': may eject' : ''}`]);
    if (view.stage.gridShown) parts.push(['', `grid: ${shortUnit(view.stage.gridSpacing, 'm')}`]);
    const text = JSON.stringify(parts);
    if (text === this.shown) return;
    this.shown = text;
    this.root.replaceChildren(
      ...parts.map(([color, label]) => {
        const item = document.createElement('span');
        if (color === 'bar') element('i', 'colours', item);
        else if (color) {
          const dot = element('i', '', item);
          dot.style.background = color;
        }
        item.append(label);
        return item;
      }),
    );
  }
}

/** 1, 2 or 5 times a power of ten near x. */
function nice(x: number): number {
  const power = 10 ** Math.floor(Math.log10(x));
  return power * (x >= 5 * power ? 5 : x >= 2 * power ? 2 : 1);
}
