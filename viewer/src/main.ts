import './ui/style.css';
import './ui/workbench.css';
import './ui/phone.css';
import { App } from './app';
import { film, readFilm } from './replay/film';
import { fromBase64, RECORDING_ID, unpack } from './replay/log';
import { Notices } from './ui/notices';

declare global {
  // For tests and for the curious: the page's own objects.
  var fork1s: App | undefined;
}

const root = document.getElementById('app');
if (root) {
  try {
    const recording = document.getElementById(RECORDING_ID)?.textContent;
    // What is exported looks as its file says; whoever experiments wants to see what may touch.
    const app = new App(root, recording ? 'file' : 'tips');
    globalThis.fork1s = app;
    if (recording) {
      app.play(unpack(fromBase64(recording)));
      const wanted = readFilm(location.hash);
      if (wanted) void film(app, wanted);
    } else app.connect(`ws://${location.host}/stream${location.search}`);
  } catch (error) {
    new Notices(root).coverWith('The page cannot draw', error instanceof Error ? error.message : String(error));
  }
}
