// What has happened on the server, in words.
import type { ServerEvent } from "../api/types";
import { path } from "../api/client";
import { count } from "./amounts";
import { JOBS } from "./states";

export interface EventWords {
  text: string;
  /** Where one sees more of it. */
  link?: string;
}

const GATHERINGS: Record<string, string> = { begun: "has begun", ended: "has ended", decided: "was decided about", deleted: "was thrown away" };
const BACKUPS: Record<string, string> = { running: "is being made", complete: "is complete", failed: "has failed" };

/** Kinds that one can choose, in the order in which they are offered. */
export const EVENT_KINDS: Record<string, string> = {
  map_changed: "Maps",
  landmark_changed: "Landmarks",
  job: "Jobs",
  presence: "Robots",
  gathering: "Collecting while driving",
  backup: "Backups",
  tokens_changed: "Tokens",
};

/** The kind under which an event is offered; `undefined` for those about the stream itself. */
export const kindOf = ({ kind }: ServerEvent): string | undefined => (kind === "landmarks_changed" ? "landmark_changed" : kind in EVENT_KINDS ? kind : undefined);

export function eventWords(event: ServerEvent): EventWords {
  switch (event.kind) {
    case "map_changed":
      return event.version == null ? { text: `The map ${event.map} is deleted.` } : { text: `The map ${event.map} has version ${event.version} now.`, link: path`/maps/${event.map}/history` };
    case "landmark_changed":
      return { text: `The landmark ${event.landmark} of ${event.map} was ${event.change}.`, ...(event.change !== "removed" && { link: path`/maps/${event.map}/landmarks/${event.landmark}` }) };
    case "landmarks_changed":
      return { text: `${count(event.count, "landmark")} of ${event.map} changed at once.`, link: path`/maps/${event.map}/landmarks` };
    case "job":
      return { text: `Job ${event.job} of ${event.map}: ${JOBS[event.state] ?? event.state}.`, link: "/admin?part=jobs" };
    case "presence":
      return {
        text: `The robot ${event.robot} ${event.present ? "has come" : "is gone"}${event.map ? `, on ${event.map}` : ". It is not registered"}.`,
        link: event.map ? path`/robots/${event.robot}` : "/robots",
      };
    case "gathering":
      return { text: `Collection ${event.gathering} of ${event.map} ${GATHERINGS[event.change] ?? event.change}.`, link: path`/maps/${event.map}/gather` };
    case "backup":
      return { text: `The backup ${event.backup} ${BACKUPS[event.state] ?? event.state}.`, link: "/admin?part=backups" };
    case "tokens_changed":
      return { text: "A token was made or revoked.", link: "/admin?part=tokens" };
    case "reset":
      return { text: "Events before this one are missing: the server was started again, or more happened than it remembers." };
    case "ready":
      return { text: "From here on nothing is missed." };
  }
}
