// What the first page shows of all maps, robots and the server: read together, so that attention and checklist agree.
import { all, get, getAnyway, path } from "../../api/client";
import { may } from "../../api/session.svelte";
import type { Landmark, MapBody, Robot, Walls } from "../../api/types";
import { type Health, faultsOf } from "../../words/health";
import { type LandmarkState, STATES, stateOf } from "../../words/states";
import { count } from "../../words/amounts";

/** Maps whose floor is drawn and whose landmarks are counted; more are listed by name. */
export const MOST_DRAWN = 24;
/** Walls of a small drawing: more are left out evenly. */
const MOST_WALLS = 1500;

export interface DrawnMap {
  walls: Walls["segments"];
  has_walls: boolean;
  landmarks: Landmark[];
}

/** What needs somebody, and where one helps. */
export interface Need {
  text: string;
  button: string;
  to: string;
  is_grave: boolean;
}

export interface Overview {
  maps: MapBody[];
  drawn: ReadonlyMap<string, DrawnMap>;
  robots: Robot[];
  needs: Need[];
}

/** What was read of maps, by the version that it is of: a floor is read again only when it has changed. */
const read = new Map<string, { version: string; drawn: DrawnMap }>();

async function drawn({ name: map, version, revision }: MapBody): Promise<[string, DrawnMap]> {
  const present = `${version} ${revision}`;
  const known = read.get(map);
  if (known?.version === present) return [map, known.drawn];
  const [{ segments }, landmarks] = await Promise.all([get(path("/maps/{map}/walls", { map })), all(path("/maps/{map}/landmarks", { map }))]);
  const each = Math.max(1, Math.ceil(segments.length / MOST_WALLS));
  const made = { walls: segments.filter((_, i) => i % each === 0), has_walls: segments.length > 0, landmarks };
  read.set(map, { version: present, drawn: made });
  return [map, made];
}

/** States of landmarks that somebody should look at. */
const LOOK_AT: readonly LandmarkState[] = ["flagged", "quarantined", "inactive", "not-placed"];

function landmarkNeeds(map: string, landmarks: readonly Landmark[]): Need[] {
  return LOOK_AT.flatMap((state) => {
    const number = landmarks.filter((landmark) => stateOf(landmark) === state).length;
    if (!number) return [];
    const text = `${count(number, "landmark")} of ${map}: ${STATES[state].word.toLowerCase()}.`;
    return [{ text, button: state === "not-placed" ? "Place" : "Look", to: `${path`/maps/${map}`}?state=${state}`, is_grave: state === "quarantined" }];
  });
}

function robotNeeds(robots: readonly Robot[]): Need[] {
  return robots.flatMap(({ name, conflict, activity }) => {
    const to = path`/robots/${name}`;
    if (conflict) return [{ text: `Two programs use the name ${name}: one is refused.`, button: "Look", to, is_grave: true }];
    const refused = activity?.inputs.find((input) => input.refused_in_a_row > 1);
    return refused ? [{ text: `The last ${refused.refused_in_a_row.toLocaleString("en")} messages of ${name} were refused.`, button: "See why", to, is_grave: true }] : [];
  });
}

async function serverNeeds(): Promise<Need[]> {
  const { body } = await getAnyway<Health>("/readyz");
  return faultsOf(body).map(({ sentence, is_grave }) => ({ text: sentence, button: "Health", to: "/admin", is_grave }));
}

async function knocking(): Promise<Need[]> {
  if (!may("GET /unknown-robots")) return [];
  const { robots } = await get("/unknown-robots");
  return robots.length ? [{ text: `${count(robots.length, "robot knocks", "robots knock")} and ${robots.length === 1 ? "is" : "are"} not registered.`, button: "Admit", to: "/robots", is_grave: false }] : [];
}

export async function overview(): Promise<Overview> {
  const [maps, robots] = await Promise.all([all("/maps"), all("/robots")]);
  const [server, knocks, pictures] = await Promise.all([
    serverNeeds().catch(() => []),
    knocking().catch(() => []),
    // A map that is deleted meanwhile is left out.
    Promise.allSettled(maps.slice(0, MOST_DRAWN).map(drawn)),
  ]);
  for (const name of read.keys()) if (!maps.some((map) => map.name === name)) read.delete(name);
  const found = pictures.flatMap((picture) => (picture.status === "fulfilled" ? [picture.value] : []));
  const needs = [...server, ...robotNeeds(robots), ...knocks, ...found.flatMap(([map, { landmarks }]) => landmarkNeeds(map, landmarks))];
  return { maps, drawn: new Map(found), robots, needs: needs.sort((a, b) => Number(b.is_grave) - Number(a.is_grave)) };
}
