// Writes src/api/schema.d.ts of docs/openapi.json: the schemas of `components` that travel as JSON, and what each operation takes
// and answers, by its method and path. Says no formats and no examples, which no type can hold.
import { readFileSync, writeFileSync } from "node:fs";
import { fileURLToPath } from "node:url";
import openapiTS, { astToString } from "openapi-typescript";

const HEAD = "// Made by `npm run types` of docs/openapi.json. Do not edit.\n";
const SCHEMA = "#/components/schemas/";

/** The schemas alone, each description on one line. What an answer has by default it always has. */
function schemas({ openapi, info, components }) {
  const dropped = (name, value) => ["default", "example", "format", "contentSchema"].includes(name) && !value?.type;
  const short = (value) => {
    if (Array.isArray(value)) return value.map(short);
    if (value === null || typeof value !== "object") return typeof value === "string" ? value.replace(/\s+/g, " ") : value;
    const kept = Object.fromEntries(Object.entries(value).flatMap(([name, one]) => (dropped(name, one) ? [] : [[name, short(one)]])));
    const has_default = Object.entries(value.properties ?? {}).flatMap(([name, { default: one }]) => (one === undefined ? [] : [name]));
    // A body that is sent refuses other fields.
    return has_default.length && value.additionalProperties !== false ? { ...kept, required: [...(value.required ?? []), ...has_default] } : kept;
  };
  return { openapi, info, paths: {}, components: { schemas: short(components.schemas) } };
}

/** The type of a parameter or a body. */
function typeOf(schema) {
  if (schema === undefined) return "undefined";
  if (schema.$ref) return `Schemas["${schema.$ref.slice(SCHEMA.length)}"]`;
  if (schema.oneOf) return schema.oneOf.map(typeOf).join(" | ");
  if (schema.prefixItems) return `[${schema.prefixItems.map(typeOf).join(", ")}]`;
  if (schema.enum) return schema.enum.map((word) => JSON.stringify(word)).join(" | ");
  const types = { integer: "number", number: "number", string: "string", boolean: "boolean", null: "null" };
  return [schema.type].flat().map((kind) => (kind === "array" ? `(${typeOf(schema.items)})[]` : (types[kind] ?? "unknown"))).join(" | ");
}

const resolved = (document, part) => (part.$ref ? part.$ref.slice(2).split("/").reduce((at, name) => at[name], document) : part);

/** What an operation takes and answers. */
function operation(document, { parameters = [], requestBody, responses }) {
  const query = parameters.map((one) => resolved(document, one)).filter((one) => one.in === "query");
  const body = requestBody?.content["application/json"]?.schema;
  const [done] = Object.entries(responses).filter(([status]) => status.startsWith("2"));
  const answer = resolved(document, done[1]).content?.["application/json"]?.schema;
  const takes = query.map(({ name, schema, required }) => `${name}${required ? "" : "?"}: ${typeOf(schema)}`);
  const parts = [...(takes.length ? [`query: { ${takes.join("; ")} }`] : []), ...(body ? [`body: ${typeOf(body)}`] : []), `answer: ${typeOf(answer)}`];
  return `{ ${parts.join("; ")} }`;
}

/** Names of the schemas that a text refers to, directly or not. */
function reached(document, text, found = new Set()) {
  for (const [, name] of text.matchAll(/(?:#\/components\/schemas\/|Schemas\[")(\w+)"/g)) {
    if (found.has(name)) continue;
    reached(document, JSON.stringify(document.components.schemas[name]), found.add(name));
  }
  return found;
}

const read = () => JSON.parse(readFileSync(new URL("../../docs/openapi.json", import.meta.url), "utf8"));

/** The types of the whole document, as any client has them. */
export const whole = async () => astToString(await openapiTS(read()));

/** The text of the types. */
export async function types() {
  const document = read();
  const lines = Object.entries(document.paths).flatMap(([path, item]) => {
    const below = path.replace("/api/v1", "");
    return Object.entries(item).map(([method, one]) => `  "${method.toUpperCase()} ${below}": ${operation(document, one)};`);
  });
  // Streams have bodies, too.
  const streams = JSON.stringify(Object.values(document.paths).map(({ get }) => get?.responses["200"]?.content?.["text/event-stream"]));
  const used = reached(document, `${lines.join("\n")}${streams}"#/components/schemas/Problem"`);
  const kept = Object.fromEntries(Object.entries(document.components.schemas).filter(([name]) => used.has(name)));
  const made = astToString(await openapiTS(schemas({ ...document, components: { schemas: kept } }), { arrayLength: true, defaultNonNullable: false }));
  // Of a document without paths all else is empty.
  const components = made
    .slice(made.indexOf("export interface components"), made.indexOf("export type $defs"))
    .replace(/    (responses|parameters|requestBodies|headers|pathItems): never;\n/g, "")
    .replace(/ *\/\*\* @enum \{string\} \*\/\n/g, "")
    .replace(/\/\*\*\n\s*\* @description (.*)\n\s*\* @enum \{string\}\n\s*\*\//g, "/** $1 */")
    .replaceAll("/** @description ", "/** ")
    // A field with its words on one line, where both are short.
    .replace(/^( +\/\*\* .* \*\/)\n +(.*;)$/gm, (both, words, field) => (words.length + field.length < 120 ? `${words} ${field}` : both));
  return `${HEAD}${components.trim()}\n\ntype Schemas = components["schemas"];\n\n/** By method and path below /api/v1. */\nexport interface Operations {\n${lines.join("\n")}\n}\n`;
}

if (process.argv[1] === fileURLToPath(import.meta.url)) {
  writeFileSync(new URL("../src/api/schema.d.ts", import.meta.url), await types());
}
