// The left panel: one of several pages at a time, chosen by tabs.
import { element } from './dom';

export class SidePanel {
  readonly root: HTMLElement;
  private readonly bar: HTMLElement;
  private readonly tabs = new Map<string, { tab: HTMLButtonElement; page: HTMLElement }>();
  private current = '';

  constructor(
    parent: HTMLElement,
    private readonly changed: (open: boolean) => void,
  ) {
    this.root = element('section', 'side box', parent);
    this.root.hidden = true;
    this.root.setAttribute('aria-label', 'Workbench');
    this.bar = element('div', 'tabs', this.root);
    this.bar.setAttribute('role', 'tablist');
  }

  /** A page with a tab; what belongs on it is put into the element that comes back. */
  add(name: string, title: string, tip: string): HTMLElement {
    const tab = element('button', '', this.bar);
    tab.type = 'button';
    tab.textContent = title;
    tab.title = tip;
    tab.id = `tab-${name}`;
    tab.setAttribute('role', 'tab');
    tab.setAttribute('aria-controls', `page-${name}`);
    tab.addEventListener('click', () => this.choose(name));
    const page = element('div', `page ${name}`, this.root);
    page.id = `page-${name}`;
    page.setAttribute('role', 'tabpanel');
    page.setAttribute('aria-labelledby', tab.id);
    this.tabs.set(name, { tab, page });
    if (this.current === '') this.current = name;
    this.update();
    return page;
  }

  /** The page that is shown, '' where the panel is closed. */
  get shown(): string {
    return this.root.hidden ? '' : this.current;
  }

  choose(name: string): void {
    this.current = name;
    this.update();
    this.changed(this.shown !== '');
  }

  /** Opens the panel on a page; closes it where that page is open already. */
  toggle(name = this.current): void {
    this.root.hidden = this.shown === name;
    this.choose(name);
  }

  close(): void {
    this.root.hidden = true;
    this.changed(false);
  }

  /** Pages that only a running simulation fills. */
  setAvailable(name: string, on: boolean): void {
    const tab = this.tabs.get(name)?.tab;
    if (tab) tab.hidden = !on;
    if (!on && this.current === name) this.choose([...this.tabs.keys()][0] ?? '');
  }

  private update(): void {
    for (const [name, { tab, page }] of this.tabs) {
      const on = name === this.current;
      page.hidden = !on;
      tab.setAttribute('aria-selected', String(on));
    }
  }
}
