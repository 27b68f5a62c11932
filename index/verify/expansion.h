// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Query expansion through verified pictures (Chum et al., "Total Recall", ICCV 2007): a view that
// is bent too far for the query is often found by another view between the two. The object's part
// of the best verified pictures is used as a further query. Private to index/.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "descriptor/features/features.h"
#include "index/verify/rerank.h"

namespace pliant {

// Support of a picture by a verified one with which it agrees.
struct Support {
  double evidence = 0;  // as Evidence(); 0.4 times that of the weaker link of the chain
  std::string via;      // id of the verified picture
};

struct ExpansionOptions {
  int sources = 3;         // maximum number of verified pictures used as queries
  std::size_t depth = 50;  // pictures verified against each of them
  int threads = 1;         // pictures in parallel; 0 = all cores
};

// Those that ask in turn, the surest first.
std::vector<const VerifiedPicture*> ExpansionSources(const std::vector<VerifiedPicture>& pictures,
                                                     int most);

// By version: the pictures that have more evidence through others than by themselves. `pictures`
// are verified already. `load` is as in Rerank; `nearest` ranks the pictures most like some
// features by their words, best first, `depth` of them. Deterministic.
std::unordered_map<std::int64_t, Support> Expand(
    const std::vector<VerifiedPicture>& pictures, const ExpansionOptions& options,
    const std::function<std::optional<Features>(std::int64_t version)>& load,
    const std::function<std::vector<RankedPicture>(const Features&, std::size_t depth)>& nearest);

}  // namespace pliant
