// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The bytes that a client sends become requests: a head, then a body in memory or in a sink, within
// limits. Needs no socket.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "server/http/problem.h"
#include "server/http/request_head.h"

namespace pliant::server {

// Bytes of all connections that are in memory at once: bodies that were received, answers that
// were not taken. Thread-safe.
struct MemoryBudget {
  std::size_t most = 0;
  std::atomic<std::size_t> used{0};

  bool Take(std::size_t bytes);  // false: that would be too many, none are taken
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
  bool has_bytes() const { return begin_ < buffer_.size(); }  // of a request

  // Each returns false when more bytes are needed, and true when the part has arrived, or the
  // request is refused: then refusal() says why, and nothing more of it is read.
  bool ReadHead();
  bool ReadBody();  // after ReadHead(); asked again, it returns the same
  const std::optional<Problem>& refusal() const { return refusal_; }

  RequestHead TakeHead() { return std::move(head_); }
  // The body goes there, whatever its length. Before the first ReadBody().
  void ReceiveInto(std::shared_ptr<BodySink> sink);
  bool has_sink() const { return sink_ != nullptr; }
  std::string TakeBody() { return std::move(body_); }
  std::uint64_t body_bytes() const { return body_bytes_; }  // of the content, so far
  // Bytes to come of a body that says its length; 0 for chunks.
  std::uint64_t body_left() const {
    return framing_ == BodyFraming::kLength ? length_ - body_bytes_ : 0;
  }

  // The request is over: the next one is read. Bytes that came after it stay.
  void Forget();

 private:
  bool Refuse(const ProblemError& problem);
  bool PassOn(std::string_view content);

  const std::size_t max_header_bytes_;
  const std::size_t max_body_bytes_;
  MemoryBudget* budget_;
  std::size_t held_ = 0;  // of the budget

  std::string buffer_;        // received and not read
  std::size_t begin_ = 0;     // of the request's head
  std::size_t searched_ = 0;  // for the end of the head
  RequestHead head_;
  BodyFraming framing_ = BodyFraming::kNone;
  std::uint64_t length_ = 0;
  ChunkedBody chunks_{0};
  bool body_ended_ = false;
  std::string body_;
  std::shared_ptr<BodySink> sink_;
  std::uint64_t body_bytes_ = 0;
  std::uint64_t framing_bytes_ = 0;  // of the chunks
  std::optional<Problem> refusal_;
};

}  // namespace pliant::server
