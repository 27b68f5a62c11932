// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Compressed answers: gzip and Brotli, as the client likes them (RFC 9110, section 12.5.3).
#pragma once

#include <atomic>
#include <cstddef>
#include <string>
#include <string_view>

#include "server/http/message.h"

namespace pliant::server {

enum class Coding { kIdentity, kGzip, kBrotli };

// "identity", "gzip", "br"
const char* CodingName(Coding coding);

// Of what a list of codings with q-values accepts, that with the highest q; of equals br, then
// gzip. What is not listed and not meant by * is taken as refused, but for identity, which is the
// last choice. Entries that are not well-formed are not looked at.
Coding ChooseCoding(std::string_view accept_encoding);

// Text and JSON; images are compressed already.
bool IsCompressible(std::string_view content_type);

// Empty where it cannot be done.
std::string Compressed(const std::string& body, Coding coding);

// Compresses answers on the threads that made them, within limits: short ones, and very long ones,
// are left as they are, and of long ones so many are compressed at once; the others go as they are.
// Thread-safe.
class Compressor {
 public:
  static constexpr std::size_t kFewestBytes = 1024;
  static constexpr std::size_t kLongBytes = 256 * 1024;
  static constexpr std::size_t kMostBytes = std::size_t{64} * 1024 * 1024;

  explicit Compressor(int long_ones_at_once) : free_(long_ones_at_once) {}

  // With Vary, Content-Encoding, and a strong ETag of its own (RFC 9110, section 8.8.3.3).
  void Compress(const Request& request, Response& response);

 private:
  std::atomic<int> free_;
};

}  // namespace pliant::server
