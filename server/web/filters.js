// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The limits of a search.
import { address, ask } from "./api.js";
import { byId, make, onSubmit } from "./dom.js";
import { parseLabels } from "./labels.js";
import { t } from "./texts.js";

const form = byId("filters-form");
let apply = () => {};
export const whenFiltersChange = (call) => { apply = call; };

// The fields by their names in the address of a search. A field with its first value is not in the address.
const kFields = Object.fromEntries(Object.entries({
  object: "filter-object", labels: "filter-labels", min_score: "filter-score", group_by: "filter-group", limit: "filter-limit",
}).map(([name, id]) => [name, byId(id)]));
const firstValue = (field) => (field.options ? field.options[0].value : "");

export const filterParameters = () => Object.fromEntries(Object.entries(kFields)
  .map(([name, field]) => [name, field.value.trim()]).filter(([name, value]) => value !== firstValue(kFields[name])));

// The fields that leave out some of the collection.
const limits = () => ["object", "labels", "min_score"].filter((name) => name in filterParameters());
export const isFiltered = () => limits().length > 0;

// The parameters of the search. Throws an Error with a sentence for labels that cannot be read.
export function filterSettings() {
  const { object, labels, min_score: score } = filterParameters();
  const filter = parseLabels(labels ?? "", true);
  return { limit: Number(kFields.limit.value), group_by: kFields.group_by.value, ...(object && { object }),
           ...(score && { min_score: Number(score) }), ...(filter && { filter }) };
}

// Fills the fields from an address. Returns whether they changed.
export function takeFilters(parameters) {
  const before = JSON.stringify(filterParameters());
  for (const [name, field] of Object.entries(kFields)) {
    field.value = parameters.get(name) ?? firstValue(field);
    if (field.options && field.selectedIndex < 0) field.selectedIndex = 0;  // no such choice
  }
  showHowMany();
  return JSON.stringify(filterParameters()) !== before;
}

function showHowMany() {
  const set = limits().length;
  byId("filters-set").textContent = set ? t`(${set} set)` : "";
}

// Forgets the words that limit a search.
export function forgetLimits() {
  kFields.object.value = kFields.labels.value = "";
  showHowMany();
}

function change() {
  showHowMany();
  apply();
}
onSubmit(form, change);
form.addEventListener("reset", () => setTimeout(change));  // after the fields are empty

// Names to choose from while typing, here and for images.
export async function offerObjectNames() {
  try {
    const { objects } = await ask(address("/objects?limit=500"));
    byId("object-names").replaceChildren(...objects.filter(({ object }) => object).map(({ object }) => make("option", { value: object })));
  } catch {
    // names can still be typed
  }
}
byId("filters").addEventListener("toggle", () => { if (byId("filters").open) offerObjectNames(); });
