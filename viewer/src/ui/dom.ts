// Small helpers for the page's few elements.

export function element<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  className = '',
  parent?: HTMLElement,
): HTMLElementTagNameMap[K] {
  const node = document.createElement(tag);
  if (className) node.className = className;
  parent?.append(node);
  return node;
}

const ICONS: Record<string, string> = {
  pause: '<path d="M5 3v10M11 3v10"/>',
  play: '<path d="M5 3l8 5-8 5z"/>',
  step: '<path d="M4 3l6 5-6 5zM12.5 3v10"/>',
  reset: '<path d="M12.500 3v10M10.500 3L4 8l6.500 5zM3 3v10"/>',
  past: '<path d="M8 4.500v4l2.500 1.500M3.500 5.500a5.200 5.200 0 1 1-.6 4M3 2.500v3.300h3.300"/>',
  home: '<path d="M2.5 6V2.5H6M10 2.5h3.5V6M13.5 10v3.5H10M6 13.5H2.5V10"/>',
  record: '<circle cx="8" cy="8" r="4.5"/>',
  stop: '<rect x="4" y="4" width="8" height="8"/>',
  save: '<path d="M8 2.5v7.5M4.8 7L8 10.2 11.2 7M3 13.3h10"/>',
  theme: '<circle cx="8" cy="8" r="5"/><path d="M8 3v10a5 5 0 0 0 0-10z" fill="currentColor"/>',
  plots: '<path d="M2.5 12.5l3.5-5 3 3 4.5-7"/>',
  panel: '<path d="M2.5 4.5h11M2.5 8h11M2.5 11.5h11M5 3v3M10.5 6.5v3M6.5 10v3"/>',
  tree: '<path d="M2.5 3.5h5M5 6v6.500h3M5 8.200h3M9.500 8.200h4M9.500 12.500h4"/>',
  pick: '<circle cx="8" cy="8" r="4.5"/><path d="M8 1.5v3M8 11.5v3M1.5 8h3M11.5 8h3"/>',
  help: '<path d="M5.6 6a2.4 2.4 0 1 1 3.3 2.3c-.6.3-.9.7-.9 1.5M8 12.4v.1"/>',
};

/** A button with an icon, a name for screen readers and a tooltip that tells its key. */
export function iconButton(icon: string, label: string, parent: HTMLElement, act: () => void): HTMLButtonElement {
  const button = element('button', '', parent);
  button.type = 'button';
  setIcon(button, icon, label);
  button.addEventListener('click', () => {
    act();
    button.blur(); // so that the next space means pause, not this button again
  });
  return button;
}

/** A button with a word. */
export function textButton(text: string, parent: HTMLElement, act: () => void): HTMLButtonElement {
  const button = element('button', 'text', parent);
  button.type = 'button';
  button.textContent = button.title = text;
  button.addEventListener('click', act);
  return button;
}

export function checkbox(label: string, on: boolean, parent: HTMLElement, changed: (on: boolean) => void): HTMLInputElement {
  const outer = element('label', '', parent);
  const box = element('input', '', outer);
  box.type = 'checkbox';
  box.checked = on;
  box.addEventListener('change', () => changed(box.checked));
  outer.append(` ${label}`);
  return box;
}

export function setIcon(button: HTMLButtonElement, icon: string, label: string): void {
  if (button.dataset['icon'] === icon && button.title === label) return;
  button.dataset['icon'] = icon;
  button.innerHTML = `<svg viewBox="0 0 16 16" aria-hidden="true">${ICONS[icon] ?? ''}</svg>`;
  button.title = label;
  button.setAttribute('aria-label', label);
}

/** 12.3 N, 0.0451 m, 1.2 kN: three digits and a unit. */
export function withUnit(value: number, unit: string): string {
  if (!Number.isFinite(value)) return '–';
  const a = Math.abs(value);
  if (a >= 1000 && unit === 'N') return `${(value / 1000).toPrecision(3)} kN`;
  return `${a >= 100 ? value.toFixed(0) : value.toPrecision(3)} ${unit}`;
}

/** The same without zeros at the end: for round numbers. */
export function shortUnit(value: number, unit: string): string {
  return `${Number(value.toPrecision(3))} ${unit}`;
}

/** Hands a text to the browser as a download. */
export function saveFile(name: string, text: string, type = 'text/csv'): void {
  const url = URL.createObjectURL(new Blob([text], { type }));
  const link = element('a');
  link.href = url;
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(url), 1000);
}
