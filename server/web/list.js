// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Lists without an end: what comes next is fetched when the end of the list is near, or asked for.
import { byId, say } from "./dom.js";

const kPage = 24;
const kMost = 500;      // that the server gives at once
const kNear = "600px";  // how far below the window's edge the end is near

// place: the lists' elements are PLACE-list, PLACE-status and PLACE-more (a button). fetchPage(parameters, cursor,
// limit) gives { items, next }; card(item) an element, or null for what is on its way out; none(parameters)
// says that there is nothing: words, or an element.
export function makeList({ place, fetchPage, card, none }) {
  const list = byId(`${place}-list`);
  const status = byId(`${place}-status`);
  const more = byId(`${place}-more`);
  let parameters = {};
  let next = null;    // cursor of the server
  let fetched = 0;    // items so far
  let latest = 0;     // an answer that is no longer wanted is dropped

  const isShown = () => !list.closest(".view").hidden;

  async function fetch(cursor, limit) {
    const number = ++latest;
    observer.unobserve(more);  // what failed is not tried again until somebody asks
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
      next = cursor || null;  // it can be asked for once more
      return null;
    } finally {
      if (number === latest) {
        list.removeAttribute("aria-busy");
        more.hidden = !next;
      }
    }
  }

  async function extend() {
    if (more.hidden || !isShown()) return;
    const hadFocus = document.activeElement === more;
    const cards = await fetch(next, kPage);
    if (!cards) return;
    list.append(...cards);
    say(status, "");
    if (hadFocus) cards[0]?.querySelector("a, button, input").focus();
    watchEnd();
  }

  // An observer tells of a change only: it is asked anew after every page.
  const observer = new IntersectionObserver((seen) => { if (seen.some((one) => one.isIntersecting)) extend(); },
                                            { rootMargin: kNear });
  function watchEnd() {
    if (!more.hidden) observer.observe(more);
  }
  more.addEventListener("click", extend);

  return {
    list,
    // Whoever comes back finds as many as were there.
    async show(wanted, { isReturn = false } = {}) {
      const same = JSON.stringify(wanted) === JSON.stringify(parameters);
      const limit = same && isReturn ? Math.min(kMost, Math.max(kPage, fetched)) : kPage;
      parameters = wanted;
      const cards = await fetch("", limit);
      if (!cards) return;
      list.replaceChildren(...cards);
      showNone();
      watchEnd();
    },
    showNone,
  };

  // Also when the last one was taken off.
  function showNone() {
    say(status, "");
    if (!list.children.length && !next) status.append(none(parameters));
  }
}
