// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// JSON schemas for readers.
import { make } from "./dom.js";

const kDeepest = 3;  // levels that stand open at once; deeper ones are opened by hand

const nameOf = (ref) => ref.split("/").at(-1);
const resolved = (schema, schemas) => (schema?.$ref ? schemas[nameOf(schema.$ref)] : schema) ?? {};

// A few words: "integer 1 to 500, 50 unless told", "list of Image".
export function shortType(schema, schemas) {
  if (schema.$ref) return nameOf(schema.$ref);
  const parts = [];
  const choices = schema.anyOf ?? schema.oneOf;
  if (choices) parts.push(choices.map((one) => shortType(one, schemas)).join(" or "));
  else if (schema.allOf) parts.push(schema.allOf.map((one) => shortType(one, schemas)).join(" and "));
  else if (schema.const !== undefined) parts.push(JSON.stringify(schema.const));
  else if (schema.enum) parts.push(schema.enum.map((one) => JSON.stringify(one)).join(" or "));
  else if (schema.type === "array") parts.push(`list of ${shortType(schema.items ?? {}, schemas)}`);
  else if (Array.isArray(schema.type)) parts.push(schema.type.join(" or "));
  else parts.push(schema.type ?? "anything");
  if (schema.format) parts.push(`(${schema.format})`);
  if (schema.minimum !== undefined && schema.maximum !== undefined) parts.push(`${schema.minimum} to ${schema.maximum}`);
  else if (schema.minimum !== undefined) parts.push(`${schema.minimum} or more`);
  else if (schema.maximum !== undefined) parts.push(`up to ${schema.maximum}`);
  const text = parts.join(" ");
  return schema.default === undefined ? text : `${text}; ${JSON.stringify(schema.default)} unless told`;
}

function propertyList(properties, required, schemas, depth) {
  return make("ul", { class: "schema" }, ...Object.entries(properties).map(([name, one]) => make("li", {},
    make("code", { text: name }), required.includes(name) ? make("span", { class: "needed", text: " needed" }) : "", " ",
    make("span", { class: "quiet", text: shortType(one, schemas) }),
    one.description ? ` – ${one.description}` : "", inner(one, schemas, depth + 1))));
}

// What a property holds, where it is more than a value.
function inner(schema, schemas, depth) {
  const target = resolved(schema, schemas);
  const held = target.type === "array" ? target.items ?? {} : schema;
  const object = resolved(held, schemas);
  if (!object.properties && !object.allOf && !object.anyOf && !object.oneOf) return "";
  if (depth < kDeepest && !held.$ref) return schemaView(held, schemas, depth);
  const box = make("details", { class: "inner" }, make("summary", { text: held.$ref ? nameOf(held.$ref) : "its keys" }));
  box.addEventListener("toggle", () => {
    if (box.open && box.children.length === 1) box.append(schemaView(object, schemas, 0));
  });
  return box;
}

export function schemaView(schema, schemas, depth = 0) {
  const target = resolved(schema, schemas);
  const name = schema.$ref ? make("span", { class: "quiet", text: ` ${nameOf(schema.$ref)}` }) : "";
  const parts = target.allOf ?? target.anyOf ?? target.oneOf;
  const view = make("div", { class: "schema-view" }, name);
  if (target.description && depth === 0) view.append(make("p", { class: "quiet", text: target.description }));
  if (target.properties) view.append(propertyList(target.properties, target.required ?? [], schemas, depth));
  else if (parts) for (const one of parts) view.append(schemaView(one, schemas, depth + 1));
  else if (target.type === "array") view.append(make("span", { class: "quiet", text: ` ${shortType(target, schemas)}` }), inner(target, schemas, depth));
  else view.append(make("span", { class: "quiet", text: ` ${shortType(target, schemas)}` }));
  return view;
}
