// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Identifiers of stored records, a ranker's data of an image, and the images that a search admits.
// Plain values.
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "index/records/filter.h"
#include "vocab/quantizer.h"

namespace pliant {

// Of a collection, an object or a vocabulary; 0 = none.
using Key = std::int64_t;

// One state of one image. A replaced image keeps its collection and id and gets a greater version.
// A version identifies one state of one image in a store.
struct ImageRef {
  Key collection = 0;
  std::string id;
  std::int64_t version = 0;  // 0 = the present one
};

// A ranker's data of an image, except its words and codes. The change feed fills it, and segments
// keep it.
struct IndexedImage {
  std::int64_t key = 0;     // ImageRef::version: unique, never used twice
  std::int64_t object = 0;  // 0 = no object
  std::string id;           // breaks ties of the score
  Bow bow;
};

// The images of a collection that a search admits. Its keys can be sent to a ranker in another
// process.
struct Admission {
  // As requested.
  std::optional<std::string> object;  // only its images; "" = images without an object
  Filter filter;                      // on metadata
  std::vector<std::string> without;   // ids of excluded images

  // The same as keys of the store, for rankers that only have keys (Catalogue::Admit).
  bool nothing = false;           // no such object exists: admits no image
  std::optional<Key> object_key;  // 0 = images without an object
  std::shared_ptr<const std::vector<std::int64_t>> versions;  // ascending; nullptr = all
  std::vector<std::int64_t> without_versions;                 // ascending

  bool Admits(std::int64_t version, Key of_object) const {
    return !nothing && (!object_key || of_object == *object_key) &&
           (!versions || std::binary_search(versions->begin(), versions->end(), version)) &&
           !std::binary_search(without_versions.begin(), without_versions.end(), version);
  }
};

}  // namespace pliant
