// Requests to the server. In: a path below /api/v1. Out: the body of its operation, or an ApiError whose text a person can
// act on.
import { heard, missed } from "./connection.svelte";
import type { Answer, At, Below, Body, Item, Names, OpPath, Path, PathIn, Query, Rest } from "./operations";

const ROOT = "/api/v1";
/** Time until a request is given up, ms. Lessons and backups run as jobs, so no request takes long. */
const DEADLINE_MS = 30_000;

/** What the server, or the way to it, has refused. */
export class ApiError extends Error {
  constructor(
    message: string,
    /** HTTP status; 0 if no answer came. */
    readonly status: number,
    /** The stable word of the refusal. */
    readonly code: string,
    /** The field at fault, by its name on the wire. */
    readonly field: string | null,
  ) {
    super(message);
  }
}

/** A body with its revision. */
export interface Revised<T> {
  body: T;
  revision: string;
}

/** A query of any operation. */
export type AnyQuery = Record<string, string | number | boolean | readonly string[] | null | undefined>;

export interface Options<B = unknown, Q = AnyQuery> {
  query?: Q | undefined;
  body?: B;
  form?: FormData;
  /** A file as it is, with the time that it may take, ms. */
  file?: { content: Blob; kind: string; deadline_ms: number };
  /** The revision that a change is meant for. */
  ifMatch?: string;
  /** Why something is changed, for the history of the map. */
  why?: string;
  /** Makes a creation once, however often it is sent. */
  key?: string;
  /** A status of a refusal that is an answer here. */
  alsoTakes?: number;
  signal?: AbortSignal;
}

type Method = "GET" | "POST" | "PUT" | "PATCH" | "DELETE";

let onSignedOut = () => {};

/** Calls `then` when the server answers that nobody is signed in. */
export function whenSignedOut(then: () => void): void {
  onSignedOut = then;
}

/** The address of a read: for pictures and downloads. */
export function address(path: string, query: AnyQuery = {}): string {
  const pairs = Object.entries(query).filter(([, value]) => value !== undefined && value !== null && value !== "");
  const text = new URLSearchParams(pairs.map(([name, value]) => [name, String(value)])).toString();
  return ROOT + path + (text ? `?${text}` : "");
}

/** The path of an operation with its names, which are escaped: path("/maps/{map}", { map }). Or any other: path`/maps/${map}`. */
export function path<P extends OpPath>(of: P, names: Names<P>): Path<P>;
export function path(parts: TemplateStringsArray, ...names: (string | number)[]): string;
export function path(of: string | TemplateStringsArray, ...names: unknown[]): string {
  const escaped = (name: unknown) => encodeURIComponent(String(name));
  if (typeof of !== "string") return of.reduce((made, part, i) => made + escaped(names[i - 1]) + part);
  const [given] = names as [Record<string, unknown>];
  return of.replace(/\{(\w+)\}/g, (_, name: string) => escaped(given[name]));
}

/** A path below another one: below(at, "/icon"). */
export const below = <P extends OpPath, S extends Rest<P>>(at: Path<P>, rest: S) => `${at}${rest}` as Path<Below<P, S>>;

function request(method: Method, options: Options): RequestInit {
  const headers = new Headers({ accept: "application/json" });
  // Pages of other sites cannot send this header, so a change with it comes from these pages.
  if (method !== "GET") headers.set("x-waymark-page", "1");
  if (options.ifMatch !== undefined) headers.set("if-match", options.ifMatch === "*" ? "*" : `"${options.ifMatch}"`);
  if (options.why) headers.set("waymark-why", encodeURIComponent(options.why));
  if (options.key) headers.set("idempotency-key", options.key);
  if (options.body !== undefined) headers.set("content-type", "application/json");
  if (options.file) headers.set("content-type", options.file.kind);
  const deadline = AbortSignal.timeout(options.file?.deadline_ms ?? DEADLINE_MS);
  const signal = options.signal ? AbortSignal.any([options.signal, deadline]) : deadline;
  const json = options.body === undefined ? null : JSON.stringify(options.body);
  return { method, headers, signal, body: options.file?.content ?? options.form ?? json };
}

async function send(method: Method, at: string, options: Options): Promise<Response> {
  let answer: Response;
  try {
    answer = await fetch(address(at, options.query), request(method, options));
  } catch (cause) {
    // Given up by the page; a deadline of the page's own is none of that.
    if (options.signal?.aborted && (options.signal.reason as DOMException | undefined)?.name !== "TimeoutError") throw cause;
    const late = cause instanceof DOMException && cause.name === "TimeoutError";
    missed();
    const text = late ? `The server has not answered within ${(options.file?.deadline_ms ?? DEADLINE_MS) / 1000} s.` : "The server cannot be reached. Does it run? Is the network up?";
    throw new ApiError(text, 0, "unreachable", null);
  }
  // A proxy before the server answers so while the server is away.
  if (answer.status === 502 || answer.status === 504) missed();
  else heard();
  if (answer.ok || answer.status === options.alsoTakes) return answer;
  if (answer.status === 401) onSignedOut();
  throw await refusal(answer);
}

async function refusal(answer: Response): Promise<ApiError> {
  const problem = await answer.json().catch(() => ({}));
  const { detail, code, field } = problem as { detail?: string; code?: string; field?: string };
  const text = words(answer.status, detail) ?? detail ?? `The server answers ${answer.status} ${answer.statusText}.`;
  return new ApiError(sentence(text), answer.status, code ?? "unknown", field ?? null);
}

/** What a person is told instead of the server's words. */
function words(status: number, detail: string | undefined): string | undefined {
  if (status === 412) return "Somebody has changed it meanwhile.";
  const bytes = status === 413 ? /\d{5,}/.exec(detail ?? "")?.[0] : undefined;
  return bytes && `The file is larger than ${Math.floor(Number(bytes) / 2 ** 20)} MB, the most that the server takes.`;
}

function sentence(text: string): string {
  const begun = text.charAt(0).toUpperCase() + text.slice(1);
  return /[.!?]$/.test(begun) ? begun : `${begun}.`;
}

/** The revision of an answer, without quotes. */
const revisionOf = (answer: Response) => (answer.headers.get("etag") ?? "").replace(/^"|"$/g, "");

/** Reads what an operation answers. */
export async function get<A extends At<"GET">>(at: A, query?: Query<"GET", PathIn<A>>, signal?: AbortSignal): Promise<Answer<"GET", PathIn<A>>> {
  const answer = await send("GET", at, { query: query as AnyQuery, ...(signal && { signal }) });
  return (await answer.json()) as Answer<"GET", PathIn<A>>;
}

/** Reads a body whose status is a part of what it says. An error is one only where no JSON came. */
export async function getAnyway<T>(at: At<"GET">): Promise<{ status: number; body: T }> {
  const answer = await send("GET", at, { alsoTakes: 503 });
  const body = (await answer.json().catch(() => undefined)) as T | undefined;
  if (body === undefined) throw await refusal(answer);
  return { status: answer.status, body };
}

/** Reads a body with its revision. */
export async function getRevised<A extends At<"GET">>(at: A): Promise<Revised<Answer<"GET", PathIn<A>>>> {
  const answer = await send("GET", at, {});
  return { revision: revisionOf(answer), body: (await answer.json()) as Answer<"GET", PathIn<A>> };
}

/** Changes something. `undefined` for an answer without a body. */
export async function change<M extends Exclude<Method, "GET">, A extends At<M>>(
  method: M,
  at: A,
  options: Options<Body<M, PathIn<A>>, Query<M, PathIn<A>>> = {},
): Promise<Answer<M, PathIn<A>>> {
  const answer = await send(method, at, options as Options);
  return (answer.status === 204 ? undefined : await answer.json()) as Answer<M, PathIn<A>>;
}

/** A key for one creation. */
export const newKey = () => crypto.randomUUID?.() ?? Array.from(crypto.getRandomValues(new Uint8Array(16)), (byte) => byte.toString(16).padStart(2, "0")).join("");

/** A page of a list. */
export interface Page<T> {
  items: T[];
  /** Where the next page begins; absent on the last one. */
  next?: string | null;
  total?: number | null;
}

/** Reads a page of any list. */
export async function getPage<A extends At<"GET">>(at: A, query: AnyQuery): Promise<Page<Item<A>>> {
  return (await (await send("GET", at, { query })).json()) as Page<Item<A>>;
}

/** All items of a list, page by page, at most `max`. */
export async function all<A extends At<"GET">>(at: A, query?: Query<"GET", PathIn<A>>, max = 5000): Promise<Item<A>[]> {
  const items: Item<A>[] = [];
  let cursor: string | null | undefined;
  do {
    const page: Page<Item<A>> = await getPage(at, { limit: 500, ...query, cursor });
    items.push(...page.items);
    cursor = page.next;
  } while (cursor && items.length < max);
  return items;
}
