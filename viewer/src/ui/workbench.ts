// The pages of the left panel and what belongs to them: model tree, tuning, signals, moments, advice.
import type { Request } from '../net/live';
import type { SignalStore } from '../signals/store';
import type { View } from '../view';
import type { SceneMessage, SettingsMessage, Shapes, TextMessage } from '../wire/messages';
import { Advice } from './advice';
import { saveFile } from './dom';
import { ModelTree } from './model_tree';
import { MomentCard } from './moment';
import type { Plots } from './plots';
import { SidePanel } from './side_panel';
import { SignalList } from './signal_list';
import { Tuning } from './tuning';

export interface WorkbenchActions {
  send(request: Request): void;
  showPlots(): void;
  opened(open: boolean): void;
}

export class Workbench {
  readonly side: SidePanel;
  readonly tree: ModelTree;
  readonly tuning: Tuning;
  readonly signals: SignalList;
  readonly moment: MomentCard;
  readonly advice: Advice;
  settings: SettingsMessage | null = null; // as the program last told them
  private live = false;

  constructor(
    root: HTMLElement,
    messages: HTMLElement,
    private readonly view: View,
    store: SignalStore,
    private readonly plots: Plots,
    private readonly actions: WorkbenchActions,
  ) {
    this.side = new SidePanel(root, (open) => {
      actions.opened(open);
      this.askForSignals();
    });
    this.tree = new ModelTree(this.side.add('model', 'Model', 'Bodies, joints and shapes as a tree (M)'), view, () => this.tuning.chosen());
    this.tuning = new Tuning(this.side.add('tune', 'Tune', 'Numbers of the model that can be changed (U)'), { send: (r) => actions.send(r), selected: () => view.selected });
    this.signals = new SignalList(this.side.add('signals', 'Signals', 'Every number of the run, for plots (L)'), store, plots, {
      save: () => saveFile('fork1s.csv', store.csv()),
      showPlots: () => actions.showPlots(),
      changed: () => this.askForSignals(),
      estimate: (on) => actions.send({ type: 'set', setting: 'error', value: on ? 1 : 0 }),
    });
    this.moment = new MomentCard(root, (r) => actions.send(r));
    this.advice = new Advice(messages, (r) => actions.send(r));
    this.setLive(false);
  }

  /** A running simulation answers. */
  setLive(on: boolean): void {
    this.live = on;
    this.side.setAvailable('tune', on);
    this.signals.setLive(on);
  }

  /** A click in the scene chooses a body. */
  get selecting(): boolean {
    return this.side.shown === 'model' || this.side.shown === 'tune';
  }

  useScene(scene: SceneMessage, shapes: Shapes): void {
    this.tree.useScene(scene, shapes);
    this.tuning.useScene(scene);
    this.advice.clear();
  }

  useSettings(settings: SettingsMessage): void {
    this.settings = settings;
    this.signals.useSettings(settings.error);
    this.askForSignals();
  }

  take(message: TextMessage): void {
    if (message.type === 'tuning') this.tuning.use(message);
    else if (message.type === 'shaped') this.tuning.shape.use(message);
    else if (message.type === 'advice') this.advice.use(message, this.view.scene);
    else if (message.type === 'written') {
      if (message.text !== '') this.moment.use(message);
      else this.tuning.written(message);
    }
  }

  /** Signals that the program must compute are asked for while something shows them. */
  askForSignals(): void {
    const colouring = this.view.options.colouring === 'error';
    const told = this.plots.signals.some((keys) => keys.some((key) => /^(q|tau|f|error):/.test(key)));
    const wanted = colouring || this.side.shown === 'signals' || (this.plots.shown && told);
    if (!this.live || !this.settings) return;
    if (wanted && !this.settings.signals) this.actions.send({ type: 'set', setting: 'signals', value: 1 });
    if (colouring && !this.settings.error) this.actions.send({ type: 'set', setting: 'error', value: 1 });
  }

  draw(now: number): void {
    this.signals.draw(now);
  }
}
