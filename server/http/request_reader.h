// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The only reader of requests (RFC 9112): the bytes of a client become a head, then a body in
// memory or in a sink, within limits. It is strict. If a lenient reader skips something that a
// proxy in front understands (a field name with a space behind it, a folded line), the two disagree
// about where a request ends. Then the body of one is the next request of the other ("request
// smuggling"). Needs no socket.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "server/http/problem.h"

namespace pliant::server {

inline constexpr const char* kTooManyRequests =
    "Too many requests at the moment. Try again shortly.";

// Reads a head with its request line and its empty last line. Throws ProblemError "bad_request" for
// unknown methods and versions, lines that do not end in CRLF or are too long, control characters,
// folded fields, fields without a name that is a token (section 5.1), lengths that are no number or
// occur twice, a length beside chunks (section 6.3); "headers_too_large" for too many fields;
// "unsupported_transfer_encoding" for other than chunks. `head` then has what came before.
void ReadRequestHead(std::string_view text, Request& head);

// The number that the digits give, or the largest for more than 64 bits; nothing for other text.
std::optional<std::uint64_t> Digits(std::string_view text);

// Position behind the empty line that ends a head, searching from `from` on; npos when it is not
// there yet.
std::size_t EndOfHead(std::string_view received, std::size_t from);

// Follows a chunked body (section 7.1) to its end.
class ChunkedBody {
 public:
  enum class State { kGoesOn, kEnded, kBroken, kTooLarge };

  // `most_bytes`: of the content.
  explicit ChunkedBody(std::uint64_t most_bytes) : most_bytes_(most_bytes) {}

  // Takes the next bytes; `used` is set to the number of them that belong to the body. Adds their
  // content to `content` unless that is null.
  State Take(std::string_view bytes, std::size_t* used, std::string* content = nullptr);

 private:
  State TakeFraming(char c);

  std::uint64_t most_bytes_;
  std::uint64_t total_ = 0;  // of the chunks so far
  std::uint64_t left_ = 0;   // of this chunk
  bool is_last_ = false;     // this chunk
  // Of the line with its size, while that is read.
  std::size_t line_bytes_ = 0;
  bool in_extension_ = false;
  std::string_view line_end_ = {};  // to come next
};

// Bytes of all connections that are in memory at once: received bodies and unsent answers.
// Thread-safe.
struct MemoryBudget {
  std::size_t most = 0;
  std::atomic<std::size_t> used{0};

  bool Take(std::size_t bytes);  // false: above the limit, and none are taken
  void Give(std::size_t bytes) { used -= bytes; }
};

// Used by one thread at a time.
class RequestReader {
 public:
  RequestReader(std::size_t max_header_bytes, std::size_t max_body_bytes, MemoryBudget* budget)
      : max_header_bytes_(max_header_bytes), max_body_bytes_(max_body_bytes), budget_(budget) {}
  ~RequestReader() { Forget(); }
  RequestReader(const RequestReader&) = delete;
  RequestReader& operator=(const RequestReader&) = delete;

  void Append(std::string_view bytes) { buffer_.append(bytes); }
  bool HasBytes();  // of a request; skips empty lines before it, which are tolerated (section 2.2)

  // Each returns false when it needs more bytes. Throws ProblemError when the request is refused:
  // nothing more of it is read then.
  bool ReadHead();
  bool ReadBody();  // after ReadHead(); asked again, it returns the same

  const Request& head() const { return head_; }
  // The body goes there, whatever its length. Before the first ReadBody().
  void ReceiveInto(std::shared_ptr<BodySink> sink);
  bool has_sink() const { return sink_ != nullptr; }
  std::string TakeBody() { return std::move(body_); }
  std::uint64_t body_bytes() const { return body_bytes_; }  // of the content, so far
  // Bytes to come of a body that says its length; 0 for chunks.
  std::uint64_t body_left() const {
    return head_.framing == BodyFraming::kLength ? head_.length - body_bytes_ : 0;
  }

  // Ends this request. Bytes that came after it stay for the next one.
  void Forget();

 private:
  void PassOn(std::string_view content);

  const std::size_t max_header_bytes_;
  const std::size_t max_body_bytes_;
  MemoryBudget* budget_;
  std::size_t held_ = 0;  // of the budget

  std::string buffer_;        // received and not read
  std::size_t begin_ = 0;     // of the request's head
  std::size_t searched_ = 0;  // for the end of the head
  Request head_;
  ChunkedBody chunks_{0};
  bool body_ended_ = false;
  std::string body_;
  std::shared_ptr<BodySink> sink_;
  std::uint64_t body_bytes_ = 0;
  std::uint64_t framing_bytes_ = 0;  // of the chunks
};

}  // namespace pliant::server
