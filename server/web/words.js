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

// How sure a hit is. Inliers are points that agree on one smooth bending of the object; those decide,
// because a score without them only says that the pictures have details in common.
const kGrades = [
  { inliers: 20, words: "Almost certainly the same", grade: "sure" },
  { inliers: 10, words: "Very likely the same", grade: "likely" },
  { inliers: 6, words: "Perhaps the same", grade: "perhaps" },
];

export function scoreWords({ score, inliers }) {
  for (const { inliers: least, words, grade } of kGrades) {
    if (inliers >= least) return { words, grade };
  }
  return score >= 0.5 ? { words: "Looks much alike", grade: "perhaps" } :
                        { words: "A little alike, not confirmed", grade: "weak" };
}
