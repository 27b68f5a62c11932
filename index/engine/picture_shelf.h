// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The pictures that one search looks at, read from the store in batches. Private to engine/.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <unordered_map>
#include <vector>

#include "index/rank/ranker.h"
#include "index/store/catalogue.h"

namespace pliant {

// A picture that was replaced since it was ranked stands on the shelf in its new state, under the
// version that was ranked, so that no search misses it. Fetch: one thread. The rest: any, when no
// Fetch runs.
class PictureShelf {
 public:
  // New states that `admission` would not have admitted are left out. Both must outlive the shelf.
  PictureShelf(Catalogue* source, const Admission* admission, std::string model_id)
      : source_(*source), admission_(*admission), model_id_(std::move(model_id)) {}

  // Reads those that are not there yet, all at once.
  void Fetch(std::span<const RankedPicture> pictures, Load what);
  void DropFeatures();

  // nullptr, nullopt: the picture is gone.
  const ImageRecord* Record(std::int64_t version) const;
  std::optional<Features> LoadFeatures(std::int64_t version) const;

 private:
  Catalogue& source_;
  const Admission& admission_;
  std::string model_id_;
  std::unordered_map<std::int64_t, std::optional<StoredPicture>> pictures_;  // by ranked version
};

}  // namespace pliant
