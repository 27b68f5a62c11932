// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What problem codes and scores mean, for people who have not read the manual.

const kProblems = {
  image_type_unknown: "This is not a picture that Pliant reads. It reads JPEG, PNG, WebP, BMP and TIFF.",
  unsupported_content_type: "This is not a picture that Pliant reads. It reads JPEG, PNG, WebP, BMP and TIFF.",
  image_empty: "The file is empty.",
  image_truncated: "The file ends too early, as a broken download or copy does.",
  image_corrupt: "The file is damaged and cannot be read as a picture.",
  image_too_small: "The picture is too small to recognise anything in it.",
  too_few_features:
    "There is too little detail here to recognise anything by. Try a sharper picture that the object fills.",
  no_space: "The server's disk is full.",
  internal: "Something went wrong inside the server. Its log says what.",
  stopping: "The server is being stopped.",
  starting: "The server is still loading its index. Try again in a moment.",
};

const kStatuses = {
  401: "This server asks for a key. Enter yours under \"Key\".",
  403: "The key in use is not allowed to do this.",
  429: "Too many requests in a short time.",
  503: "The server is busy.",
};

// `body` is the problem document of the answer, or null.
export function problemWords(status, body, retryAfterS) {
  const known = kProblems[body?.code] ?? kStatuses[status];
  const wait = retryAfterS && (status === 429 || status === 503) ?
    ` Try again in ${retryAfterS} s.` : "";
  if (status === 401 && body?.code === "invalid_key") return `${body.detail} ${kStatuses[401]}`;
  return (known ?? body?.detail ?? `The server answered ${status}.`) + wait;
}

// How sure a hit is, by its probability. A search that does not verify has none: its scores only say
// how many details the pictures have in common.
const kGrades = [
  { least: 0.99, words: "Almost certainly the same", grade: "sure" },
  { least: 0.9, words: "Very likely the same", grade: "likely" },
  { least: 0.5, words: "Perhaps the same", grade: "perhaps" },
  { least: 0, words: "Hardly alike", grade: "weak" },
];

export function scoreWords({ score, probability }) {
  if (probability !== null) return kGrades.find(({ least }) => probability >= least);
  if (score >= 0.5) return { words: "Looks much alike", grade: "perhaps" };
  return { words: score >= 0.1 ? "A little alike, not confirmed" : "Hardly alike", grade: "weak" };
}
