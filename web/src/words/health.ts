// What is wrong with the server: one sentence and one advice for each fault.
import type { Problem, Readiness, Servers, StorageHealth } from "../api/types";
import { bytes, count } from "./amounts";

export interface Fault {
  sentence: string;
  advice: string;
  /** Robots are not served, or not all of them. */
  is_grave: boolean;
}

/** What `/readyz` has answered: how the server is, or that it cannot do its work. */
export type Health = Readiness | Problem;

export const isProblem = (health: Health): health is Problem => "code" in health;

const sentence = (text: string) => {
  const begun = text.charAt(0).toUpperCase() + text.slice(1);
  return /[.!?]$/.test(begun) ? begun : `${begun}.`;
};

/** What to do when a part of the server does not work. */
const PARTS: Record<string, string> = {
  storage_failed: "Look at the disk of the data directory, then start the server again.",
  part_ended: "Start the server again. Its log says why the part has ended.",
  part_stalled: "Wait a few seconds: the machine or its disk may be overloaded. If it stays, start the server again.",
  busy: "Wait a moment, then look again.",
};

/** Why nothing is added to a disk, as its own fault. */
function diskFault({ refused, total_bytes }: StorageHealth): Fault[] {
  if (!refused) return [];
  // The server says both in one text: first what is so, then what to do.
  const at = refused.search(/ (?=(Delete|Mount|Enlarge) )/);
  const [what, todo] = at > 0 ? [refused.slice(0, at), refused.slice(at + 1)] : [refused, ""];
  const usual = total_bytes ? "Delete backups, maps or gatherings that nobody needs, or enlarge the disk." : "Make room on the disk, or mount it writable.";
  return [{ sentence: sentence(what), advice: sentence(todo || usual), is_grave: false }];
}

/** Every fault, the gravest first. */
export function faultsOf(health: Health, servers?: Servers): Fault[] {
  if (isProblem(health)) {
    return [{ sentence: sentence(health.detail), advice: PARTS[health.code] ?? "Look at the log of the server.", is_grave: true }];
  }
  const { storage, backup, counts, database_check: check } = health;
  const damaged = counts?.damaged_pictures ?? 0;
  const panics = Object.entries(health.panics).filter(([, number]) => number > 0);
  const all: (Fault | false | undefined)[] = [
    health.router != null && health.router !== "" && {
      sentence: sentence(`This server has no part in its router: ${health.router}`),
      advice: "Look whether the router runs, and whether its address in the settings is right.",
      is_grave: true,
    },
    ...Object.entries(health.maps_not_served ?? {}).map(([map, why]) => ({
      sentence: `Robots are refused on the map ${map}.`,
      advice: sentence(why.startsWith("also on") ? `It is ${why}` : why),
      is_grave: true,
    })),
    ...Object.entries(health.maps_not_in_use).map(([map, why]) => ({
      sentence: sentence(`The last change of the map ${map} is not in use: ${why}`),
      advice: "Robots have the version before it. Any further change of the map tries again; its history takes the change back.",
      is_grave: true,
    })),
    ...Object.entries(servers?.contested_robots ?? {}).map(([robot, on]) => ({
      sentence: `The robot ${robot} is registered with several servers: ${on.join(", ")}.`,
      advice: "Remove it from all but one, or let its program say on which map it is.",
      is_grave: false,
    })),
    ...(storage ? diskFault(storage) : []),
    backup?.failed != null && {
      sentence: sentence(`The last backup has failed: ${backup.failed}`),
      advice: "Make room on the disk, then back up now, under Backups.",
      is_grave: false,
    },
    check?.state === "failed" && {
      sentence: sentence(`The database is damaged${check.faults?.length ? `: ${check.faults.join("; ")}` : ""}`),
      advice: sentence(check.advice ?? "Stop the server and restore a backup"),
      is_grave: false,
    },
    damaged > 0 && {
      sentence: `${count(damaged, "stored picture is", "stored pictures are")} damaged and not used: ${health.damaged_pictures?.join(", ") || "of maps that you do not see"}.`,
      advice: "Upload the same photographs again, or delete them; then check the disk.",
      is_grave: false,
    },
    panics.length > 0 && {
      sentence: `The program has caught faults of its own: ${panics.map(([where, number]) => `${where} ${number}`).join(", ")}.`,
      advice: "Everything else went on. Send the log of the server to those who maintain it.",
      is_grave: false,
    },
  ];
  return all.filter((fault): fault is Fault => Boolean(fault));
}

/** How the server is, in a word. */
export function healthState(health: Health): { word: string; kind: "good" | "warn" | "bad"; meaning: string } {
  if (isProblem(health)) return { word: "Not ready", kind: "bad", meaning: "A part of the server does not work. It ends, or has to be started again." };
  if (health.status === "ready") return { word: "Ready", kind: "good", meaning: "Everything runs." };
  return { word: "Degraded", kind: "warn", meaning: "Everything runs, but something needs a person." };
}

/** How full the disk is, and from when on learning is refused. */
export function diskText({ total_bytes, free_bytes, reusable_bytes, used_percent, limit_percent, refused }: StorageHealth): string {
  if (!total_bytes) return "Its size is not known.";
  const reusable = reusable_bytes > 1e6 ? `; ${bytes(reusable_bytes)} of the database can be used again` : "";
  const rule = refused ? "Learning and uploads are refused." : `From ${limit_percent} % on, learning and uploads are refused; robots are served all the same.`;
  return `${used_percent} % of ${bytes(total_bytes)} used, ${bytes(free_bytes)} free${reusable}. ${rule}`;
}
