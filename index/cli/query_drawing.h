// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A query's answer as pictures: what matched where, and the object laid flat.
#pragma once

#include <optional>
#include <vector>

#include "descriptor/image/image.h"
#include "index/engine/engine.h"

namespace pliant::cli {

struct ShownHit {
  Hit hit;                              // with its explanation
  std::optional<DecodedImage> picture;  // in colour; nothing when its bytes were not kept
};

// One row a hit: a caption, the query with the object's outline, the hit's picture, and a line for
// each pair of matching points that agrees with the warp. 3 channels.
Image DrawHits(const DecodedImage& query, const std::vector<ShownHit>& hits);

// The object as the query shows it, flattened through the warp to the shape of the hit's picture,
// beside that picture. Where the warp cannot be trusted or leaves the query there is a check
// pattern. Throws kInvalidArgument for a hit that was not verified.
Image DrawUnwarped(const DecodedImage& query, const ShownHit& hit);

}  // namespace pliant::cli
