// What operations take and answer, by method and path: a misspelt path, name or field does not compile.
import type { Operations } from "./schema";

type Method = "GET" | "POST" | "PUT" | "PATCH" | "DELETE";
type Key = keyof Operations;
/** Paths that take a method, as in the OpenAPI document. */
type PathsOf<M extends Method> = Key extends infer K ? (K extends `${M} ${infer P}` ? P : never) : never;
/** Path of any operation. */
export type OpPath = PathsOf<Method>;
type NamesIn<P> = P extends `${string}{${infer N}}${infer Rest}` ? N | NamesIn<Rest> : never;
/** Values for the names in braces. */
export type Names<P> = Record<NamesIn<P>, string | number>;
type Plain<P> = P extends `${string}{${string}` ? never : P;

/** The path of an operation with its names filled in. */
export type Path<P extends OpPath = OpPath> = string & { readonly operation: P };
/** Where an operation with this method is. */
export type At<M extends Method> = Plain<PathsOf<M>> | Path<PathsOf<M>>;
/** The path of the document for what is asked for. */
export type PathIn<A> = A extends { readonly operation: infer P } ? P : A;

/** What may follow a path of an operation, without further names. */
export type Rest<P extends OpPath> = OpPath extends infer K ? (K extends `${P}/${infer R}` ? Plain<`/${R}`> : never) : never;
/** The path with what follows it. */
export type Below<P extends OpPath, S extends string> = Extract<OpPath, `${P}${S}`>;

type Operation<M extends Method, P> = `${M} ${P & string}` extends infer K ? (K extends Key ? Operations[K] : never) : never;
type Part<O, Name extends string, Otherwise> = O extends { [N in Name]: infer T } ? T : Otherwise;
/** The body of the answer; `undefined` where there is none. */
export type Answer<M extends Method, P> = Part<Operation<M, P>, "answer", never>;
/** The body of the request. */
export type Body<M extends Method, P> = Part<Operation<M, P>, "body", never>;
/** The query; what is not given is left out. */
export type Query<M extends Method, P> = { [N in keyof Part<Operation<M, P>, "query", {}>]?: Part<Operation<M, P>, "query", {}>[N] | null | undefined };
/** An item of the list that is answered. */
export type Item<A> = Answer<"GET", PathIn<A>> extends { items: readonly (infer T)[] } ? T : never;
