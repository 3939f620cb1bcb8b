import { readdirSync, readFileSync } from 'node:fs';
import { join } from 'node:path';
import { defineConfig, type Plugin } from 'vite';
import { viteSingleFile } from 'vite-plugin-singlefile';

// The page carries the license of every package that is in it, to wherever it is copied: wheels, exported replays.
function licenses(): Plugin {
  return {
    name: 'licenses',
    enforce: 'post',
    generateBundle(_options, bundle) {
      const folders = new Map<string, string>();
      for (const id of this.getModuleIds()) {
        const found = /^(.*node_modules\/((?:@[^/]+\/)?[^/]+))\//.exec(id);
        if (found?.[1] && found[2] && !id.startsWith('\0')) folders.set(found[2], found[1]);
      }
      if (folders.size === 0) this.error('no package was found in the page');
      let text = '\n<!-- The page contains these packages.\n';
      for (const [name, folder] of [...folders].sort()) {
        const file = readdirSync(folder).find((f) => /^licen[cs]e/i.test(f));
        if (!file) this.error(`${name} has no license text in ${folder}`);
        text += `\n${name}\n\n${readFileSync(join(folder, file), 'utf8').replaceAll('--', '- -')}\n`;
      }
      const page = bundle['index.html'];
      if (page?.type !== 'asset') this.error('there is no index.html');
      page.source = `${String(page.source).trimEnd()}${text}-->\n`;
    },
  };
}

// One HTML file: the program embeds it, and a replay is this file with a recording in it.
export default defineConfig({
  plugins: [viteSingleFile({ removeViteModuleLoader: true }), licenses()],
  build: { target: 'es2022', chunkSizeWarningLimit: 2000, reportCompressedSize: false },
});
