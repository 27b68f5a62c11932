// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Counts the values of some keys of metadata, in bounded memory. Not thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "index/records/listing.h"

namespace pliant {

// The facet of a key from all its values and their numbers of items. `without`: items without the
// key. `complete`: no value is missing.
Facet MakeFacet(const std::string& key, const std::map<FilterValue, std::uint64_t>& counts,
                std::uint64_t without, bool complete);
// One form for each number: 1.0 is 1, as in filters.
FilterValue CanonicalFacetValue(FilterValue value);

class FacetCount {
 public:
  // Limit of bytes of different values per key. Further values are not counted, and the facet is
  // incomplete.
  static constexpr std::size_t kMaxBytes = 1024 * 1024;

  explicit FacetCount(const std::vector<std::string>& keys);

  // Begins an item; for an object, the metadata of all its images follow. A value counts once per
  // item.
  void BeginItem();
  void Add(std::string_view metadata);  // the text of a JSON object

  // The most frequent first; equally frequent ones in order of kind and value.
  std::vector<Facet> Result();

 private:
  struct Counting {
    std::string key;
    std::map<FilterValue, std::uint64_t> counts;
    std::set<FilterValue> of_item;
    bool item_has_key = false;
    std::uint64_t items_with = 0;
    std::size_t bytes = 0;
    bool complete = true;
  };
  void EndItem();
  static void Note(Counting& counting, FilterValue value);

  std::vector<Counting> countings_;
  std::uint64_t items_ = 0;
  bool open_ = false;
};

}  // namespace pliant
