// Bodies, joints, actuators and shapes of the model as a tree; what is chosen here is lit up in the scene.
import { subtree } from '../scene/visibility';
import type { View } from '../view';
import type { SceneMessage, ShapeInfo, Shapes } from '../wire/messages';
import { checkbox, element, shortUnit, textButton } from './dom';

/** Rows beyond these are not made: a thousand mechanisms are found by the filter. */
const MOST_ROWS = 400;

interface Row {
  key: string; // of what may be opened
  level: number;
  icon: string;
  text: string;
  detail: string;
  body: number; // -1: the still world
  open: boolean | null; // null: has nothing below it
}

export class ModelTree {
  private readonly tree: HTMLElement;
  private readonly filter: HTMLInputElement;
  private readonly card: HTMLElement;
  private readonly groups: HTMLElement;
  private readonly opened = new Set<string>();
  private scene: SceneMessage | null = null;
  private shapes: Shapes | null = null;
  private rows: Row[] = [];
  private focused = 0;

  constructor(
    page: HTMLElement,
    private readonly view: View,
    private readonly chosen: () => void,
  ) {
    this.filter = element('input', 'filter', page);
    this.filter.type = 'search';
    this.filter.placeholder = 'Find a body, joint or actuator';
    this.filter.setAttribute('aria-label', this.filter.placeholder);
    this.filter.addEventListener('input', () => this.build());
    this.tree = element('div', 'tree', page);
    this.tree.setAttribute('role', 'tree');
    this.tree.setAttribute('aria-label', 'Model');
    this.tree.addEventListener('keydown', (event) => this.key(event));
    this.card = element('div', 'chosen', page);
    this.card.setAttribute('aria-live', 'polite');
    const shown = element('fieldset', 'shown', page);
    element('legend', '', shown).textContent = 'Show';
    const { options } = view;
    const flag = (name: 'axes' | 'centers' | 'inertia' | 'tendons' | 'world', label: string): void => {
      checkbox(label, options[name], shown, (on) => {
        options[name] = on;
        view.restyle();
      });
    };
    flag('axes', 'joint axes');
    flag('centers', 'centres of mass');
    flag('inertia', 'inertia boxes');
    flag('tendons', 'tendons');
    flag('world', 'still world');
    const choice = element('label', '', shown);
    choice.append('shapes ');
    const select = element('select', '', choice);
    for (const name of ['visual', 'collision', 'both'] as const) element('option', '', select).textContent = name;
    select.addEventListener('change', () => {
      options.shapes = select.value as typeof options.shapes;
      view.restyle();
    });
    this.groups = element('span', 'groups', shown);
  }

  useScene(scene: SceneMessage, shapes: Shapes): void {
    const first = this.scene === null;
    this.scene = scene;
    if (this.shapes !== shapes) this.useShapes(shapes);
    if (first && scene.roots.length <= 3) for (const body of scene.bodies) if (body.parent < 0) this.opened.add(`body ${body.name}`);
    this.build();
    this.describe();
  }

  private useShapes(shapes: Shapes): void {
    this.shapes = shapes;
    const { options } = this.view;
    const groups = [...new Set(shapes.geometry.shapes.map((s) => s.group))].sort((a, b) => a - b);
    this.groups.replaceChildren();
    if (groups.length < 2) return;
    this.groups.append('groups ');
    for (const group of groups)
      checkbox(String(group), !options.hiddenGroups.has(group), this.groups, (on) => {
        const hidden = new Set(options.hiddenGroups);
        if (on) hidden.delete(group);
        else hidden.add(group);
        options.hiddenGroups = hidden;
        this.view.restyle();
      });
  }

  /** As a click on its row does; null: nothing. Opens what it stands in. */
  choose(body: number): void {
    const info = this.scene?.bodies[body];
    this.view.selected = info?.name ?? null;
    for (let b = info?.parent ?? -1; b >= 0; b = this.scene?.bodies[b]?.parent ?? -1)
      this.opened.add(`body ${this.scene?.bodies[b]?.name ?? ''}`);
    this.view.restyle();
    this.build();
    this.describe();
    this.focused = this.rows.findIndex((row) => row.body === body && row.icon === 'body');
    this.tree.children[this.focused]?.scrollIntoView({ block: 'nearest' });
    this.chosen();
  }

  get selected(): number {
    return this.scene?.bodies.findIndex((b) => b.name === this.view.selected) ?? -1;
  }

  private build(): void {
    const scene = this.scene;
    if (!scene) return;
    const wanted = this.filter.value.trim().toLowerCase();
    this.rows = wanted === '' ? this.treeRows(scene) : this.found(scene, wanted);
    const rows = this.rows.slice(0, MOST_ROWS);
    this.tree.replaceChildren(...rows.map((row, i) => this.element(row, i)));
    if (this.rows.length > rows.length)
      element('p', 'more', this.tree).textContent = `and ${this.rows.length - rows.length} more: find them by name`;
  }

  private treeRows(scene: SceneMessage): Row[] {
    const rows: Row[] = [];
    const children = new Map<number, number[]>();
    const jointsOf = new Map<number, number[]>();
    const shapesOf = new Map<number, ShapeInfo[]>();
    const push = <T>(map: Map<number, T[]>, key: number, value: T): void => {
      const list = map.get(key);
      if (list) list.push(value);
      else map.set(key, [value]);
    };
    scene.bodies.forEach((body, b) => push(children, body.parent, b));
    scene.joints.forEach((joint, j) => push(jointsOf, joint.body, j));
    for (const shape of this.shapes?.geometry.shapes ?? []) push(shapesOf, shape.body, shape);
    const add = (b: number, level: number): void => {
      const body = scene.bodies[b];
      if (!body || rows.length > 4 * MOST_ROWS) return;
      const key = `body ${body.name}`;
      const open = this.opened.has(key);
      rows.push({ key, level, icon: 'body', text: body.name, detail: body.interface ? 'interface' : '', body: b, open });
      if (!open) return;
      for (const j of jointsOf.get(b) ?? []) rows.push(...this.jointRows(scene, j, b, level + 1));
      const shapes = shapesOf.get(b) ?? [];
      if (shapes.length > 0) rows.push(...this.shapeRows(`shapes ${body.name}`, shapes, b, level + 1));
      for (const child of children.get(b) ?? []) add(child, level + 1);
    };
    for (const b of children.get(-1) ?? []) add(b, 1);
    const still = shapesOf.get(-1) ?? [];
    if (still.length > 0) rows.push(...this.shapeRows('shapes of the still world', still, -1, 1));
    return rows;
  }

  private jointRows(scene: SceneMessage, j: number, body: number, level: number): Row[] {
    const joint = scene.joints[j];
    if (!joint) return [];
    const rows: Row[] = [{ key: '', level, icon: 'joint', text: joint.name, detail: joint.kind, body, open: null }];
    for (const control of scene.controls)
      if (control.joints.includes(j))
        rows.push({ key: '', level: level + 1, icon: 'actuator', text: control.name, detail: 'actuator', body, open: null });
    for (const tendon of scene.tendons)
      if (tendon.elements.some((e) => e.body === body))
        rows.push({ key: '', level, icon: 'tendon', text: tendon.name, detail: 'tendon', body, open: null });
    return rows;
  }

  private shapeRows(key: string, shapes: readonly ShapeInfo[], body: number, level: number): Row[] {
    const open = this.opened.has(key);
    const text = body < 0 ? 'still world' : `${shapes.length} shape${shapes.length > 1 ? 's' : ''}`;
    const rows: Row[] = [{ key, level, icon: 'shapes', text, detail: '', body, open }];
    if (!open) return rows;
    const sorted = [...shapes].sort((a, b) => a.group - b.group);
    for (const shape of sorted)
      rows.push({
        key: '',
        level: level + 1,
        icon: 'shape',
        text: shape.name || shape.kind,
        detail: `${shape.name ? `${shape.kind}, ` : ''}group ${shape.group}${shape.collides ? ', touches' : ''}`,
        body,
        open: null,
      });
    return rows;
  }

  private found(scene: SceneMessage, wanted: string): Row[] {
    const rows: Row[] = [];
    const fits = (name: string): boolean => name.toLowerCase().includes(wanted);
    const add = (icon: string, text: string, detail: string, body: number): void => {
      rows.push({ key: '', level: 1, icon, text, detail, body, open: null });
    };
    scene.bodies.forEach((b, i) => fits(b.name) && add('body', b.name, b.interface ? 'interface' : '', i));
    for (const j of scene.joints) if (fits(j.name)) add('joint', j.name, j.kind, j.body);
    for (const c of scene.controls) if (fits(c.name)) add('actuator', c.name, 'actuator', scene.joints[c.joints[0] ?? -1]?.body ?? -1);
    return rows;
  }

  private element(row: Row, i: number): HTMLElement {
    const item = document.createElement('div');
    item.className = `row ${row.icon}`;
    item.setAttribute('role', 'treeitem');
    item.setAttribute('aria-level', String(row.level));
    if (row.open !== null) item.setAttribute('aria-expanded', String(row.open));
    const chosen = row.icon === 'body' && row.body === this.selected;
    item.setAttribute('aria-selected', String(chosen));
    item.tabIndex = i === Math.max(0, this.focused) ? 0 : -1;
    item.style.paddingLeft = `${4 + 12 * (row.level - 1)}px`;
    const fold = element('span', 'fold', item);
    fold.textContent = row.open === null ? '' : row.open ? '▾' : '▸';
    fold.addEventListener('click', (event) => {
      this.fold(row);
      event.stopPropagation();
    });
    element('span', 'name', item).textContent = row.text;
    if (row.detail) element('span', 'detail', item).textContent = row.detail;
    const name = this.scene?.bodies[row.body]?.name;
    if (name !== undefined && this.view.visibility.isHidden(name)) item.classList.add('hidden');
    item.addEventListener('click', () => {
      if (row.icon === 'shapes' && row.open !== null) this.fold(row);
      else if (row.body >= 0) this.choose(row.body);
    });
    item.addEventListener('dblclick', () => this.fold(row));
    return item;
  }

  private fold(row: Row): void {
    if (row.open === null) return;
    if (row.open) this.opened.delete(row.key);
    else this.opened.add(row.key);
    this.build();
  }

  /** The row that the one at this place stands in. */
  private outer(at: number): number {
    const level = this.rows[at]?.level ?? 1;
    let i = at;
    while (i > 0 && (this.rows[i]?.level ?? 0) >= level) --i;
    return i;
  }

  private key(event: KeyboardEvent): void {
    const items = [...this.tree.querySelectorAll<HTMLElement>('[role=treeitem]')];
    const at = items.indexOf(document.activeElement as HTMLElement);
    const row = this.rows[at];
    if (!row) return;
    const go = (i: number): void => {
      this.focused = Math.max(0, Math.min(items.length - 1, i));
      this.build();
      (this.tree.children[this.focused] as HTMLElement | undefined)?.focus();
    };
    const acts: Record<string, () => void> = {
      ArrowDown: () => go(at + 1),
      ArrowUp: () => go(at - 1),
      Home: () => go(0),
      End: () => go(items.length - 1),
      ArrowRight: () => (row.open === false ? (this.fold(row), go(at)) : go(at + 1)),
      ArrowLeft: () => (row.open ? (this.fold(row), go(at)) : go(this.outer(at))),
      Enter: () => {
        if (row.body >= 0) this.choose(row.body);
        go(at);
      },
    };
    const act = acts[event.key];
    if (!act) return;
    act();
    event.stopPropagation();
    event.preventDefault();
  }

  /** What is chosen, and what can be done with it. */
  private describe(): void {
    this.card.replaceChildren();
    const { scene, view } = this;
    const at = this.selected;
    const body = scene?.bodies[at];
    if (!scene || !body) {
      element('p', 'hint', this.card).textContent = 'Click a body here or in the scene.';
      return;
    }
    const joints = scene.joints.filter((j) => j.body === at).map((j) => `${j.name} (${j.kind})`);
    element('h3', '', this.card).textContent = body.name;
    const parts = [shortUnit(body.mass, 'kg'), body.interface ? 'interface' : scene.roots[body.root]?.base === 'free' ? 'free body' : 'interior'];
    if (joints.length > 0) parts.push(`joint ${joints.join(', ')}`);
    element('p', '', this.card).textContent = parts.join(' · ');
    const bar = element('div', 'bar', this.card);
    const { visibility } = view;
    const redo = (): void => {
      view.restyle();
      this.build();
      this.describe();
    };
    textButton(visibility.isHidden(body.name) ? 'Show' : 'Hide', bar, () => {
      visibility.setHidden([body.name], !visibility.isHidden(body.name));
      redo();
    });
    textButton('Isolate', bar, () => {
      visibility.isolate(scene, new Set(subtree(scene, at).map((b) => scene.bodies[b]?.name ?? '')));
      redo();
    }).title = 'This body and what it carries, alone';
    if (!visibility.isPlain)
      textButton('Show all', bar, () => {
        visibility.showAll();
        redo();
      });
    const label = element('label', 'fade', this.card);
    label.append('opacity ');
    const slider = element('input', '', label);
    slider.type = 'range';
    slider.min = '0.1';
    slider.max = '1';
    slider.step = '0.05';
    slider.value = String(visibility.of(body.name) || 1);
    slider.addEventListener('input', () => {
      visibility.setShare(body.name, Number(slider.value));
      view.restyle();
    });
  }
}
