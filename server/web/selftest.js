// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// How well the collection will work: starts its self-test and shows the report.
import * as api from "./api.js";
import { attempt, byId, count, fact, make, makeButton, say, shortTime } from "./dom.js";
import { follow } from "./jobs.js";
import { objectName } from "./names.js";
import { thumbnail } from "./results.js";
import { link } from "./router.js";
import { t } from "./texts.js";

const kVerdicts = { found: t`Found`, perhaps: t`Perhaps`, missed: t`Missed`, wrong: t`Wrong object` };
const kSizes = [t`Small in the photo: under a quarter of its width`, t`A quarter to half of the width`, t`Half of the width or more`];
const kStrengths = [t`Slightly bent`, t`Bent`, t`Crumpled`];

const percent = (share) => `${Math.round(100 * share)} %`;
const between = (share) => t`${Math.round(100 * share.low)} to ${percent(share.high)}`;

// The report in a sentence.
export function reportWords({ photos, outcomes: { found, false_alarms: alarms } }) {
  const right = t`Of ${count(photos, "simulated photo")}, ${found.count} find their object.`;
  const wrong = alarms.count === 1 ? t`Without the object in the collection, 1 finds something else.` :
    t`Without the object in the collection, ${alarms.count || t`none`} find something else.`;
  return `${right} ${wrong}`;
}

// What the test says about the limit of "found": { text, advised }. advised: null if it should stay.
export function limitWords({ found_from: advised, reaches_rate: reached, false_alarm_rate: rate }, current) {
  const now = t`A hit counts as found from a probability of ${percent(current)}.`;
  if (!reached) {
    return { advised: null, text: t`${now} No limit keeps false alarms at ${percent(rate)}: some objects are too similar,
      or the test had too few photos.` };
  }
  if (Math.abs(advised - current) < 0.005) return { advised: null, text: t`${now} That fits this collection.` };
  return { advised, text: t`${now} ${percent(advised)} is enough to keep false alarms at ${percent(rate)}.` };
}

const shareFact = (name, share) => fact(name, percent(share.share), make("span", { class: "quiet beside", text: between(share) }));

function difficultyRow(text, { found, photos }) {
  return make("tr", {}, make("th", { scope: "row", text }), make("td", { text: photos }),
              make("td", { text: found ? `${percent(found.share)} (${between(found)})` : t`none` }));
}

const imageItem = (id, name, note) => make("li", { class: "card" }, make("a", { href: link("image", { id }) }, thumbnail(id),
  make("span", { class: "name", text: name })), make("span", { class: "quiet", text: note }));

const pairItem = (pair) => make("li", { class: "pair" }, make("ul", { class: "cards" },
  imageItem(pair.image_id, objectName(pair.object), ""), imageItem(pair.other_image, objectName(pair.other), "")),
  make("span", { class: "quiet", text: t`confused in ${count(pair.confused, "photo")}` }));

const exampleItem = ({ object, verdict, photo }) => make("li", { class: "card" },
  make("img", { alt: "", src: `data:image/jpeg;base64,${photo}`, width: 320, height: 240 }),
  make("span", { class: "name", text: kVerdicts[verdict] }), make("span", { class: "quiet", text: objectName(object) }));

// A heading, a sentence and a list; nothing for an empty list.
const part = (title, text, items, kind = "cards") => (items.length ? [make("h3", { text: title }), make("p", { text }),
  make("ul", { class: kind, "aria-label": title }, ...items)] : []);

function limitPart(report, current) {
  const { text, advised } = limitWords(report, current);
  const words = make("p", { text });
  if (advised === null) return words;
  words.append(" ", makeButton(t`Use ${percent(advised)}`, () => attempt(byId("selftest-status"), async () => {
    await api.askJson(api.address(), "PATCH", { found_from: advised });
    words.replaceWith(limitPart(report, advised));
  }), { class: "small", "data-needs": "admin" }));
  return words;
}

function showReport(report, current) {
  const { outcomes } = report;
  byId("selftest-report").replaceChildren(
    make("p", { class: "verdict", text: reportWords(report) }),
    make("dl", { class: "facts" }, shareFact(t`Found`, outcomes.found), shareFact(t`Perhaps`, outcomes.perhaps), shareFact(t`Missed`, outcomes.missed),
         shareFact(t`Wrong object`, outcomes.wrong), shareFact(t`False alarms`, outcomes.false_alarms)),
    limitPart(report, current),
    make("div", { class: "scroll", role: "region", "aria-label": t`Found by difficulty`, tabindex: "0" }, make("table", {},
      make("thead", {}, make("tr", {}, ...[t`Photos`, t`Number`, t`Found`].map((text) => make("th", { scope: "col", text })))),
      make("tbody", {}, ...report.by_size.map((row, i) => difficultyRow(kSizes[i], row)),
           ...report.by_strength.map((row, i) => difficultyRow(kStrengths[i], row))))),
    ...part(t`Photos of this test`, t`Pliant made these photos from images of the collection.`, report.examples.map(exampleItem)),
    ...part(t`Too similar`, t`The objects of each pair are confused. Are they two names of one object? Or take an image that shows the difference.`,
            report.similar.map(pairItem), "pairs"),
    ...part(t`Missed`, t`These images were missed in at least one photo.`,
            report.missed.map((one) => imageItem(one.image_id, objectName(one.object), t`missed in ${one.missed} of ${count(one.photos, "photo")}`))),
    ...part(t`Plain`, t`These images have few details. A sharper or larger image may help.`,
            report.plain.map((one) => imageItem(one.image_id, objectName(one.object), count(one.keypoints, "keypoint")))),
    make("p", { class: "quiet", text: t`Tested ${shortTime(report.made_at)} with ${count(report.images, "image")}.` }));
}

let shown = null;  // the collection and time of the report that is on the page

// record: the collection's.
export async function showSelfTest(record, isTesting) {
  byId("selftest").disabled = !record.vocabulary || isTesting;
  const { report } = await api.ask(api.address("/selftest"));
  const key = report && `${record.name} ${report.made_at} ${record.found_from}`;
  if (key === shown) return;
  shown = key;
  byId("selftest").textContent = report ? t`Test again` : t`Test this collection`;
  if (report) showReport(report, record.found_from);
  else byId("selftest-report").replaceChildren();
}

export function makeSelfTest(refresh) {
  byId("selftest").addEventListener("click", async () => {
    const bar = byId("selftest-bar");
    byId("selftest").disabled = true;
    say(byId("selftest-status"), "");
    await attempt(byId("selftest-status"), async () => {
      const job = await api.askJson(api.address("/selftest"), "POST", {});
      bar.hidden = false;
      refresh();
      await follow(job.id, ({ done, total }) => { bar.value = total ? done / total : 0; });
      say(byId("selftest-status"), t`The test is done.`);
    });
    bar.hidden = true;
    refresh();
  });
}
