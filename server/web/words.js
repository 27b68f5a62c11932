// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Problem codes, scores and answers in sentences.
import { language, t } from "./texts.js";

// For codes whose detail from the server does not tell people enough.
const kNotReadable = t`Pliant cannot read this file as an image. Try a JPEG or PNG file.`;
const kProblems = {
  forbidden: t`Your key does not allow this. Ask for a key with more access.`,
  cross_site: t`The server refuses requests from this address. Ask the person who runs this server to check its proxy and --cors-origins.`,
  last_admin_key: t`This is the last admin key. Create another admin key first.`,
  backup_not_found: t`This backup no longer exists.`,
  key_not_found: t`This key is already revoked.`,
  no_vocabulary: t`The collection is empty, or search is still being prepared. Add images, or try again in a moment.`,
  no_images: t`There are no images yet. Add images first.`,
  interrupted: t`The server stopped during this job. Start the job again.`,
  content_not_kept: t`The server does not store the original of this image.`,
  image_not_found: t`This image no longer exists.`,
  request_timeout: t`The upload took too long. Check your connection.`,
  read_only: t`The server cannot write to its storage. Tell the person who runs this server.`,
  image_type_unknown: kNotReadable,
  unsupported_content_type: kNotReadable,
  image_empty: t`The file is empty. Choose another file.`,
  image_truncated: t`The file ends too early. The download or copy may be incomplete.`,
  image_corrupt: t`The file is damaged and cannot be read.`,
  too_few_features: t`The image has too little detail. Try a sharper image in which the object is larger.`,
  precondition_failed: t`Someone else changed this image. Cancel, and edit it again.`,
  no_space: t`The server's disk is full. Tell the person who runs this server.`,
  internal: t`Internal server error. The server's log has the cause.`,
  stopping: t`The server is stopping.`,
  starting: t`The server is loading its index.`,  // problemWords() adds when to try again
};
const kStatuses = {
  401: t`This server needs a key. Enter your key under "Key".`,
  403: t`Your key does not allow this.`,
  429: t`Too many requests.`,
  503: t`The server is busy.`,
};
export const kWrongKey = t`This key does not work: it is mistyped or revoked. Enter another key.`;

function tooLarge(detail) {
  const size = /\d[\d.]* (bytes|[KMGT]iB)/.exec(detail ?? "")?.[0];
  return size ? t`The file is too large: this server accepts up to ${size}.` : t`The file is too large for this server.`;
}

// The server's sentence names the parameter; people gave an address.
function fetchWords(detail) {
  const words = detail.replaceAll("image_url", "this address");
  return words.charAt(0).toUpperCase() + words.slice(1);
}

// `body`: the problem document of the answer, or null. isWrongKey: the server refused the key that was sent.
export function problemWords(status, body, retryAfterS = 0, isWrongKey = false) {
  if (isWrongKey) return kWrongKey;
  if (body?.code === "same_bytes" && body.image_id) {
    return body.object ? t`This image is already stored, as ${body.object}.` : t`This image is already stored, without a name or with other labels.`;
  }
  if (body?.code === "body_too_large") return tooLarge(body.detail);
  if (body?.parameter === "image_url" && body.detail) return fetchWords(body.detail);
  const problem = kProblems[body?.code] ?? kStatuses[status] ?? body?.detail ?? t`The server answered with status ${status}.`;
  return retryAfterS && (status === 429 || status === 503) ? t`${problem} Try again in ${retryAfterS} s.` : problem;
}

// How sure a hit is: the one scale for words, bars and folding, by the server's verdict. "weak" hits are folded away.
const kGrades = {
  found: { words: t`Found`, grade: "found" },
  perhaps: { words: t`Perhaps`, grade: "perhaps" },
  unlikely: { words: t`Unlikely`, grade: "weak" },
};

// { words, grade, share: 0..1 for the bar, percent: text, or "" }. Without verification there is no probability, and
// a score is never sure.
export function scoreWords({ score, probability, verdict }) {
  const value = probability ?? score;
  const { words, grade } = kGrades[verdict ?? (score >= 0.2 ? "perhaps" : "unlikely")];
  const percent = probability === null ? "" : `${Math.round(100 * value)} %`;
  return { words, grade, share: value, percent };
}

export const isFound = (hit) => scoreWords(hit).grade === "found";
export const isWeak = (hit) => scoreWords(hit).grade === "weak";

const kMostNames = 5;

// "A", "A and B", "A, B and C"; of many the first few. kind: "conjunction" (and) or "disjunction" (or).
function listed(names, many, kind) {
  const some = names.slice(0, many > kMostNames ? kMostNames - 1 : kMostNames);
  if (many > some.length) some.push(t`${many - some.length} more`);
  return new Intl.ListFormat(language === "en" ? "en-GB" : language, { type: kind }).format(some);
}

// An answer in a sentence. hits: in order, each with its `name`; found: how many the server counts over all pages
// (objects if `grouped`, else images), or null. inPart, filtered: limits of the search. stored: the query is an image
// of the collection, which is left out.
export function verdictWords({ hits, found, grouped = true, inPart = false, filtered = false, stored = false }) {
  const where = inPart ? ` ${t`in this part`}` : "";
  const names = (list) => [...new Set(list.map(({ name }) => name))];
  const sure = names(hits.filter(isFound));
  const perhaps = names(hits.filter((hit) => !isFound(hit) && !isWeak(hit)));
  if (sure.length) {
    const listedHits = hits.filter(isFound).length;
    const all = grouped && listedHits === sure.length ? Math.max(sure.length, found ?? 0) : sure.length;
    if (all === 1) return t`Found${where}: ${sure[0]}.`;
    const list = listed(sure, all, "conjunction");
    return !grouped && found > listedHits ? t`${all} or more objects found${where}: ${list}.` : t`${all} objects found${where}: ${list}.`;
  }
  if (perhaps.length) return t`Perhaps${where}: ${listed(perhaps, perhaps.length, "disjunction")}.`;
  if (stored && !filtered) return t`No other similar object found${where}.`;
  return filtered ? t`Not found${where} with these filters.` : t`Not found${where}.`;
}

// What may help if nothing was found; "" if nothing would.
export const adviceWords = ({ hits, inPart = false, stored = false }) =>
  (inPart || stored || hits.some(isFound) ? "" : t`If the object is small in your photo, select the part that shows it.`);
