// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Which options a search takes.
#include <cmath>

#include "descriptor/base/error.h"
#include "index/engine/search_run.h"

namespace pliant {
namespace {

[[noreturn]] void ThrowInvalid(const std::string& field, const std::string& message) {
  throw Error(ErrorCode::kInvalidArgument, field + "_invalid", field + " " + message);
}

}  // namespace

void Validate(const SearchOptions& options) {
  if (!std::isfinite(options.min_score) || options.min_score < 0 || options.min_score > 1) {
    ThrowInvalid("min_score", "must be 0 to 1");
  }
  if (options.threads < 0) ThrowInvalid("threads", "must not be negative");
  if (options.max_instances < 1) ThrowInvalid("max_instances", "must be 1 or more");
  if (options.expand && (*options.expand < 0 || *options.expand > kMostExpansions)) {
    ThrowInvalid("expand", "must be 0 to " + std::to_string(kMostExpansions));
  }
  if (options.without.size() > kMaxExcluded) {
    ThrowInvalid("without", "must be at most " + std::to_string(kMaxExcluded) + " pictures");
  }
  CheckFilter(options.filter);
  if (!options.region) return;
  const Region& r = *options.region;
  for (const double value : {r.x, r.y, r.width, r.height}) {
    if (!std::isfinite(value)) ThrowInvalid("region", "must be four finite numbers");
  }
  if (r.width <= 0 || r.height <= 0) ThrowInvalid("region", "must have a width and height above 0");
}

}  // namespace pliant
