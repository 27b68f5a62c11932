// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <list>
#include <map>
#include <memory>
#include <mutex>
#include <utility>

namespace pliant {

// Immutable values in memory, up to a sum of their sizes, which value.size() gives in bytes. Evicts
// the least recently used ones first. Thread-safe.
template <typename Key, typename Value>
class LruCache {
 public:
  using ValuePtr = std::shared_ptr<const Value>;

  explicit LruCache(std::size_t max_bytes) : max_bytes_(max_bytes) {}

  // Null if absent.
  ValuePtr Find(const Key& key) {
    const std::lock_guard lock(mutex_);
    const auto place = places_.find(key);
    if (place == places_.end()) return nullptr;
    entries_.splice(entries_.begin(), entries_, place->second);
    return place->second->second;
  }

  // Does not replace a value.
  void Add(const Key& key, ValuePtr value) {
    const std::lock_guard lock(mutex_);
    if (places_.contains(key)) return;
    bytes_ += value->size();
    entries_.emplace_front(key, std::move(value));
    places_[key] = entries_.begin();
    while (bytes_ > max_bytes_) {
      bytes_ -= entries_.back().second->size();
      places_.erase(entries_.back().first);
      entries_.pop_back();
    }
  }

 private:
  using Entries = std::list<std::pair<Key, ValuePtr>>;

  const std::size_t max_bytes_;
  std::mutex mutex_;  // guards all below
  std::size_t bytes_ = 0;
  Entries entries_;  // most recently used first
  std::map<Key, typename Entries::iterator> places_;
};

}  // namespace pliant
