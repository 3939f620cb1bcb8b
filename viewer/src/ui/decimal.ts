// Fields for numbers that take a point or a comma, as keyboards of many countries write it.
import { element } from './dom';

/** NaN where it is no number. */
export function parseDecimal(text: string): number {
  const plain = text.trim().replace(/\s/g, '').replace(',', '.');
  return plain !== '' && /^[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?$/i.test(plain) ? Number(plain) : NaN;
}

export const formatDecimal = (value: number | null): string => (value === null || !Number.isFinite(value) ? '' : String(Number(value.toPrecision(6))));

/** Arrows change by 5 %, with shift by 0.5 %; `changed` is called with finite numbers only. */
export function decimalField(label: string, parent: HTMLElement, changed: (value: number) => void): HTMLInputElement {
  const field = element('input', 'decimal', parent);
  field.type = 'text';
  field.inputMode = 'decimal';
  field.autocomplete = 'off';
  field.setAttribute('aria-label', label);
  const take = (): void => {
    const value = parseDecimal(field.value);
    field.setAttribute('aria-invalid', String(!Number.isFinite(value) && field.value !== ''));
    if (Number.isFinite(value)) changed(value);
  };
  field.addEventListener('change', take);
  field.addEventListener('keydown', (event) => {
    const way = event.key === 'ArrowUp' ? 1 : event.key === 'ArrowDown' ? -1 : 0;
    const value = parseDecimal(field.value);
    if (way === 0 || !Number.isFinite(value)) return;
    const step = (event.shiftKey ? 0.005 : 0.05) * (value === 0 ? 1 : Math.abs(value));
    field.value = formatDecimal(value + way * step);
    take();
    event.preventDefault();
  });
  return field;
}
