// Keys of the page. Names as in KeyboardEvent.key, letters small.

const WITHOUT_TEXT = ['checkbox', 'range', 'radio', 'button'];

/** Whether keys that are typed here are text. */
export function isTextField(target: EventTarget | null): target is HTMLInputElement | HTMLTextAreaElement {
  return target instanceof HTMLTextAreaElement || (target instanceof HTMLInputElement && !WITHOUT_TEXT.includes(target.type));
}

/** The acts are called wherever the focus is but in a text field, which passes on Escape alone. */
export function bindKeys(acts: Record<string, () => void>): void {
  const actOf = (event: KeyboardEvent): (() => void) | undefined => {
    if (event.ctrlKey || event.metaKey || event.altKey) return undefined;
    if (isTextField(event.target) && event.key !== 'Escape') return undefined;
    return acts[event.key.length === 1 ? event.key.toLowerCase() : event.key];
  };
  window.addEventListener('keydown', (event) => {
    // Space is the page's own: Enter is for checkboxes what it is for buttons.
    if (event.key === 'Enter' && event.target instanceof HTMLInputElement && event.target.type === 'checkbox') event.target.click();
    const act = actOf(event);
    if (!act) return;
    act();
    event.preventDefault();
  });
  // Firefox clicks the button that has the focus when the key comes up.
  window.addEventListener('keyup', (event) => {
    if (event.key === ' ' && actOf(event)) event.preventDefault();
  });
}
