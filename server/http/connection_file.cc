// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Connection: answers whose body is a file, and requests whose body becomes one.
#include <algorithm>
#include <string_view>
#include <utility>

#include "server/http/connection.h"

namespace pliant::server {

namespace {

constexpr std::size_t kPiece = 64 * 1024;         // of a file, in memory for one client
constexpr std::size_t kMostAtOnce = 1024 * 1024;  // then other clients have their turn

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

Connection::Step Connection::PassOn() {
  if (fault_ != Fault::kNone) return Step::kDone;
  const std::size_t there =
      std::min<std::uint64_t>(head_.length - body_bytes_, received_.size() - head_end_);
  try {
    sink_->Append(std::string_view(received_).substr(head_end_, there));
  } catch (...) {
    sink_error_ = std::current_exception();
    fault_ = Fault::kSink;
    return Step::kDone;
  }
  received_.erase(head_end_, there);  // what came after it stays
  end_ = head_end_;
  body_bytes_ += there;
  body_received_ = body_bytes_ == head_.length;
  return body_received_ ? Step::kDone : Step::kWantsInput;
}

}  // namespace pliant::server
