// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Non-maximum suppression between objects. Private to index/.
#pragma once

#include <vector>

#include "descriptor/features/features.h"
#include "index/verify/rerank.h"

namespace pliant {

// One part of the query shows one thing. If instances of several named objects overlap (at least
// half of the keypoints of each inside the outline of the other), one of them is correct. Notes of
// one series, packages of one brand: each matches their common part.
//   - Each gets a share of the probability: p / (1 + the sum of (o' / o)^3), with its own
//     probability p, the odds o of its score there and the odds o' of each other object. An object
//     with several instances gets the largest of its shares. Scores stay.
//   - The object that keeps most of its matches (KeepExclusiveMatches) wins: overlapping instances
//     of the others are removed, but one of each image stays.
//   - The probability, and the odds o, are multiplied by what the pixels say (SameObject).
//   - An image without evidence has no place of its own: it gets p (1 - the largest probability).
// Objects that keep equally many matches, as copies under two names do, do not compete. Neither do
// images without a name, nor those of the same object. Sets `probability` of all images, rounded.
// `query`: the query against which `images` were verified.
void SuppressNonMaxima(const Features& query, std::vector<VerifiedImage>* images);

}  // namespace pliant
