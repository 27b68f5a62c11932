// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What problem codes and scores mean, for people who have not read the manual.

const kProblems = {
  first_key_admin: "The first key has to be one that may do everything: else nobody could make more.",
  last_admin_key: "This is the last key that may do everything: without it nobody could make more. Make another one first.",
  backup_not_found: "There is no such backup any more.",
  backup_exists: "There is a backup of that name already.",
  key_not_found: "This key is revoked already.",
  no_vocabulary: "There is nothing to find yet, or the first pictures are still being prepared. Add pictures, or try again in a moment.",
  no_pictures: "There are no pictures to choose words from. Add some first.",
  interrupted: "The server ended while this was at work. Start it again.",
  content_not_kept: "The original of this picture is not kept.",
  image_not_found: "This picture is no longer there.",
  object_not_found: "There is no such object.",
  collection_not_found: "There is no collection of this name.",
  request_timeout: "It took too long to send. Is the connection slow?",
  range_not_satisfiable: "The server cannot give that part of the file.",
  cross_site: "The server takes changes from its own page only.",
  host_not_allowed: "The server does not answer by this name. Its operator can allow it (--allowed-hosts).",
  read_only: "The server may not write where it keeps the pictures.",
  too_many_open_files: "The server is busy.",
  image_type_unknown: "This is not a picture that Pliant reads. It reads JPEG, PNG, WebP, BMP and TIFF.",
  unsupported_content_type: "This is not a picture that Pliant reads. It reads JPEG, PNG, WebP, BMP and TIFF.",
  image_empty: "The file is empty.",
  image_truncated: "The file ends too early, as a broken download or copy does.",
  image_corrupt: "The file is damaged and cannot be read as a picture.",
  image_too_large: "The picture has more pixels than this server takes.",
  image_too_small: "The picture is too small to recognise anything in it.",
  too_few_features:
    "There is too little detail here to recognise anything by. Try a sharper picture that the object fills.",
  precondition_failed:
    "Somebody else has changed it meanwhile. Cancel, look at what it is now, and edit it again.",
  no_space: "The server's disk is full.",
  internal: "Something went wrong inside the server. Its log says what.",
  stopping: "The server is being stopped.",
  starting: "The server is still loading its index. Try again in a moment.",
};

export const kWrongKey = "This key does not work: it is mistyped, or it was revoked. Enter another one under \"Key\".";

const kStatuses = {
  401: "This server asks for a key. Enter yours under \"Key\".",
  403: "The key in use is not allowed to do this.",
  429: "Too many requests in a short time.",
  503: "The server is busy.",
};

function tooLarge(detail) {
  const size = /\d[\d.]* (bytes|[KMGT]iB)/.exec(detail ?? "")?.[0];
  return `The file is larger than ${size ? `the ${size} that ` : ""}this server takes.`;
}

// What is said of a parameter, to people who have given an address and know of no parameter.
function fetchWords(detail) {
  const words = detail.replaceAll("image_url", "this address");
  return words.charAt(0).toUpperCase() + words.slice(1);
}

// `body` is the problem document of the answer, or null. isWrongKey: there was a key, and it was refused.
export function problemWords(status, body, retryAfterS, isWrongKey = false) {
  if (isWrongKey) return kWrongKey;
  const known = kProblems[body?.code] ?? kStatuses[status];
  const wait = retryAfterS && (status === 429 || status === 503) ?
    ` Try again in ${retryAfterS} s.` : "";
  if (body?.code === "same_bytes" && body.image_id) {
    return body.object ? `This picture is there already, as ${body.object}.` :
                         "This picture is there already, without a name or with other labels.";
  }
  if (body?.code === "body_too_large") return tooLarge(body.detail);
  if (body?.parameter === "image_url" && body.detail) return fetchWords(body.detail);
  return (known ?? body?.detail ?? `The server answered ${status}.`) + wait;
}

// How sure a hit is: the one scale for words, bars, verdicts and what is shown without asking. From
// kFound on the server counts a hit as found. "weak" hits are folded away.
const kFound = 0.9;
const kGrades = [
  { least: 0.99, words: "Almost certainly the same", grade: "sure" },
  { least: kFound, words: "Very likely the same", grade: "likely" },
  { least: 0.5, words: "Perhaps the same", grade: "perhaps" },
  { least: 0, words: "Hardly alike", grade: "weak" },
];
// A search that does not verify, as one with a vocabulary of an older version, knows no
// probabilities: its scores only say how many details the pictures have in common.
const kMuchAlike = 0.5;

// { words, grade, share: 0..1 for the bar, percent: the same in words, or "" }
// isOneOf: see sharing().
export function scoreWords({ score, probability, isOneOf = false }) {
  if (probability === null) {
    const alike = score >= kMuchAlike;
    return { words: alike ? "Looks much alike" : "Hardly alike", grade: alike ? "perhaps" : "weak",
             share: score, percent: "" };
  }
  const { words, grade } = isOneOf ? kGrades.find((one) => one.grade === "perhaps") :
                                     kGrades.find(({ least }) => probability >= least);
  // Never 100 %: objects that share most of their print are told apart by little.
  const percent = probability > 0.99 ? "> 99 %" : probability < 0.01 ? "< 1 %" :
                                                                         `${Math.round(100 * probability)} %`;
  return { words, grade, share: probability, percent };
}

// The first hits of an undecided answer: objects that are alike, and share a probability that would do for one. Marked
// as such (isOneOf), as many as have it together; what has hardly any of it is not one of them.
export function sharing(hits) {
  const least = 0.1 * Math.max(...hits.map(({ probability }) => probability));
  let sum = 0;
  return hits.map((hit) => {
    const isOneOf = sum < kFound && hit.probability >= least;
    sum += hit.probability;
    return { ...hit, isOneOf };
  });
}

export const isFound = (hit) => ["sure", "likely"].includes(scoreWords(hit).grade);
export const isWeak = (hit) => scoreWords(hit).grade === "weak";

const kMostNames = 5;

// "A", "A and B", "A, B and C"; of many the first few.
function listed(names, many, word) {
  const some = names.slice(0, many > kMostNames ? kMostNames - 1 : kMostNames);
  if (many > some.length) return `${some.join(", ")} ${word} ${many - some.length} more`;
  return some.length < 2 ? some.join() : `${some.slice(0, -1).join(", ")} ${word} ${some.at(-1)}`;
}

// What an answer comes to, in a sentence. hits: in the order of the answer, each with its `name`;
// found: how many the server counts, over all pages, or null: objects where the hits are grouped by
// object, else pictures. inPart, filtered: what it was limited to. stored: a picture of the collection was
// searched with, and is itself left out.
export function verdictWords({ hits, found, grouped = true, inPart = false, filtered = false, stored = false }) {
  const where = inPart ? " inside the part" : "";
  const names = (list) => [...new Set(list.map(({ name }) => name))];
  const sure = names(hits.filter(isFound));
  const perhaps = names(hits.filter((hit) => !isFound(hit) && !isWeak(hit)));
  if (sure.length) {
    const listedHits = hits.filter(isFound).length;
    const all = grouped && listedHits === sure.length ? Math.max(sure.length, found ?? 0) : sure.length;
    const orMore = !grouped && found > listedHits ? " or more" : "";
    return all === 1 ? `Found${where}: ${sure[0]}.` :
                       `${all}${orMore} objects found${where}: ${listed(sure, all, "and")}.`;
  }
  if (perhaps.length) return `Not sure${where}: perhaps ${listed(perhaps, perhaps.length, "or")}.`;
  if (filtered) return `Not found${where} among what the filters leave.`;
  if (stored) return `Nothing else in your collection is like it${where}.`;
  return inPart ? "Nothing of your collection is inside the part." : "Not in your collection.";
}

// What may help where nothing was found for sure; "" where nothing would. Arguments as above.
export function adviceWords({ hits, inPart = false, stored = false }) {
  if (inPart || stored || hits.some(isFound)) return "";
  return "If it is small in your picture, select the part that shows it.";
}
