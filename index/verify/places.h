// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What each place of the query picture shows. Private to index/.
#pragma once

#include <vector>

#include "descriptor/features/features.h"
#include "index/verify/rerank.h"

namespace pliant {

// A place of the query shows one thing: where instances of several named objects lie at the same
// place (at least half of the key points of each inside of the outline of the other), those that
// keep fewer of their claims (SettleClaims) than another one are beaten there. Notes of one series,
// packages of one brand: each agrees with the part that they have in common, one is right.
//   - A picture that is beaten wherever it is has what is left of its probability beside those that
//     beat it: its odds in the sum of all their odds and 1. Its score stays, and so the order.
//   - The further instances of a picture, at places where it is beaten, go.
// What keeps equally many claims, as copies under two names do, is not beaten. Neither are pictures
// without a name, whatever they show, nor those of the same object by each other. Sets
// `probability` of all pictures. `query`: what `pictures` were verified against.
void SettlePlaces(const Features& query, std::vector<VerifiedPicture>* pictures);

}  // namespace pliant
