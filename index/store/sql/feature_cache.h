// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Candidate cache: encoded features of recently verified images, for databases on other machines.
// An image's key identifies one state of it, so that entries stay valid. Thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <list>
#include <mutex>
#include <optional>
#include <unordered_map>
#include <vector>

#include "index/records/image_ref.h"

namespace pliant {

class FeatureCache {
 public:
  explicit FeatureCache(std::size_t max_bytes) : max_bytes_(max_bytes) {}

  // `epoch`: a new value empties the cache, because a database that lost commits can give their
  // keys again.
  std::optional<std::vector<std::uint8_t>> Find(Key image, std::uint64_t epoch);
  void Add(Key image, std::vector<std::uint8_t> encoded, std::uint64_t epoch);

 private:
  struct Entry {
    Key image = 0;
    std::vector<std::uint8_t> encoded;
  };
  void Follow(std::uint64_t epoch);

  const std::size_t max_bytes_;
  std::mutex mutex_;  // guards what follows
  std::uint64_t epoch_ = 0;
  std::size_t bytes_ = 0;
  std::list<Entry> entries_;  // last used first
  std::unordered_map<Key, std::list<Entry>::iterator> positions_;
};

}  // namespace pliant
