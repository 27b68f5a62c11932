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

// The facet of a key that `without` items do not have, from all its values and how many items have
// each. `complete`: no value is missing among them.
Facet MakeFacet(const std::string& key, const std::map<FilterValue, std::uint64_t>& counts,
                std::uint64_t without, bool complete);
// One form for each number: 1.0 is 1, as filters have it.
FilterValue CanonicalFacetValue(FilterValue value);

class FacetCount {
 public:
  // Of one key so many bytes of different values are kept; what comes later is not counted, and the
  // facet is said to be incomplete.
  static constexpr std::size_t kMaxBytes = 1024 * 1024;

  explicit FacetCount(const std::vector<std::string>& keys);

  // What follows until the next call is of one item: of an object, the metadata of all its
  // images. A value counts once an item.
  void BeginItem();
  void Add(std::string_view metadata);  // the text of a JSON object

  // The most frequent first; as frequent ones in the order of their kinds and values.
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
