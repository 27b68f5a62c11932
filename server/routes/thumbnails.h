// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <list>
#include <memory>
#include <mutex>
#include <string>
#include <unordered_map>

namespace pliant::server {

// JPEG previews in memory. Evicts the least recently used one first. Thread-safe.
class ThumbnailCache {
 public:
  explicit ThumbnailCache(std::size_t max_bytes = std::size_t{32} * 1024 * 1024)
      : max_bytes_(max_bytes) {}

  // Null if absent. `sha256` is that of the original.
  std::shared_ptr<const std::string> Find(const std::string& sha256) {
    const std::lock_guard lock(mutex_);
    const auto it = by_sha256_.find(sha256);
    if (it == by_sha256_.end()) return nullptr;
    entries_.splice(entries_.begin(), entries_, it->second);
    return it->second->jpeg;
  }

  void Insert(const std::string& sha256, std::shared_ptr<const std::string> jpeg) {
    const std::lock_guard lock(mutex_);
    if (by_sha256_.contains(sha256)) return;
    bytes_ += jpeg->size();
    entries_.push_front({sha256, std::move(jpeg)});
    by_sha256_[sha256] = entries_.begin();
    while (bytes_ > max_bytes_ && entries_.size() > 1) {
      bytes_ -= entries_.back().jpeg->size();
      by_sha256_.erase(entries_.back().sha256);
      entries_.pop_back();
    }
  }

 private:
  struct Entry {
    std::string sha256;
    std::shared_ptr<const std::string> jpeg;
  };

  const std::size_t max_bytes_;
  std::mutex mutex_;          // guards all below
  std::list<Entry> entries_;  // most recently used first
  std::unordered_map<std::string, std::list<Entry>::iterator> by_sha256_;
  std::size_t bytes_ = 0;
};

}  // namespace pliant::server
