// A guide as HTML. In: its Markdown. Out: HTML with a place to go to for each heading; links to other guides lead to their
// pages, links to what the server does not serve are plain words, and pictures of the pages are left out.
import { Marked } from "marked";
import { guideOf } from "../../words/help";

/** The place of a heading, as GitHub names it. */
export const slug = (heading: string) =>
  heading
    .toLowerCase()
    .replace(/<[^>]*>|[^\p{Letter}\p{Number}\- _]/gu, "")
    .replaceAll(" ", "-");

const marked = new Marked({
  renderer: {
    heading({ tokens, depth, text }) {
      return `<h${depth} id="${slug(text)}">${this.parser.parseInline(tokens)}</h${depth}>`;
    },
    link({ href, tokens }) {
      const words = this.parser.parseInline(tokens);
      if (/^#/.test(href)) return `<a href="${href}">${words}</a>`;
      const [, name = "", place = ""] = /^(?:\.\.\/)?([\w-]+)\.md(#.*)?$/.exec(href) ?? [];
      return guideOf(name) ? `<a href="/help/${name}${place}">${words}</a>` : words;
    },
    image: () => "",
  },
});

export interface Rendered {
  html: string;
  /** Its sections: words, and the place of each. */
  sections: { title: string; place: string }[];
}

export function rendered(markdown: string): Rendered {
  // Whatever is wider than a phone is scrolled by itself, by the keyboard, too. Code is escaped: these are no words of it.
  const html = (marked.parse(markdown) as string)
    .replaceAll("<pre>", '<pre tabindex="0">')
    .replaceAll("<table>", '<div class="wide" tabindex="0"><table>')
    .replaceAll("</table>", "</table></div>");
  const sections = marked.lexer(markdown).flatMap((token) => (token.type === "heading" && token["depth"] === 2 ? [{ title: plain(token["text"] as string), place: slug(token["text"] as string) }] : []));
  return { html, sections };
}

const plain = (text: string) => text.replaceAll("`", "");
