// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// node texts.mjs: prints the table of all sentences of the page, in English. Translate its values, save it as
// server/web/texts-LANGUAGE.json, name it in server/CMakeLists.txt, and the language in data-languages of index.html.
import { readdirSync, readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

const web = new URL("../../server/web/", import.meta.url);

// The end of a string, a template or an expression that begins at `at`.
function endOf(source, at) {
  const opened = source[at];
  for (let i = at + 1; i < source.length; ++i) {
    const letter = source[i];
    if (letter === "\\") ++i;
    else if (opened === "{" ? letter === "}" : letter === opened) return i;
    else if (opened === "`" && source.startsWith("${", i)) i = endOf(source, i + 1);
    else if (opened === "{" && "{\"`".includes(letter)) i = endOf(source, i);
  }
  throw new Error(`no end: ${source.slice(at, at + 60)}`);
}

// t`Renamed to ${name}.` as "Renamed to {}."
function templateKey(source, at) {
  const end = endOf(source, at);
  let key = "";
  for (let i = at + 1; i < end; ++i) {
    if (source.startsWith("${", i)) {
      i = endOf(source, i + 1);
      key += "{}";
    } else {
      key += source[i] === "\\" ? source[++i] : source[i];
    }
  }
  return key.replace(/\s*\n\s*/g, " ");
}

const plain = (html) => html.replace(/&lt;/g, "<").replace(/&gt;/g, ">").replace(/&amp;/g, "&").trim().replace(/\s+/g, " ");

function htmlTexts(html) {
  const body = html.slice(html.indexOf("<body>")).replace(/<noscript>.*<\/noscript>/g, "");
  const attributes = [...body.matchAll(/ (?:aria-label|aria-roledescription|placeholder|title)="([^"]*)"/g)];
  return [...body.matchAll(/>([^<]+)</g), ...attributes].map(([, text]) => plain(text));
}

export function sentences() {
  const table = {};
  const add = (key, value = key) => { if (/\p{L}/u.test(key)) table[key] = value; };
  for (const name of readdirSync(web).sort()) {
    const source = /^(?!docs).*\.(js|html)$/.test(name) ? readFileSync(new URL(name, web), "utf8") : "";
    if (name.endsWith(".html")) for (const text of htmlTexts(source)) add(text);
    const code = source.replace(/^\s*\/\/.*$/gm, "");
    for (const found of code.matchAll(/(?<![\w$])t(?=`)/g)) add(templateKey(code, found.index + 1));
    for (const [, one, other] of code.matchAll(/\bcount\((?:[^()]|\([^()]*\))*?, "([^"]+)"(?:, "([^"]+)")?\)/g)) {
      add(`{} ${other ?? `${one}s`}`, { one: `{} ${one}`, other: `{} ${other ?? `${one}s`}` });
    }
  }
  return table;
}

if (import.meta.url === pathToFileURL(process.argv[1]).href) console.log(JSON.stringify(sentences(), null, 1));
