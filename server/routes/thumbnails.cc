// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/routes/thumbnails.h"

#include <vector>

namespace pliant::server {

namespace {

constexpr int kJpegQuality = 82;

}  // namespace

std::string MakeThumbnail(Bytes encoded, DecodeOptions options, const ImageDecoder& decode,
                          int longer_side_px) {
  options.max_side_px = longer_side_px;
  options.max_bytes = static_cast<std::int64_t>(encoded.size());
  options.colour = true;
  const std::vector<std::uint8_t> jpeg = EncodeJpeg(decode(encoded, options).image, kJpegQuality);
  return {jpeg.begin(), jpeg.end()};
}

std::shared_ptr<const std::string> ThumbnailCache::Find(const std::string& sha256) {
  const std::lock_guard lock(mutex_);
  const auto it = by_sha256_.find(sha256);
  if (it == by_sha256_.end()) return nullptr;
  entries_.splice(entries_.begin(), entries_, it->second);
  return it->second->jpeg;
}

void ThumbnailCache::Insert(const std::string& sha256, std::shared_ptr<const std::string> jpeg) {
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

}  // namespace pliant::server
