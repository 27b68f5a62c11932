// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// JPEG previews with an in-memory cache.
#pragma once

#include <cstddef>
#include <list>
#include <memory>
#include <mutex>
#include <string>
#include <unordered_map>

#include "descriptor/image/image.h"

namespace pliant::server {

// Decodes, within the limits of `options` but for the file's length (it was accepted once), scales
// so that no side is longer, and encodes as a JPEG. Throws what `decode` throws.
inline constexpr int kThumbnailSidePx = 320;
inline constexpr int kPreviewSidePx = 1280;  // of a query
std::string MakeThumbnail(Bytes encoded, DecodeOptions options, const ImageDecoder& decode,
                          int longer_side_px = kThumbnailSidePx);

// Least recently used out first. Thread-safe.
class ThumbnailCache {
 public:
  explicit ThumbnailCache(std::size_t max_bytes = std::size_t{32} * 1024 * 1024)
      : max_bytes_(max_bytes) {}

  // Null if absent. `sha256` is that of the original.
  std::shared_ptr<const std::string> Find(const std::string& sha256);
  void Insert(const std::string& sha256, std::shared_ptr<const std::string> jpeg);

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
