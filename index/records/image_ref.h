// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// How a store names what it keeps, what a ranker knows of an image, and which images a search
// may answer with. Plain values.
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

// One state of one image. An image that is replaced keeps collection and id and gets a greater
// version; no two states of any images of a store share a version.
struct ImageRef {
  Key collection = 0;
  std::string id;
  std::int64_t version = 0;  // 0 = the present one, whichever that is
};

// What a ranker knows of an image. Whatever else a ranker needs of an image comes here, beside
// the words (codes of descriptors, for example): the change feed fills it, segments keep it.
struct IndexedImage {
  std::int64_t key = 0;     // ImageRef::version: unique, never used twice
  std::int64_t object = 0;  // 0 = no object
  std::string id;           // breaks ties of the score
  Bow bow;
};

// Which images of a collection a search may answer with. Data, not a function, so that it can
// travel to a ranker in another process.
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
