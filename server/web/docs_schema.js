// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// JSON schemas for readers.
import { make } from "./dom.js";

const kDeepest = 3;  // open levels; deeper ones are opened by hand

const nameOf = (ref) => ref.split("/").at(-1);
const resolved = (schema, schemas) => (schema?.$ref ? schemas[nameOf(schema.$ref)] : schema) ?? {};

// A few words: "integer 1 to 500, default 50", "list of Image".
export function shortType(schema, schemas) {
  if (schema.$ref) return nameOf(schema.$ref);
  const joined = (list, word) => list.map((one) => shortType(one, schemas)).join(word);
  const choices = schema.anyOf ?? schema.oneOf;
  const { minimum, maximum } = schema;
  const parts = [
    choices ? joined(choices, " or ") : schema.allOf ? joined(schema.allOf, " and ") :
      schema.const !== undefined ? JSON.stringify(schema.const) : schema.enum ? schema.enum.map((one) => JSON.stringify(one)).join(" or ") :
      schema.type === "array" ? `list of ${shortType(schema.items ?? {}, schemas)}` : [schema.type ?? "anything"].flat().join(" or ")];
  if (schema.format) parts.push(`(${schema.format})`);
  if (minimum !== undefined && maximum !== undefined) parts.push(`${minimum} to ${maximum}`);
  else if (minimum !== undefined) parts.push(`at least ${minimum}`);
  else if (maximum !== undefined) parts.push(`up to ${maximum}`);
  return parts.join(" ") + (schema.default === undefined ? "" : `, default ${JSON.stringify(schema.default)}`);
}

export const requiredMark = (isRequired) => (isRequired ? make("span", { class: "needed", text: " required" }) : "");
const quiet = (text) => make("span", { class: "quiet", text });

const propertyList = (properties, required, schemas, depth) => make("ul", { class: "schema" }, ...Object.entries(properties).map(([name, one]) =>
  make("li", {}, make("code", { text: name }), requiredMark(required.includes(name)), " ", quiet(shortType(one, schemas)),
    one.description ? ` – ${one.description}` : "", inner(one, schemas, depth + 1))));

// The contents of a property, if it is more than a value.
function inner(schema, schemas, depth) {
  const target = resolved(schema, schemas);
  const held = target.type === "array" ? target.items ?? {} : schema;
  const object = resolved(held, schemas);
  if (!object.properties && !object.allOf && !object.anyOf && !object.oneOf) return "";
  if (depth < kDeepest && !held.$ref) return schemaView(held, schemas, depth);
  const box = make("details", { class: "inner" }, make("summary", { text: held.$ref ? nameOf(held.$ref) : "properties" }));
  box.addEventListener("toggle", () => {
    if (box.open && box.children.length === 1) box.append(schemaView(object, schemas, 0));
  });
  return box;
}

export function schemaView(schema, schemas, depth = 0) {
  const target = resolved(schema, schemas);
  const parts = target.allOf ?? target.anyOf ?? target.oneOf;
  const view = make("div", { class: "schema-view" }, schema.$ref ? quiet(` ${nameOf(schema.$ref)}`) : "");
  if (target.description && depth === 0) view.append(make("p", { class: "quiet", text: target.description }));
  if (target.properties) view.append(propertyList(target.properties, target.required ?? [], schemas, depth));
  else if (parts) view.append(...parts.map((one) => schemaView(one, schemas, depth + 1)));
  else view.append(quiet(` ${shortType(target, schemas)}`), target.type === "array" ? inner(target, schemas, depth) : "");
  return view;
}
