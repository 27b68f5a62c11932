// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Two images side by side with the matches between them.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "descriptor/image/image.h"
#include "descriptor/warp/tps.h"

namespace pliant {

enum class Verdict { kUnknown, kTrue, kFalse };

struct DrawnMatch {
  Vec2 first;  // pixels of the first image
  Vec2 second;
  Verdict verdict = Verdict::kUnknown;
};

// Correct matches in blue, wrong ones in orange, those without a verdict in purple; `outline` (in
// the second image, may be empty) in yellow; `caption` and a legend below.
Image DrawMatches(const Image& first, const Image& second, std::span<const DrawnMatch> matches,
                  std::span<const Vec2> outline, const std::string& caption);

}  // namespace pliant
