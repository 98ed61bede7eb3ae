// The address of the page and what it shows. The view (filters, place on the map) lives in the query, so that an address
// can be sent to somebody else.
import { type Component, tick } from "svelte";
import type { Operation } from "./api/session.svelte";

/** Names in an address, such as `map`. */
export type Names = Record<string, string>;

// eslint-disable-next-line -- pages take the names of their address
type Page = () => Promise<{ default: Component<any> }>;

interface Route {
  /** As it is written below, such as `/maps/:map`. */
  address: string;
  pattern: RegExp;
  page: Page;
  /** What the page is for; whoever may not do it is told so. */
  needs?: Operation | undefined;
}

function route(address: string, page: Page, needs?: Operation): Route {
  const text = address.replace(/:(\w+)/g, "(?<$1>[^/]+)");
  return { address, pattern: new RegExp(`^${text}/?$`), page, needs };
}

const ROUTES: Route[] = [
  route("/", () => import("./pages/maps/Maps.svelte")),
  route("/maps/:map", () => import("./pages/maps/OneMap.svelte")),
  route("/maps/:map/landmarks", () => import("./pages/landmarks/Landmarks.svelte")),
  route("/maps/:map/landmarks/:landmark", () => import("./pages/landmarks/OneLandmark.svelte")),
  route("/maps/:map/landmarks/:landmark/sheet", () => import("./pages/sheets/LandmarkSheet.svelte")),
  route("/maps/:map/sheet", () => import("./pages/sheets/FloorSheet.svelte")),
  route("/maps/:map/settings", () => import("./pages/settings/MapSettings.svelte")),
  route("/maps/:map/teach", () => import("./pages/teach/Teach.svelte"), "POST /maps/{map}/landmarks/{landmark}/views"),
  route("/maps/:map/gather", () => import("./pages/gather/Gather.svelte"), "POST /maps/{map}/gatherings"),
  route("/maps/:map/history", () => import("./pages/history/History.svelte")),
  route("/maps/:map/drafts/:draft", () => import("./pages/history/OneDraft.svelte")),
  route("/robots", () => import("./pages/robots/Robots.svelte")),
  route("/robots/:robot", () => import("./pages/robots/OneRobot.svelte")),
  route("/answers", () => import("./pages/answers/Answers.svelte")),
  route("/answers/:answer", () => import("./pages/answers/OneAnswer.svelte")),
  route("/admin", () => import("./pages/admin/Admin.svelte"), "GET /jobs"),
  route("/help", () => import("./pages/help/Guides.svelte")),
  route("/help/:guide", () => import("./pages/help/OneGuide.svelte")),
];

export const here = $state({ path: location.pathname, query: new URLSearchParams(location.search) });

/** The page of an address and the names in it; `undefined` if there is none. */
export function find(path: string): { address: string; page: Page; names: Names; needs: Operation | undefined } | undefined {
  for (const { address, pattern, page, needs } of ROUTES) {
    const found = pattern.exec(path);
    if (!found) continue;
    try {
      const pairs = Object.entries(found.groups ?? {}).map(([name, value]) => [name, decodeURIComponent(value)]);
      return { address, page, names: Object.fromEntries(pairs), needs };
    } catch {
      // A name that is badly escaped is none.
      return undefined;
    }
  }
  return undefined;
}

function read(): void {
  here.path = location.pathname;
  here.query = new URLSearchParams(location.search);
}

/** How long a page that one comes back to may take until it is as long as it was, ms. */
const LONG_AGAIN_MS = 5000;

/** Notes how far this page is scrolled, for whoever comes back. */
function noteScroll(): void {
  history.replaceState({ scroll_px: scrollY }, "");
}

/** Scrolls to where the page was left, as soon as it is long enough. */
async function scrollBack(scroll_px: number): Promise<void> {
  const until = performance.now() + LONG_AGAIN_MS;
  const path = here.path;
  await tick();
  while (performance.now() < until && here.path === path) {
    scrollTo(0, scroll_px);
    if (Math.abs(scrollY - scroll_px) < 2) return;
    await new Promise((then) => setTimeout(then, 50));
  }
}

/** Goes to another address of these pages. */
export function go(to: string): void {
  noteScroll();
  history.pushState(null, "", to);
  read();
  scrollTo(0, 0);
}

/** Puts a part of the view into the address, without a step back for it. */
export function remember(values: Record<string, string | undefined>): void {
  const query = new URLSearchParams(location.search);
  for (const [name, value] of Object.entries(values)) {
    if (value) query.set(name, value);
    else query.delete(name);
  }
  const text = query.toString();
  history.replaceState(history.state, "", location.pathname + (text ? `?${text}` : ""));
  read();
}

/** Follows links between these pages without loading everything again. */
export function followLinks(): void {
  history.scrollRestoration = "manual";
  let left: ReturnType<typeof setTimeout> | undefined;
  addEventListener("scroll", () => {
    clearTimeout(left);
    left = setTimeout(noteScroll, 150);
  });
  addEventListener("popstate", ({ state }) => {
    clearTimeout(left);
    read();
    // A place within the page, which the browser shows by itself.
    if (state === null && location.hash) return;
    void scrollBack((state as { scroll_px?: number } | null)?.scroll_px ?? 0);
  });
  document.addEventListener("click", (event) => {
    const link = event.target instanceof Element ? event.target.closest("a") : null;
    if (!link || event.defaultPrevented || event.button !== 0) return;
    if (event.metaKey || event.ctrlKey || event.shiftKey || link.target || link.hasAttribute("download")) return;
    const to = new URL(link.href);
    if (to.origin !== location.origin || !find(to.pathname)) return;
    if (to.hash && to.pathname === location.pathname) return;
    event.preventDefault();
    go(to.pathname + to.search + to.hash);
  });
}
