// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The one place that reads a request's head and the chunks of a body (RFC 9112). It is strict:
// where a lenient reader skips something (a field name with a space behind it, a folded line), a
// program in front can understand it, and then the two disagree about where a request ends, so that
// one's body is the other's next request ("request smuggling"). Pure functions.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "server/http/message.h"

namespace pliant::server {

enum class BodyFraming { kNone, kLength, kChunked, kUnknown };  // kUnknown: another encoding

struct RequestHead {
  std::string fault = {};  // why it is refused (400); empty = it is not
  std::string method = {};
  std::string target = {};
  bool is_http_1_0 = false;
  HeaderFields fields = {};  // without the spaces around their values
  BodyFraming framing = BodyFraming::kNone;
  std::uint64_t length = 0;  // of the body, for kLength; saturated
};

// Reads a head with its request line and its empty last line. Refuses: unknown methods and
// versions, lines that do not end in CRLF or are too long, control characters, folded fields,
// fields without a name that is a token (section 5.1), lengths that are no number or stand twice, a
// length beside chunks (section 6.3).
RequestHead ReadRequestHead(std::string_view head);

// Position behind the empty line that ends a head, searching from `from` on; npos when it is not
// there yet.
std::size_t EndOfHead(std::string_view received, std::size_t from);

// Follows a chunked body (RFC 9112, section 7.1) to its end.
class ChunkedBody {
 public:
  enum class State { kGoesOn, kEnded, kBroken, kTooLarge };

  // `most_bytes`: of the content.
  explicit ChunkedBody(std::uint64_t most_bytes) : most_bytes_(most_bytes) {}

  // Takes what was received next; `used` is set to the bytes of it that belong to the body. Their
  // content is added to `content`, unless that is null.
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

// A parameter of a field such as Content-Type, without its quotes; empty = there is none.
std::string FieldParameter(std::string_view field, std::string_view name);

}  // namespace pliant::server
