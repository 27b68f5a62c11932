// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The result of a query as pictures: the matches, and the flattened object.
#pragma once

#include <optional>
#include <vector>

#include "descriptor/image/image.h"
#include "index/engine/engine.h"

namespace pliant::cli {

struct ShownHit {
  Hit hit;                              // with its explanation
  std::optional<DecodedImage> picture;  // in colour; nullopt if its bytes were not kept
};

// One row per hit: a caption, the query with the object's outline, the hit's picture, and a line
// for each pair of matching points that agrees with the warp. 3 channels.
Image DrawHits(const DecodedImage& query, const std::vector<ShownHit>& hits);

// The object as the query shows it, flattened through the warp to the shape of the hit's picture,
// beside that picture. A check pattern fills the parts where the warp is not trusted or leaves the
// query. Throws kInvalidArgument for a hit that was not verified.
Image DrawUnwarped(const DecodedImage& query, const ShownHit& hit);

}  // namespace pliant::cli
