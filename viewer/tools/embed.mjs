// node embed.mjs PAGE.html OUT.cpp: the page as a C++ byte array.
import { readFileSync, writeFileSync } from 'node:fs';

const [page, out] = process.argv.slice(2);
const bytes = readFileSync(page);
const rows = [];
for (let i = 0; i < bytes.length; i += 256) rows.push(Array.from(bytes.subarray(i, i + 256)).join(','));
writeFileSync(
  out,
  `#include <string_view>
namespace fork1s::app {
namespace {
const unsigned char kPage[] = {
${rows.join(',\n')}};
}
std::string_view ViewerPage();
std::string_view ViewerPage() { return {reinterpret_cast<const char*>(kPage), sizeof kPage}; }
}
`,
);
