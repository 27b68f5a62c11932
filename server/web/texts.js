// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The sentences of the page in its language. The English sentences stand where they are used, and are the keys of a
// table in another language: texts-LANGUAGE.json, named in data-languages of index.html. {} stands for each value;
// {1}, {2} … give them another order. {"{} images": {"one": "{} Bild", "other": "{} Bilder"}} are the forms of a number.
// tests/browser/texts.mjs prints the table of all sentences.
const shipped = document.documentElement.dataset.languages.split(" ");
export const language = navigator.languages.map((one) => one.split("-")[0]).find((one) => shipped.includes(one)) ?? "en";
const table = language === "en" ? {} : await fetch(`assets/texts-${language}.json`).then((answer) => answer.json()).catch(() => ({}));
const rules = new Intl.PluralRules(language);

function fill(text, values) {
  let next = 0;
  return text.replace(/\{(\d*)\}/g, (_, number) => values[number ? number - 1 : next++]);
}

// t`Renamed to ${name}.` Line breaks are spaces.
export function t(parts, ...values) {
  const key = parts.join("{}").replace(/\s*\n\s*/g, " ");
  return fill(table[key] ?? key, values);
}

// shown: the number as text.
export function plural(n, shown, one, other) {
  const forms = table[`{} ${other}`];
  return fill(forms?.[rules.select(n)] ?? forms?.other ?? `{} ${n === 1 ? one : other}`, [shown]);
}

// --- index.html: its texts, and the attributes that people read or hear

const kAttributes = ["aria-label", "aria-roledescription", "placeholder", "title"];

function translated(text) {
  const key = text.trim().replace(/\s+/g, " ");
  return Object.hasOwn(table, key) ? text.replace(text.trim(), () => table[key]) : text;
}

function translatePage() {
  document.documentElement.lang = language;
  const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (texts.nextNode()) texts.currentNode.data = translated(texts.currentNode.data);
  for (const name of kAttributes) {
    for (const element of document.querySelectorAll(`[${name}]`)) element.setAttribute(name, translated(element.getAttribute(name)));
  }
}
if (language !== "en") translatePage();
