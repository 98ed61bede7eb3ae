// A route through a site: two clicks on one of its maps say from where to where.
import { get, path } from "../api/client";
import type { SiteTopology } from "../api/types";
import type { Point } from "./geometry";

export class SiteRoute {
  found = $state.raw<SiteTopology>();
  /** Where the route begins, as the server reads it. */
  from = $state<string>();

  constructor(
    private readonly map: string,
    private readonly site: string,
  ) {}

  async start(): Promise<void> {
    this.found = await get(path("/sites/{site}/topology", { site: this.site }));
  }

  /** The first click is where the route begins, the next one where it ends; then anew. */
  async click([x, y]: Point): Promise<void> {
    const at = `${this.map}/${x.toFixed(3)},${y.toFixed(3)}`;
    const from = this.from;
    this.from = from === undefined ? at : undefined;
    if (from !== undefined) this.found = await get(path("/sites/{site}/topology", { site: this.site }), { from, to: at });
  }
}
