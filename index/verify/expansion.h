// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Query expansion through verified images (Chum et al., "Total Recall", ICCV 2007): a view that is
// bent too far for the query is often found through another view between the two. The object's part
// of the best verified images is used as a further query. Private to index/.
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

// Support of an image by a verified one that it matches.
struct Support {
  double evidence = 0;  // as Evidence(); 0.4 times that of the weaker link of the chain
  std::string via;      // id of the verified image
};

struct ExpansionOptions {
  int sources = 3;         // maximum number of verified images used as queries
  std::size_t depth = 50;  // images verified against each of them
  int threads = 1;         // images in parallel; 0 = all cores
};

// The images that are used as further queries, those with most inliers first.
std::vector<const VerifiedImage*> ExpansionSources(const std::vector<VerifiedImage>& images,
                                                   int most);

// By version: the images that have more evidence through others than by themselves. `images` are
// verified already. `load` is as in Rerank; `nearest` ranks the `depth` images that are most
// similar to some features. Deterministic.
std::unordered_map<std::int64_t, Support> Expand(
    const std::vector<VerifiedImage>& images, const ExpansionOptions& options,
    const std::function<std::optional<Features>(std::int64_t version)>& load,
    const std::function<std::vector<RankedImage>(const Features&, std::size_t depth)>& nearest);

}  // namespace pliant
