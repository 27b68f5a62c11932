// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/http/request_reader.h"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include "descriptor/base/format_bytes.h"

namespace pliant::server {

namespace {

constexpr std::size_t kMostFields = 100;
constexpr std::size_t kKeptBytes = 64 * 1024;  // of an empty buffer's memory
// Of a body of chunks into a sink, which has a limit of its own: that numbers do not overflow.
constexpr std::uint64_t kMostChunked = std::uint64_t{1} << 50;

// A line feed without the carriage return before it: the head may then have no end that counts.
bool HasBareLineFeed(std::string_view text, std::size_t from) {
  for (std::size_t at = text.find('\n', from); at != std::string_view::npos;
       at = text.find('\n', at + 1)) {
    if (at == 0 || text[at - 1] != '\r') return true;
  }
  return false;
}

}  // namespace

bool MemoryBudget::Take(std::size_t bytes) {
  if (used.fetch_add(bytes) + bytes <= most) return true;
  used -= bytes;
  return false;
}

bool RequestReader::Refuse(const ProblemError& problem) {
  refusal_ = problem.problem();
  return true;
}

bool RequestReader::ReadHead() {
  // Empty lines before a request are tolerated (RFC 9112, section 2.2).
  while (buffer_.compare(begin_, 2, "\r\n") == 0) begin_ += 2;
  const std::size_t end = EndOfHead(buffer_, std::max(searched_, begin_));
  const std::size_t known = std::min(end, buffer_.size());
  // Empty lines count, too: a client could send them for ever.
  if (known > max_header_bytes_) {
    return Refuse({"headers_too_large", "The headers are too large."});
  }
  const bool bare = HasBareLineFeed(std::string_view(buffer_).substr(0, known), searched_);
  searched_ = buffer_.size();
  if (end == std::string::npos && !bare) return false;
  head_ = ReadRequestHead(std::string_view(buffer_).substr(begin_, known - begin_));
  buffer_.erase(0, known);
  begin_ = searched_ = 0;
  framing_ = head_.framing;
  length_ = head_.length;
  chunks_ = ChunkedBody(max_body_bytes_);
  if (head_.fields.size() > kMostFields) {
    return Refuse(
        {"headers_too_large", fmt::format("There are more than {} header fields.", kMostFields)});
  }
  return head_.fault.empty() || Refuse({"bad_request", head_.fault});
}

void RequestReader::ReceiveInto(std::shared_ptr<BodySink> sink) {
  sink_ = std::move(sink);
  if (sink_) chunks_ = ChunkedBody(kMostChunked);
}

bool RequestReader::ReadBody() {
  if (refusal_ || body_ended_) return true;
  const auto refuse_size = [&] {
    return Refuse({"body_too_large",
                   fmt::format("A body can have {} at most.", FormatBytes(max_body_bytes_))});
  };
  if (!sink_ && length_ > max_body_bytes_) return refuse_size();
  std::size_t used = static_cast<std::size_t>(std::min<std::uint64_t>(body_left(), buffer_.size()));
  std::string_view content = std::string_view(buffer_).substr(0, used);
  auto state = ChunkedBody::State::kGoesOn;
  std::string chunked;
  if (framing_ == BodyFraming::kChunked) {
    state = chunks_.Take(buffer_, &used, &chunked);
    content = chunked;
  }
  body_bytes_ += content.size();
  framing_bytes_ += used - content.size();
  if (state == ChunkedBody::State::kBroken) {
    return Refuse({"bad_request", "The body is damaged or incomplete."});
  }
  if (state == ChunkedBody::State::kTooLarge ||
      framing_bytes_ > body_bytes_ + 2 * max_body_bytes_) {
    return refuse_size();
  }
  if (!PassOn(content)) return true;
  buffer_.erase(0, used);
  body_ended_ =
      framing_ == BodyFraming::kChunked ? state == ChunkedBody::State::kEnded : body_left() == 0;
  return body_ended_;
}

// False: refused.
bool RequestReader::PassOn(std::string_view content) {
  if (sink_) {
    try {
      sink_->Append(content);
    } catch (...) {
      refusal_ = CurrentProblem();
    }
    return !refusal_;
  }
  if (!budget_->Take(content.size())) {
    Refuse(
        ProblemError("busy", "Too many requests at the moment. Try again shortly.").RetryAfter(2));
    return false;
  }
  held_ += content.size();
  body_.append(content);
  return true;
}

void RequestReader::Forget() {
  if (buffer_.capacity() > buffer_.size() + kKeptBytes) buffer_.shrink_to_fit();
  budget_->Give(std::exchange(held_, 0));
  head_ = {};
  framing_ = BodyFraming::kNone;
  length_ = body_bytes_ = framing_bytes_ = 0;
  body_ended_ = false;
  body_ = {};
  sink_.reset();
  refusal_.reset();
}

}  // namespace pliant::server
