// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Strict reading of a request's head (RFC 9112), before the HTTP library sees it. The library is
// lenient: what it skips (a field name with a space behind it, a folded line) another program in
// front may understand, and then the two disagree about where a request ends, so that one's body is
// the other's next request ("request smuggling"). Pure functions.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace pliant::server {

enum class BodyFraming { kNone, kLength, kChunked };

struct RequestHead {
  std::string fault;  // why it is refused (400); empty = it is not
  BodyFraming framing = BodyFraming::kNone;
  std::uint64_t length = 0;  // of the body, for kLength; saturated
  std::string target;        // of the request line; empty when that is odd
};

// Reads a head with its request line and its empty last line. Refuses: lines that do not end in
// CRLF, control characters, folded fields, fields without a name that is a token (section 5.1),
// lengths that are no number or stand twice, a length beside chunks (section 6.3). Leaves all else
// to the library.
RequestHead ReadRequestHead(std::string_view head);

// The library answers 416 when it cannot read a Range, also one that is to be ignored (RFC 9110,
// section 14.2) or that only ends beyond every number. Gives the field a name that it does not
// know, in place.
inline constexpr const char* kHiddenRange = "rang~";
void HideRange(std::span<char> head);

// Position behind the empty line that ends a head, searching from `from` on; npos when it is not
// there yet.
std::size_t EndOfHead(std::string_view received, std::size_t from);

// Follows a chunked body (RFC 9112, section 7.1) to its end.
class ChunkedBody {
 public:
  enum class State { kGoesOn, kEnded, kBroken, kTooLarge };

  // `most_bytes`: of the content.
  explicit ChunkedBody(std::uint64_t most_bytes) : most_bytes_(most_bytes) {}

  // Takes what was received next; `used` is set to the bytes of it that belong to the body. What is
  // content of them is added to `content`, unless that is null.
  State Take(std::string_view bytes, std::size_t* used, std::string* content = nullptr);

 private:
  enum class Part { kSize, kExtension, kSizeEnd, kData, kDataCr, kDataLf, kLastCr, kLastLf };
  State TakeSize(char c);

  std::uint64_t most_bytes_;
  std::uint64_t total_ = 0;  // of the chunks so far
  std::uint64_t left_ = 0;   // of this chunk
  int digits_ = 0;
  std::size_t line_bytes_ = 0;
  Part part_ = Part::kSize;
};

}  // namespace pliant::server
