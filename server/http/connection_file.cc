// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Connection: answers whose body is a file, and requests whose body becomes one.
#include <algorithm>
#include <cstdint>
#include <exception>
#include <string>
#include <string_view>
#include <utility>

#include "server/http/connection.h"

namespace pliant::server {

namespace {

constexpr std::size_t kPiece = 64 * 1024;         // of a file, in memory for one client
constexpr std::size_t kMostAtOnce = 1024 * 1024;  // then other clients have their turn
// Of a body of chunks into a sink, which has a limit of its own: that numbers do not overflow.
constexpr std::uint64_t kMostChunked = std::uint64_t{1} << 50;

}  // namespace

void Connection::SendFile(std::shared_ptr<const BodyFile> file) {
  file_ = std::move(file);
  file_sent_ = 0;
  announced_ = file_->size();
}

// The library "writes" the file's bytes here without having them.
bool Connection::TakesAnnounced(std::size_t size) {
  if (announced_ == 0) return false;
  announced_ -= std::min<std::uint64_t>(announced_, size);
  return true;
}

bool Connection::Refill() {
  if (!file_) return false;
  if (file_sent_ >= file_->size()) {
    file_.reset();
    return false;
  }
  unsent_.resize(kPiece);
  const std::ptrdiff_t got = file_->Read(file_sent_, unsent_.data(), unsent_.size());
  unsent_.resize(got > 0 ? static_cast<std::size_t>(got) : 0);
  sent_ = 0;
  if (got <= 0) {  // the client was promised more
    over_ = true;
    file_.reset();
    return false;
  }
  file_sent_ += static_cast<std::uint64_t>(got);
  return true;
}

// After what is in memory. A piece at a time.
Connection::Step Connection::SendFileOn() {
  std::size_t sent_now = 0;
  while (Refill()) {
    while (sent_ < unsent_.size()) {
      const ssize_t sent = SendSome(std::string_view(unsent_).substr(sent_));
      if (sent < 0) return Step::kOver;
      if (sent == 0) return tls_ && !tls_->wants_output() ? Step::kWantsInput : Step::kWantsOutput;
      sent_ += static_cast<std::size_t>(sent);
      sent_now += static_cast<std::size_t>(sent);
    }
    unsent_.clear();
    sent_ = 0;
    if (file_ && sent_now >= kMostAtOnce) return Step::kWantsOutput;
  }
  unsent_.shrink_to_fit();
  return over_ ? Step::kOver : Step::kDone;
}

void Connection::ReceiveInto(std::shared_ptr<BodySink> sink) {
  sink_ = std::move(sink);
  chunks_ = ChunkedBody(kMostChunked);
}

Connection::Step Connection::PassOn() {
  if (fault_ != Fault::kNone) return Step::kDone;
  const std::string_view there = std::string_view(received_).substr(head_end_);
  std::size_t used = 0;
  std::string chunked;
  std::string_view content;
  auto state = ChunkedBody::State::kGoesOn;
  if (is_chunked()) {
    state = chunks_.Take(there, &used, &chunked);
    content = chunked;
  } else {
    used = std::min<std::uint64_t>(head_.length - body_bytes_, there.size());
    content = there.substr(0, used);
  }
  body_bytes_ += content.size();
  framing_bytes_ += used - content.size();
  if (state == ChunkedBody::State::kBroken) fault_ = Fault::kBadBody;
  if (state == ChunkedBody::State::kTooLarge ||
      framing_bytes_ > body_bytes_ + 2 * limits_.max_body_bytes) {
    fault_ = Fault::kBodyTooLarge;
  }
  if (fault_ != Fault::kNone) return Step::kDone;
  try {
    sink_->Append(content);
  } catch (...) {
    sink_error_ = std::current_exception();
    fault_ = Fault::kSink;
    return Step::kDone;
  }
  received_.erase(head_end_, used);  // what came after it stays
  end_ = head_end_;
  body_received_ = is_chunked() ? state == ChunkedBody::State::kEnded : body_bytes_ == head_.length;
  return body_received_ ? Step::kDone : Step::kWantsInput;
}

}  // namespace pliant::server
