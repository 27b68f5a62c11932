// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Problem codes, scores and answers in sentences.

// For codes whose detail from the server does not tell people enough.
const kNotReadable = "Pliant cannot read this file as an image. Try a JPEG or PNG file.";
const kProblems = {
  forbidden: "Your key does not allow this. Ask for a key with more access.",
  cross_site: "The server refuses requests from this address. Ask the person who runs this server to check its proxy and --cors-origins.",
  last_admin_key: "This is the last admin key. Create another admin key first.",
  backup_not_found: "This backup no longer exists.",
  key_not_found: "This key is already revoked.",
  no_vocabulary: "The collection is empty, or search is still being prepared. Add images, or try again in a moment.",
  no_images: "There are no images yet. Add images first.",
  interrupted: "The server stopped during this job. Start the job again.",
  content_not_kept: "The server does not store the original of this image.",
  image_not_found: "This image no longer exists.",
  request_timeout: "The upload took too long. Check your connection.",
  read_only: "The server cannot write to its storage. Tell the person who runs this server.",
  image_type_unknown: kNotReadable,
  unsupported_content_type: kNotReadable,
  image_truncated: "The file ends too early. The download or copy may be incomplete.",
  image_corrupt: "The file is damaged and cannot be read.",
  too_few_features: "The image has too little detail. Try a sharper image in which the object is larger.",
  precondition_failed: "Someone else changed this image. Cancel, and edit it again.",
  no_space: "The server's disk is full. Tell the person who runs this server.",
  internal: "Internal server error. The server's log has the cause.",
  stopping: "The server is stopping.",
  starting: "The server is loading its index.",  // problemWords() adds when to try again
};
const kStatuses = {
  401: "This server needs a key. Enter your key under \"Key\".",
  403: "Your key does not allow this.",
  429: "Too many requests.",
  503: "The server is busy.",
};
export const kWrongKey = "This key does not work: it is mistyped or revoked. Enter another key.";

function tooLarge(detail) {
  const size = /\d[\d.]* (bytes|[KMGT]iB)/.exec(detail ?? "")?.[0];
  return `The file is too large${size ? `: this server accepts up to ${size}` : " for this server"}.`;
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
    return `This image is already stored, ${body.object ? `as ${body.object}` : "without a name or with other labels"}.`;
  }
  if (body?.code === "body_too_large") return tooLarge(body.detail);
  if (body?.parameter === "image_url" && body.detail) return fetchWords(body.detail);
  const later = retryAfterS && (status === 429 || status === 503) ? ` Try again in ${retryAfterS} s.` : "";
  return (kProblems[body?.code] ?? kStatuses[status] ?? body?.detail ?? `The server answered with status ${status}.`) + later;
}

// How sure a hit is: the one scale for words, bars and folding, by the server's verdict. "weak" hits are folded away.
const kGrades = {
  found: { words: "Found", grade: "found" },
  perhaps: { words: "Perhaps", grade: "perhaps" },
  unlikely: { words: "Unlikely", grade: "weak" },
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

// "A", "A and B", "A, B and C"; of many the first few.
function listed(names, many, word) {
  const some = names.slice(0, many > kMostNames ? kMostNames - 1 : kMostNames);
  if (many > some.length) return `${some.join(", ")} ${word} ${many - some.length} more`;
  return some.length < 2 ? some.join() : `${some.slice(0, -1).join(", ")} ${word} ${some.at(-1)}`;
}

// An answer in a sentence. hits: in order, each with its `name`; found: how many the server counts over all pages
// (objects if `grouped`, else images), or null. inPart, filtered: limits of the search. stored: the query is an image
// of the collection, which is left out.
export function verdictWords({ hits, found, grouped = true, inPart = false, filtered = false, stored = false }) {
  const where = inPart ? " in this part" : "";
  const names = (list) => [...new Set(list.map(({ name }) => name))];
  const sure = names(hits.filter(isFound));
  const perhaps = names(hits.filter((hit) => !isFound(hit) && !isWeak(hit)));
  if (sure.length) {
    const listedHits = hits.filter(isFound).length;
    const all = grouped && listedHits === sure.length ? Math.max(sure.length, found ?? 0) : sure.length;
    const orMore = !grouped && found > listedHits ? " or more" : "";
    return all === 1 ? `Found${where}: ${sure[0]}.` : `${all}${orMore} objects found${where}: ${listed(sure, all, "and")}.`;
  }
  if (perhaps.length) return `Perhaps${where}: ${listed(perhaps, perhaps.length, "or")}.`;
  if (stored && !filtered) return `No other similar object found${where}.`;
  return `Not found${where}${filtered ? " with these filters" : ""}.`;
}

// What may help if nothing was found; "" if nothing would.
export const adviceWords = ({ hits, inPart = false, stored = false }) =>
  (inPart || stored || hits.some(isFound) ? "" : "If the object is small in your photo, select the part that shows it.");
