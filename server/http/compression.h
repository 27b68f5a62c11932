// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Answers compressed with gzip, if the client prefers that (RFC 9110, section 12.5).
#pragma once

#include <atomic>
#include <cstddef>
#include <map>
#include <string>
#include <string_view>

#include "server/http/message.h"

namespace pliant::server {

// The names that Accept or Accept-Encoding lists, in lower case, with their q-values in thousandths
// (RFC 9110, section 12.4.2). The first of equal names counts. Entries with a broken q-value or
// with other parameters are left out.
std::map<std::string, int> WeightsOf(std::string_view list);

// Whether gzip is listed, or covered by *, with at least the q-value of identity.
bool PrefersGzip(std::string_view accept_encoding);
// The end of a compressed answer's ETag.
inline constexpr std::string_view kGzipEtagEnd = "-gzip\"";

// Text and JSON; images are compressed already.
bool IsCompressible(std::string_view content_type);

// Compresses answers on the threads that made them. Short and very long answers stay as they are,
// and so do long ones when enough others are being compressed. Thread-safe.
class Compressor {
 public:
  static constexpr std::size_t kFewestBytes = 1024;
  static constexpr std::size_t kLongBytes = 256 * 1024;
  static constexpr std::size_t kMostBytes = std::size_t{64} * 1024 * 1024;

  explicit Compressor(int long_ones_at_once) : free_(long_ones_at_once) {}

  // Sets Vary, Content-Encoding, and a strong ETag of its own (RFC 9110, section 8.8.3.3).
  void Compress(const Request& request, Response& response);

 private:
  std::atomic<int> free_;
};

}  // namespace pliant::server
