// Every frame of a recording as a PNG, handed to the program that opened this page for it.
import type { App } from '../app';

async function put(path: string, body: Blob | string): Promise<void> {
  const answer = await fetch(path, { method: 'PUT', body });
  if (!answer.ok) throw new Error(`${path}: ${answer.status}`);
}

/** #film=WIDTHxHEIGHT in the page's address asks for it. */
export function filmSize(hash: string): [number, number] | null {
  const found = /^#film=(\d+)x(\d+)$/.exec(hash);
  return found ? [Number(found[1]), Number(found[2])] : null;
}

export async function film(app: App, width: number, height: number): Promise<void> {
  const { stage } = app.view;
  stage.renderer.setAnimationLoop(null);
  const root = document.getElementById('app');
  if (root) Object.assign(root.style, { width: `${width}px`, height: `${height}px` });
  await new Promise((done) => setTimeout(done, 200)); // until the page has taken that size
  app.frameRecording();
  const frames = app.timeline?.length ?? 0;
  await put('/total', String(frames));
  for (let i = 0; i < frames; ++i) {
    app.timeline?.go(i);
    app.view.draw();
    const image = await new Promise<Blob | null>((done) => stage.renderer.domElement.toBlob(done, 'image/png'));
    if (!image) throw new Error('no image');
    await put(`/frame/${String(i).padStart(6, '0')}.png`, image);
  }
  await put('/done', '');
}
