// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/sql/feature_cache.h"

#include <utility>

namespace pliant {

void FeatureCache::Follow(std::uint64_t epoch) {
  if (std::exchange(epoch_, epoch) == epoch) return;
  entries_.clear();
  places_.clear();
  bytes_ = 0;
}

std::optional<std::vector<std::uint8_t>> FeatureCache::Find(Key picture, std::uint64_t epoch) {
  const std::lock_guard lock(mutex_);
  Follow(epoch);
  const auto place = places_.find(picture);
  if (place == places_.end()) return std::nullopt;
  entries_.splice(entries_.begin(), entries_, place->second);
  return place->second->encoded;
}

void FeatureCache::Add(Key picture, std::vector<std::uint8_t> encoded, std::uint64_t epoch) {
  const std::lock_guard lock(mutex_);
  Follow(epoch);
  if (places_.contains(picture)) return;
  bytes_ += encoded.size();
  entries_.push_front({picture, std::move(encoded)});
  places_[picture] = entries_.begin();
  while (bytes_ > max_bytes_) {
    bytes_ -= entries_.back().encoded.size();
    places_.erase(entries_.back().picture);
    entries_.pop_back();
  }
}

}  // namespace pliant
