// Keys of the page. Names as in KeyboardEvent.key, letters small.

export function bindKeys(acts: Record<string, () => void>): void {
  window.addEventListener('keydown', (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const target = event.target;
    // In a slider or list the arrows are its own.
    if (target instanceof HTMLSelectElement || target instanceof HTMLTextAreaElement) return;
    if (target instanceof HTMLInputElement && (target.type !== 'checkbox' || event.key === ' ')) return;
    if ((event.key === ' ') && target instanceof HTMLButtonElement) return;
    const act = acts[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!act) return;
    act();
    event.preventDefault();
  });
}
