// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/sql/feature_cache.h"

#include <utility>

namespace pliant {

void FeatureCache::Follow(std::uint64_t epoch) {
  if (std::exchange(epoch_, epoch) == epoch) return;
  entries_.clear();
  positions_.clear();
  bytes_ = 0;
}

std::optional<std::vector<std::uint8_t>> FeatureCache::Find(Key image, std::uint64_t epoch) {
  const std::lock_guard lock(mutex_);
  Follow(epoch);
  const auto place = positions_.find(image);
  if (place == positions_.end()) return std::nullopt;
  entries_.splice(entries_.begin(), entries_, place->second);
  return place->second->encoded;
}

void FeatureCache::Add(Key image, std::vector<std::uint8_t> encoded, std::uint64_t epoch) {
  const std::lock_guard lock(mutex_);
  Follow(epoch);
  if (positions_.contains(image)) return;
  bytes_ += encoded.size();
  entries_.push_front({image, std::move(encoded)});
  positions_[image] = entries_.begin();
  while (bytes_ > max_bytes_) {
    bytes_ -= entries_.back().encoded.size();
    positions_.erase(entries_.back().image);
    entries_.pop_back();
  }
}

}  // namespace pliant
