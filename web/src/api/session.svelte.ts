// Who is signed in, and what that one may do.
import { ApiError, get, whenSignedOut } from "./client";
import { watch, whenBack } from "./connection.svelte";
import rights from "./rights.json";
import type { Role, Whoami } from "./types";

const ROLES: readonly Role[] = ["viewer", "robot", "teacher", "operator", "admin"];

export type SessionState = "asking" | "signed-out" | "signed-in" | "unreachable";

export const session = $state({ state: "asking" as SessionState, who: null as Whoami | null, trouble: "" });

/** An operation of the authorisation table, such as "PATCH /maps/{map}". */
export type Operation = keyof typeof rights;

/** Whether the server would do this for the one who is signed in, so that no button is shown that may not be pressed. */
export function may(operation: Operation): boolean {
  if (!session.who) return false;
  const { role, scope } = rights[operation];
  if (role === "none") return true;
  if (scope === "server" && session.who.maps) return false;
  return ROLES.indexOf(session.who.role) >= ROLES.indexOf(role as Role);
}

/** Asks who is signed in. While the server does not answer, whoever was signed in stays so. */
export async function ask(signal?: AbortSignal): Promise<void> {
  try {
    const who = await get("/whoami", undefined, signal);
    // The same one leaves the pages as they are.
    if (JSON.stringify(who) !== JSON.stringify(session.who)) session.who = who;
    session.state = "signed-in";
  } catch (error) {
    session.trouble = error instanceof Error ? error.message : String(error);
    if (error instanceof ApiError && error.status === 401) [session.who, session.state] = [null, "signed-out"];
    else if (session.state === "asking") session.state = "unreachable";
  }
}

/** Signs in with a token. Returns what is wrong with it, or nothing. */
export async function signIn(token: string): Promise<string | undefined> {
  const headers = { "content-type": "application/json", "x-waymark-page": "1" };
  const answer = await fetch("/login", { method: "POST", headers, body: JSON.stringify({ token: token.trim() }) });
  if (answer.ok) {
    await ask();
    return undefined;
  }
  if (answer.status === 401) return "This token is not valid here. Was it revoked, or has it expired?";
  const problem = (await answer.json().catch(() => ({}))) as { detail?: string };
  return problem.detail ?? `The server answers ${answer.status}.`;
}

export async function signOut(): Promise<void> {
  await fetch("/logout", { method: "POST", headers: { "x-waymark-page": "1" } });
  session.who = null;
  session.state = "signed-out";
}

watch(ask);
whenBack(() => session.state === "unreachable" && void ask());

whenSignedOut(() => {
  session.who = null;
  session.state = "signed-out";
});
