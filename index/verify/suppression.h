// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Non-maximum suppression between objects that are seen at one place of the query. Private to
// index/.
#pragma once

#include <vector>

#include "descriptor/features/features.h"
#include "index/verify/rerank.h"

namespace pliant {

// A place of the query shows one thing: where instances of several named objects lie at the same
// place (at least half of the keypoints of each inside of the outline of the other), one of them
// is right. Notes of one series, packages of one brand: each agrees with the part that they have in
// common.
//   - Each has its share of the probability: p / (1 + the sum of (o' / o)³), with its own
//     probability p, its odds o there and those o' of each other object. An object that is seen in
//     several places has the largest of its shares. Scores stay, and so the order.
//   - The one that keeps most of its matches (KeepExclusiveMatches) has the place: instances of the
//     others there go, as far as one is left.
// What keeps equally many matches, as copies under two names do, is no rival. Neither are images
// without a name, whatever they show, nor those of the same object. An image that agrees through
// another one (`via`) has as much of its probability as that one has, and of another object than
// that one less, as if both were seen at one place. Sets `probability` of all images. `query`:
// what `images` were verified against.
void SuppressNonMaxima(const Features& query, std::vector<VerifiedImage>* images);

}  // namespace pliant
