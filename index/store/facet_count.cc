// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/facet_count.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <nlohmann/json.hpp>

#include "index/records/filter_value.h"

namespace pliant {
namespace {

using Json = nlohmann::json;

constexpr std::size_t kEntryBytes = 64;  // of a map, about

std::size_t SizeOf(const FilterValue& value) {
  const auto* text = std::get_if<std::string>(&value);
  return kEntryBytes + (text == nullptr ? 0 : text->size());
}

}  // namespace

FilterValue CanonicalFacetValue(FilterValue value) {
  if (const auto* number = std::get_if<std::int64_t>(&value); number != nullptr && *number >= 0) {
    return static_cast<std::uint64_t>(*number);
  }
  const auto* real = std::get_if<double>(&value);
  if (real == nullptr || *real != std::trunc(*real)) return value;
  constexpr double kTwoTo63 = 9223372036854775808.0;
  if (*real >= 0 && *real < 2 * kTwoTo63) return static_cast<std::uint64_t>(*real);
  if (*real < 0 && *real >= -kTwoTo63) return static_cast<std::int64_t>(*real);
  return value;
}

Facet MakeFacet(const std::string& key, const std::map<FilterValue, std::uint64_t>& counts,
                std::uint64_t without, bool complete) {
  Facet facet;
  facet.key = key;
  facet.without = without;
  facet.complete = complete && counts.size() <= kFacetValues;
  for (const auto& [value, count] : counts) facet.values.push_back({value, count});
  std::stable_sort(facet.values.begin(), facet.values.end(),
                   [](const auto& a, const auto& b) { return a.count > b.count; });
  if (facet.values.size() > kFacetValues) facet.values.resize(kFacetValues);
  return facet;
}

FacetCount::FacetCount(const std::vector<std::string>& keys) {
  for (const std::string& key : keys) countings_.emplace_back().key = key;
}

void FacetCount::BeginItem() {
  EndItem();
  open_ = true;
  ++items_;
}

void FacetCount::EndItem() {
  if (!open_) return;
  for (Counting& counting : countings_) {
    for (const FilterValue& value : counting.of_item) ++counting.counts.at(value);
    counting.of_item.clear();
    if (counting.item_has_key) ++counting.items_with;
    counting.item_has_key = false;
  }
  open_ = false;
}

void FacetCount::Note(Counting& counting, FilterValue value) {
  value = CanonicalFacetValue(std::move(value));
  if (!counting.counts.contains(value)) {
    if (counting.bytes + SizeOf(value) > kMaxBytes) {
      counting.complete = false;
      return;
    }
    counting.bytes += SizeOf(value);
    counting.counts.emplace(value, 0);
  }
  counting.of_item.insert(std::move(value));
}

void FacetCount::Add(std::string_view metadata) {
  const Json json = Json::parse(metadata, nullptr, /*allow_exceptions=*/false);
  if (!json.is_object()) return;
  for (Counting& counting : countings_) {
    const auto found = json.find(counting.key);
    if (found == json.end()) continue;
    counting.item_has_key = true;
    if (auto value = FilterValueOf(*found)) Note(counting, *std::move(value));
    if (!found->is_array()) continue;
    for (const Json& entry : *found) {
      if (auto value = FilterValueOf(entry)) Note(counting, *std::move(value));
    }
  }
}

std::vector<Facet> FacetCount::Result() {
  EndItem();
  std::vector<Facet> facets;
  for (Counting& counting : countings_) {
    facets.push_back(
        MakeFacet(counting.key, counting.counts, items_ - counting.items_with, counting.complete));
  }
  return facets;
}

}  // namespace pliant
