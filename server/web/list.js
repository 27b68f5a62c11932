// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Lists without an end, and the form above them. The next page is fetched when the end of the list is near, or on request.
import { byId, count, make, say } from "./dom.js";
import { link, replaceAddress } from "./router.js";

const kPage = 24;
const kMost = 500;      // items in one answer of the server
const kNear = "600px";  // distance of the list's end from the window's edge

// The elements are PLACE-list, PLACE-status and PLACE-more (a button). fetchPage(parameters, cursor, limit) gives
// { items, next }; card(item) an element, or null for an item that is being deleted; none(parameters) gives words or an
// element for an empty list.
export function makeList({ place, fetchPage, card, none }) {
  const [list, status, more] = ["list", "status", "more"].map((name) => byId(`${place}-${name}`));
  let parameters = {};
  let next = null;    // cursor of the server
  let fetched = 0;    // items so far
  let latest = 0;     // drops an answer that comes too late

  async function fetch(cursor, limit) {
    const number = ++latest;
    observer.unobserve(more);  // a failed page is fetched again on request only
    list.setAttribute("aria-busy", "true");
    more.hidden = true;
    try {
      const page = await fetchPage(parameters, cursor, limit);
      if (number !== latest) return null;
      next = page.next;
      fetched = (cursor ? fetched : 0) + page.items.length;
      return page.items.map((item) => card(item)).filter(Boolean);
    } catch (error) {
      if (number !== latest) return null;
      if (!cursor) list.replaceChildren();
      say(status, error.message, true);
      next = cursor || null;
      return null;
    } finally {
      if (number === latest) {
        list.removeAttribute("aria-busy");
        more.hidden = !next;
      }
    }
  }

  async function extend() {
    if (more.hidden || list.closest(".view").hidden) return;
    const hadFocus = document.activeElement === more;
    const cards = await fetch(next, kPage);
    if (!cards) return;
    list.append(...cards);
    say(status, "");
    if (hadFocus) cards[0]?.querySelector("a, button, input").focus();
    watchEnd();
  }

  // An observer reports changes only, so it starts again after every page.
  const observer = new IntersectionObserver((seen) => { if (seen.some((one) => one.isIntersecting)) extend(); }, { rootMargin: kNear });
  const watchEnd = () => { if (!more.hidden) observer.observe(more); };
  more.addEventListener("click", extend);

  return {
    list,
    // On return, shows as many items as before.
    async show(wanted, { isReturn = false } = {}) {
      const same = JSON.stringify(wanted) === JSON.stringify(parameters);
      parameters = wanted;
      const cards = await fetch("", same && isReturn ? Math.min(kMost, Math.max(kPage, fetched)) : kPage);
      if (!cards) return;
      list.replaceChildren(...cards);
      say(status, "");
      if (!cards.length && !next) status.append(none(parameters));
      watchEnd();
    },
  };
}

// --- above a list: words to find, the order, and the count. The address has both.

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
