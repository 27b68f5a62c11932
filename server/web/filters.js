// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What a search is limited to.
import { address, ask } from "./api.js";
import { byId, make } from "./dom.js";
import { parseLabels } from "./labels.js";

const form = byId("filters-form");
let apply = () => {};

export const whenFiltersChange = (call) => { apply = call; };

// The parameters of the search. Throws an Error in words for labels that cannot be read.
export function filterSettings() {
  const settings = { limit: byId("filter-limit").value, group_by: byId("filter-group").value };
  const object = byId("filter-object").value.trim();
  if (object) settings.object = object;
  if (byId("filter-score").value !== "0") settings.min_score = byId("filter-score").value;
  const labels = parseLabels(byId("filter-labels").value, true);
  if (labels) settings.filter = labels;
  return settings;
}

// Whether some of the collection is left out.
export const isFiltered = () => ["filter-object", "filter-labels"].some((id) => byId(id).value.trim()) ||
                                byId("filter-score").value !== "0";

// The fields as they stand in a search's address, by name; each says nothing where it has its first value.
const kFields = { object: "filter-object", labels: "filter-labels", min_score: "filter-score", group_by: "filter-group", limit: "filter-limit" };
const firstValue = (field) => (field.options ? field.options[0].value : "");

export const filterParameters = () => Object.fromEntries(Object.entries(kFields)
  .map(([name, id]) => [name, byId(id).value.trim()]).filter(([name, value]) => value !== firstValue(byId(kFields[name]))));

// As an address says. Whether they were different before.
export function takeFilters(parameters) {
  const before = JSON.stringify(filterParameters());
  for (const [name, id] of Object.entries(kFields)) {
    const field = byId(id);
    field.value = parameters.get(name) ?? firstValue(field);
    if (field.options && field.selectedIndex < 0) field.selectedIndex = 0;  // no such choice
  }
  showHowMany();
  return JSON.stringify(filterParameters()) !== before;
}

function showHowMany() {
  const set = [byId("filter-object").value.trim(), byId("filter-labels").value.trim(),
               byId("filter-score").value !== "0"].filter(Boolean).length;
  byId("filters-set").textContent = set ? `(${set} set)` : "";
}

form.addEventListener("submit", (event) => {
  event.preventDefault();
  showHowMany();
  apply();
});
form.addEventListener("reset", () => setTimeout(() => {  // after the fields are empty
  showHowMany();
  apply();
}));

// Names to choose from while typing, here and where pictures are added.
export async function offerObjectNames() {
  try {
    const { objects } = await ask(address("/objects?limit=500"));
    byId("object-names").replaceChildren(
      ...objects.filter(({ object }) => object).map(({ object }) => make("option", { value: object })));
  } catch {
    // names can still be typed
  }
}
byId("filters").addEventListener("toggle", () => { if (byId("filters").open) offerObjectNames(); });
