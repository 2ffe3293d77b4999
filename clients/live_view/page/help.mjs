// The documents that a user reads as one page without scripts: contents at the left, links between them within the page.
import { readFileSync } from "node:fs";
import { posix } from "node:path";
import { Marked } from "marked";

const escaped = (text) => text.replaceAll("&", "&amp;").replaceAll("<", "&lt;").replaceAll('"', "&quot;");
const slug = (text) => text.toLowerCase().replace(/[^\p{L}\p{N} _-]/gu, "").trim().replaceAll(" ", "-");
const idOf = (document, anchor = "") => `${slug(document.replaceAll("/", "-").replaceAll(".", "-"))}${anchor ? `--${anchor}` : ""}`;

const style = `:root{color-scheme:light dark;--page:#fff;--side:#f3f4f7;--ink:#16191d;--muted:#565e68;--line:#dfe3e8;--accent:#2257c9}
@media(prefers-color-scheme:dark){:root{--page:#101317;--side:#191d23;--ink:#e8ebef;--muted:#9aa4b0;--line:#2b313a;--accent:#86adff}}
*{box-sizing:border-box}html{scroll-padding-top:12px}body{margin:0;background:var(--page);color:var(--ink);font:15px/1.55 system-ui,"DejaVu Sans",sans-serif;display:grid;grid-template-columns:260px minmax(0,1fr)}
nav{position:sticky;top:0;height:100vh;overflow-y:auto;background:var(--side);border-right:1px solid var(--line);padding:16px}nav a{display:block;padding:4px 0;text-decoration:none;color:inherit;overflow-wrap:anywhere}nav .back{color:var(--accent);margin-bottom:10px}
main{padding:8px 32px 64px;max-width:920px;min-width:0}article{border-bottom:1px solid var(--line);padding-bottom:24px}a{color:var(--accent)}
h1{font-size:24px;margin:32px 0 8px}h2{font-size:18px}h3{font-size:16px}pre{background:var(--side);padding:12px;border-radius:8px;overflow-x:auto}code{font:13px/1.5 ui-monospace,"DejaVu Sans Mono",monospace}
table{border-collapse:collapse;display:block;overflow-x:auto}th,td{text-align:left;vertical-align:top;border:1px solid var(--line);padding:5px 9px}p,li{overflow-wrap:anywhere}
@media(max-width:760px){body{display:block}nav{position:static;height:auto}main{padding:8px 14px 48px}}`;

function articleOf(root, document, documents) {
  const text = readFileSync(posix.join(root, document), "utf8");
  if (!document.endsWith(".md")) return { title: posix.basename(document), html: `<h1>${posix.basename(document)}</h1><pre><code>${escaped(text)}</code></pre>` };
  let title = "";
  const marked = new Marked({
    renderer: {
      heading({ tokens, depth, text: words }) {
        if (depth === 1) title ||= words.replaceAll("`", "");
        return `<h${depth} id="${idOf(document, slug(words))}">${this.parser.parseInline(tokens)}</h${depth}>\n`;
      },
      // To another of these documents, or to the web; a file that is not here is its name.
      link({ href, tokens }) {
        const words = this.parser.parseInline(tokens);
        if (/^https?:/.test(href)) return `<a href="${escaped(href)}">${words}</a>`;
        const [file, anchor] = href.split("#");
        const to = file ? posix.normalize(posix.join(posix.dirname(document), file)) : document;
        return documents.includes(to) ? `<a href="#${idOf(to, anchor)}">${words}</a>` : words;
      },
      image: ({ text: words }) => (words ? `<em>${escaped(words)}</em>` : ""),
    },
  });
  const html = marked.parse(text);
  return { title: title || document, html };
}

export function helpOf(root, documents) {
  const articles = documents.map((document) => ({ document, ...articleOf(root, document, documents) }));
  const contents = articles.map(({ document, title }) => `<a href="#${idOf(document)}">${escaped(title)}</a>`).join("\n");
  const body = articles.map(({ document, html }) => `<article id="${idOf(document)}">${html}</article>`).join("\n");
  return `<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1"><title>huetrack: help</title><style>${style}</style></head>
<body><nav aria-label="Documents"><a class="back" href="/">← the live page</a>${contents}</nav><main>${body}</main></body></html>
`;
}
