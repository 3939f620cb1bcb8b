// Every frame of a recording as a PNG, handed to the program that opened this page for it.
import type { App } from '../app';
import type { Colouring } from '../scene/colouring';

// With the token of the page's address, as every request.
async function put(path: string, body: Blob | string): Promise<void> {
  const answer = await fetch(path + location.search, { method: 'PUT', body });
  if (!answer.ok) throw new Error(`${path}: ${answer.status}`);
}

async function shoot(app: App, number: number): Promise<void> {
  app.view.draw();
  const canvas = app.view.stage.renderer.domElement;
  const image = await new Promise<Blob | null>((done) => canvas.toBlob(done, 'image/png'));
  if (!image) throw new Error('no image');
  await put(`/frame/${String(number).padStart(6, '0')}.png`, image);
}

export interface Film {
  width: number;
  height: number;
  /** A single picture, this many seconds after the recording's start; without it every frame. */
  at?: number;
  /** Frames a second of simulated time; without it one a step. */
  fps?: number;
  /** Degrees: where the camera stands about the target, counted from x towards y, and how high. */
  azimuth?: number;
  elevation?: number;
  zoom?: number;
  /** Place of a body that the camera looks at in place of the middle of the whole. */
  body?: number;
  /** 0: no contact forces. */
  forces?: number;
  /** Place in COLOURINGS; without it the file's colours. */
  colouring?: number;
}

/** In the order that the program counts them. */
export const COLOURINGS: readonly Colouring[] = ['file', 'tips', 'roles', 'gaps'];

const KEYS = ['at', 'fps', 'azimuth', 'elevation', 'zoom', 'body', 'forces', 'colouring'] as const;

/** #film=WIDTHxHEIGHT&at=SECONDS&... in the page's address asks for it. */
export function readFilm(hash: string): Film | null {
  const found = /^#film=(\d+)x(\d+)((?:&[a-z]+=-?[\d.]+)*)$/.exec(hash);
  if (!found) return null;
  const out: Film = { width: Number(found[1]), height: Number(found[2]) };
  const given = new URLSearchParams(found[3]);
  for (const key of KEYS) {
    const value = given.get(key);
    if (value !== null && Number.isFinite(Number(value))) out[key] = Number(value);
  }
  return out;
}

export async function film(app: App, wanted: Film): Promise<void> {
  const { stage } = app.view;
  app.view.options.forces = wanted.forces !== 0;
  app.view.options.colouring = COLOURINGS[wanted.colouring ?? 0] ?? 'file';
  app.view.restyle();
  stage.renderer.setAnimationLoop(null);
  const root = document.getElementById('app');
  if (root) Object.assign(root.style, { width: `${wanted.width}px`, height: `${wanted.height}px` });
  await new Promise((done) => setTimeout(done, 200)); // until the page has taken that size
  const picture = wanted.at === undefined ? undefined : (app.timeline?.indexAt(wanted.at) ?? 0);
  // A picture shows one moment, so that its camera need not hold the whole path.
  app.frameRecording(picture);
  app.timeline?.go(picture ?? 0);
  await app.view.bodies.pictures.ready;
  const body = wanted.body === undefined ? undefined : app.view.poses()[wanted.body];
  stage.lookFrom(wanted.azimuth, wanted.elevation, wanted.zoom ?? 1, body?.p);
  if (picture !== undefined) {
    await put('/total', '1');
    await shoot(app, 0);
    await put('/done', '');
    return;
  }
  const { timeline } = app;
  const steps = timeline?.length ?? 0;
  const frames = wanted.fps && timeline ? Math.floor(timeline.duration * wanted.fps + 1e-6) + 1 : steps;
  await put('/total', String(frames));
  for (let i = 0; i < frames; ++i) {
    timeline?.go(wanted.fps ? timeline.indexAt(i / wanted.fps) : i);
    await shoot(app, i);
  }
  await put('/done', '');
}
