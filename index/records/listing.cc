// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/records/listing.h"

#include <set>

#include "descriptor/base/error.h"
#include "index/files/text.h"

namespace pliant {
namespace {

[[noreturn]] void ThrowInvalid(const char* reason, const std::string& message) {
  throw Error(ErrorCode::kInvalidArgument, reason, message);
}

}  // namespace

void CheckSelection(const Selection& which) {
  CheckFilter(which.filter);
  if (which.text.size() > kMaxTextBytes) {
    ThrowInvalid("text_invalid",
                 "text can have at most " + std::to_string(kMaxTextBytes) + " bytes.");
  }
  if (!IsValidUtf8(which.text)) ThrowInvalid("text_invalid", "text must be UTF-8.");
}

void CheckListing(const Selection& which, const PageOptions& page) {
  CheckSelection(which);
  if (page.limit < 1 || page.limit > 1000) {
    ThrowInvalid("limit_invalid",
                 "limit must be 1 to 1000, not " + std::to_string(page.limit) + ".");
  }
  if (page.facets.size() > kMaxFacets) {
    ThrowInvalid("facets_invalid",
                 "facets can have at most " + std::to_string(kMaxFacets) + " keys.");
  }
  std::set<std::string> seen;
  for (const std::string& key : page.facets) {
    if (seen.insert(key).second) continue;
    ThrowInvalid("facets_invalid", "facets has the key \"" + ToDisplayText(key) + "\" twice.");
  }
}

}  // namespace pliant
