// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Which images of a collection a search may answer with. Data, not a function, so that it can
// travel to a ranker in another process.
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "index/records/filter.h"
#include "index/records/image_ref.h"

namespace pliant {

struct Admission {
  // What was asked for.
  std::optional<std::string> object;  // only its images; "" = images without an object
  Filter filter;                      // on metadata
  std::vector<std::string> without;   // ids of images that are left out

  // What that comes to in the store, for rankers that hold keys alone (Catalogue::Admit).
  bool nothing = false;                                       // there is no such object
  std::optional<Key> object_key;                              // 0 = images without an object
  std::shared_ptr<const std::vector<std::int64_t>> versions;  // ascending; nullptr = all
  std::vector<std::int64_t> without_versions;                 // ascending

  bool Admits(std::int64_t version, Key of_object) const {
    return !nothing && (!object_key || of_object == *object_key) &&
           (!versions || std::binary_search(versions->begin(), versions->end(), version)) &&
           !std::binary_search(without_versions.begin(), without_versions.end(), version);
  }
};

}  // namespace pliant
