// Sliders for what the program can change while it runs, and for what the page shows.
import GUI, { type Controller } from 'lil-gui';
import type { Request } from '../net/live';
import type { ViewOptions } from './options';
import type { SceneMessage, SettingsMessage } from '../wire/messages';

export interface PanelActions {
  send(request: Request): void;
  changed(): void;
  opened(): void;
  colouringChanged(): void;
}

const MOST_SLIDERS = 100; // of one kind: a thousand mechanisms have thousands
const SWITCHES = ['accuracy', 'damping', 'friction', 'gravity']; // off at 0
const SLOW = ['accuracy', 'modes', 'dt', 'damping', 'friction', 'stiffness', 'detail', 'recovery']; // build the model again

/** What the settings do, by their names in the stream. */
const TIPS: Record<string, string> = {
  recovery: 'How poses of bodies follow from the reduced state',
  detail: 'Which bodies can touch, and so how many coordinates there are',
  accuracy: 'Modes are added or dt is halved while the estimated error is above this; off: they stay as they are set',
  modes: 'Fixed-interface modes of each mechanism',
  dt: 'Time step',
  damping: 'Multiplies the damping of all joints',
  friction: 'Multiplies the coefficients of friction of all contacts',
  gravity: 'Acceleration along z',
  speed: 'Simulated seconds a second',
  pull_stiffness: 'Stiffness of the spring that pulls a dragged body',
  stiffness: 'Multiplies the stiffness of these joints',
  control: 'Set-point',
};

const VIEW_TIPS: Record<string, string> = {
  colouring: 'What the colours of bodies mean; the legend has them',
  forces: 'Contact forces as arrows, drawn over the bodies',
  arrowScale: 'Length of arrows; auto: the longest is a sixth of the model',
  cones: 'The cones in which contact forces stay',
  compliance: 'How far each interface body gives way to a force, in every direction',
  reference: 'The pose about which the model is reduced, as a ghost',
  on: 'The full-coordinate simulation beside the reduced one, as a violet ghost',
  ghostOffset: 'Distance between the full simulation and the reduced one',
  frames: 'Axes of every body: x red, y green, z blue',
  shadows: 'Shadows of bodies',
  follow: 'The camera goes along with a base that moves',
  copies: 'So many copies, each a frame later than the next',
};

/** Three digits, whole numbers in full, and a word for zero. */
function showDigits(controller: Controller, zero: string): void {
  const field = controller.domElement.querySelector('input');
  const update = controller.updateDisplay.bind(controller);
  controller.updateDisplay = () => {
    update();
    const value = controller.getValue() as number;
    if (field && document.activeElement !== field) field.value = value === 0 ? zero : String(Math.abs(value) >= 100 ? Math.round(value) : Number(value.toPrecision(3)));
    return controller;
  };
  field?.addEventListener('blur', () => controller.updateDisplay());
  controller.updateDisplay();
}

export class Panel {
  private readonly gui: GUI;
  private readonly model: GUI;
  private readonly view: GUI;
  private controls: GUI | null = null;
  private stiffness: GUI | null = null;
  private values: Record<string, number> = {};
  private readonly controllers = new Map<string, Controller>();
  private lists = ''; // names and ranges that the sliders were made for
  private pullRange = 0; // N/m
  private held = ''; // what the user is dragging now: not to be moved under the hand
  private readonly report: Controller;
  private readonly ghost: Controller;
  private readonly ghostOffset: Controller;
  private readonly ghostValue = { on: false };
  private readonly reportText = { reduced: '–' };

  constructor(
    parent: HTMLElement,
    readonly options: ViewOptions,
    private readonly actions: PanelActions,
  ) {
    this.gui = new GUI({ container: parent, title: 'Settings', width: 270 });
    this.gui.domElement.classList.add('panel');
    this.gui.onOpenClose((changed) => {
      if (changed === this.gui && !this.gui._closed) actions.opened();
    });
    // German and many other keyboards write 0,2: it is 0.2, not 0.
    this.gui.domElement.addEventListener(
      'input',
      ({ target }) => {
        if (target instanceof HTMLInputElement && target.type === 'text' && target.value.includes(',')) target.value = target.value.replace(',', '.');
      },
      { capture: true },
    );
    this.model = this.gui.addFolder('Model');
    this.view = this.gui.addFolder('View');
    this.report = this.model.add(this.reportText, 'reduced').name('reduced to').disable();
    const v = this.view;
    const changed = (): void => actions.changed();
    v.add(options, 'colouring', { 'interface bodies': 'tips', roles: 'roles', 'joint gaps': 'gaps', 'estimated error': 'error', 'friction in use': 'friction', file: 'file' }).onChange(() => {
      changed();
      actions.colouringChanged();
    });
    v.add(options, 'forces').name('contact forces').onChange(changed);
    showDigits(v.add(options, 'arrowScale', 0, 100, 0.1).name('arrows, mm per N').onChange(changed), 'auto');
    v.add(options, 'cones').name('friction cones').onChange(changed);
    v.add(options, 'compliance').name('compliance ellipsoids').onChange(changed);
    v.add(options, 'reference').name('reference ghost').onChange(changed);
    this.ghost = v
      .add(this.ghostValue, 'on')
      .name('full simulation')
      .onChange((on: boolean) => actions.send({ type: 'ghost', on }));
    this.ghostOffset = v.add(options, 'ghostOffset', 0, 1, 0.001).name('…aside by [m]').onChange(changed);
    v.add(options, 'frames').name('body frames').onChange(changed);
    v.add(options, 'shadows').onChange(changed);
    v.add(options, 'follow').name('camera follows').onChange(changed);
    v.add(options, 'copies', { '1': 1, '100': 100, '1000': 1000 }).name('copies, in time').onChange(changed);
    for (const controller of v.controllers) controller.domElement.title = VIEW_TIPS[controller.property] ?? '';
    this.view.close();
  }

  private slider(gui: GUI, key: string, name: string, low: number, high: number, step: number, index?: number): void {
    this.values[key] ??= 0;
    const setting = key.split('/')[0] ?? key;
    const send = (value: number): void => {
      // Shown in mm, told in m.
      const told = setting === 'accuracy' ? value / 1000 : value;
      this.actions.send({ type: 'set', setting, ...(index === undefined ? {} : { index }), value: told });
    };
    const controller = gui.add(this.values, key, low, high, step).name(name);
    showDigits(controller, SWITCHES.includes(setting) ? 'off' : '0');
    controller.domElement.title = `${name}: ${TIPS[setting] ?? ''}`;
    controller.onChange((value: number) => {
      this.held = key;
      if (!SLOW.includes(setting)) send(value);
    });
    controller.onFinishChange((value: number) => {
      this.held = '';
      if (SLOW.includes(setting)) send(value);
    });
    this.controllers.set(key, controller);
  }

  private choice(gui: GUI, key: string, name: string, choices: Record<string, number>): void {
    this.values[key] ??= 0;
    const controller = gui.add(this.values, key, choices).name(name);
    controller.domElement.title = TIPS[key] ?? '';
    controller.onChange((value: number) => this.actions.send({ type: 'set', setting: key, value }));
    this.controllers.set(key, controller);
  }

  private settings: SettingsMessage | null = null;

  /** New lists of sliders where the model has other controls or groups. */
  useScene(scene: SceneMessage): void {
    const r = scene.roots.map((root) => root.reduced).filter((x) => x !== undefined);
    const sum = (f: 'free' | 'elastic' | 'modes'): number => r.reduce((s, x) => s + x[f], 0);
    const n = scene.screws.length;
    this.reportText.reduced = `${sum('free') + sum('elastic') + sum('modes')} of ${n} (${sum('modes')} modes)`;
    this.report.updateDisplay();
    if (!this.controllers.has('recovery')) this.buildModel();
    this.ghostOffset.max(Number((3 * scene.radius).toPrecision(2)));
    const lists = JSON.stringify([scene.groups, scene.controls]);
    if (lists !== this.lists) this.buildLists(scene);
    this.lists = lists;
    if (this.settings) this.useSettings(this.settings);
  }

  private buildModel(): void {
    this.choice(this.model, 'recovery', 'recovery', { exact: 0, expanded: 3, curved: 2, twist: 1 });
    this.choice(this.model, 'detail', 'detail level', { 'what it holds': 0, 'interface as given': 1, 'and their parents': 2, 'every body': 3 });
    this.slider(this.model, 'accuracy', 'accuracy [mm]', 0, 10, 0.001);
    this.slider(this.model, 'modes', 'modes', 0, 16, 1);
    this.slider(this.model, 'dt', 'dt [s]', 0.0005, 1 / 30, 0.0001);
    this.slider(this.model, 'damping', 'damping ×', 0, 10, 0.01);
    this.slider(this.model, 'friction', 'friction ×', 0, 3, 0.01);
    this.slider(this.model, 'gravity', 'gravity [m/s²]', -20, 5, 0.01);
    this.slider(this.model, 'speed', 'speed ×', 0.05, 2, 0.05);
    this.slider(this.model, 'pull_stiffness', 'pull [N/m]', 1, 1, 0.1);
  }

  /** Names and ranges stay until another model file is read. */
  private buildLists(scene: SceneMessage): void {
    for (const key of [...this.controllers.keys()]) if (key.includes('/')) this.controllers.delete(key);
    const stiffness = this.again(this.stiffness, 'Stiffness ×', scene.groups.length);
    scene.groups.slice(0, MOST_SLIDERS).forEach((group, i) => this.slider(stiffness, `stiffness/${i}`, group.name, 0.05, 20, 0.05, i));
    const controls = this.again(this.controls, 'Set-points', scene.controls.length);
    scene.controls.slice(0, MOST_SLIDERS).forEach((control, i) => {
      const [low, high] = control.range;
      this.slider(controls, `control/${i}`, control.name, low, high, (high - low) / 1000, i);
    });
    const hold = controls.add({ hold: () => this.actions.send({ type: 'hold' }) }, 'hold').name('Hold this posture');
    hold.domElement.title = 'Set-points of position servos take the present joint positions';
    this.controllers.set('hold', hold);
    this.stiffness = stiffness;
    this.controls = controls;
  }

  private again(before: GUI | null, title: string, count: number): GUI {
    const open = before !== null && !before._closed;
    before?.destroy();
    const gui = this.gui.addFolder(count > MOST_SLIDERS ? `${title} (${MOST_SLIDERS} of ${count})` : title);
    if (count === 0) gui.hide();
    if (!open) gui.close();
    return gui;
  }

  useSettings(s: SettingsMessage): void {
    this.settings = s;
    this.ghostValue.on = s.ghost;
    this.ghost.updateDisplay();
    for (const key of ['dt', 'gravity', 'damping', 'friction', 'modes', 'detail', 'recovery', 'pull_stiffness', 'speed'] as const)
      this.values[key] = s[key];
    this.values['accuracy'] = 1000 * s.accuracy;
    s.stiffness.slice(0, MOST_SLIDERS).forEach((x, i) => (this.values[`stiffness/${i}`] = x));
    s.controls.slice(0, MOST_SLIDERS).forEach((x, i) => (this.values[`control/${i}`] = x));
    const pull = this.controllers.get('pull_stiffness');
    if (pull && this.pullRange < 2 * s.pull_stiffness) {
      this.pullRange = 5 * s.pull_stiffness;
      pull.max(this.pullRange).step(s.pull_stiffness / 100);
    }
    for (const [key, controller] of this.controllers) if (key !== this.held) controller.updateDisplay();
  }

  setEnabled(enabled: boolean): void {
    for (const controller of [...this.controllers.values(), this.ghost]) controller.enable(enabled);
  }

  /** A recording from disk has no program behind it that could change the model. */
  hideModel(): void {
    this.model.hide();
    this.controls?.hide();
    this.stiffness?.hide();
    this.ghost.hide();
    this.ghostOffset.hide();
    this.view.open();
    this.gui.close();
  }

  toggle(): void {
    this.gui.open(this.gui._closed);
  }

  close(): void {
    this.gui.close();
  }
}
