// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Above a list: words to find, the order, and the count. The address has both.
import { count, make, say } from "./dom.js";
import { link, replaceAddress } from "./router.js";

const kPauseMs = 250;  // after the last letter

// sorts: [[value of the server, words], ...]; the first is the default. word: what the list has.
export function makeFinder({ view, bar, sorts, word }) {
  const find = make("input", { type: "search", autocomplete: "off", spellcheck: "false", placeholder: "name or file", "aria-label": `Find ${word}s` });
  const sort = make("select", { "aria-label": `Order of the ${word}s` }, ...sorts.map(([value, text]) => make("option", { value, text })));
  const total = make("span", { class: "quiet", role: "status" });
  bar.prepend(make("form", { class: "find", role: "search", "aria-label": `Find ${word}s`,
                             onsubmit: (event) => { event.preventDefault(); apply(); } }, find, sort, total));
  let rest = {};  // other parameters of the address
  let timer = 0;

  function apply() {
    clearTimeout(timer);
    replaceAddress(link(view, { ...rest, q: find.value.trim() || undefined, sort: sort.value === sorts[0][0] ? undefined : sort.value }));
  }
  find.addEventListener("input", () => {
    clearTimeout(timer);
    timer = setTimeout(apply, kPauseMs);
  });
  sort.addEventListener("change", apply);

  return {
    // { q, sort } for the server. others: parameters to keep.
    read(parameters, others) {
      rest = others;
      const q = parameters.get("q") ?? "";
      if (document.activeElement !== find) find.value = q;
      sort.value = sorts.some(([value]) => value === parameters.get("sort")) ? parameters.get("sort") : sorts[0][0];
      return { ...(q && { q }), sort: sort.value };
    },
    // An empty list has nothing to find, to order or to select.
    say(number) {
      bar.hidden = number === 0 && !find.value;
      say(total, number === undefined ? "" : count(number, word));
    },
  };
}
