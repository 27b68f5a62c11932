// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/http/connection.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <utility>

#include <fcntl.h>
#include <netdb.h>
#include <sys/socket.h>
#include <unistd.h>

#include "server/http/library.h"

namespace pliant::server {

namespace {

constexpr std::size_t kReceiveBytes = 64 * 1024;
constexpr std::size_t kAlwaysKeptBytes = 16 * 1024;  // of an answer: enough to say what is wrong
constexpr std::size_t kMostAtOnce = 1024 * 1024;     // of a body that goes elsewhere
constexpr std::size_t kMostSwallowedBytes = 4 * 1024 * 1024;
constexpr std::size_t kFramingBytes = 64 * 1024;  // that chunks may add, with a share

void NumericName(const sockaddr_storage& address, socklen_t length, std::string& ip, int& port) {
  std::array<char, NI_MAXHOST> host{};
  std::array<char, NI_MAXSERV> service{};
  if (getnameinfo(reinterpret_cast<const sockaddr*>(&address), length, host.data(), host.size(),
                  service.data(), service.size(), NI_NUMERICHOST | NI_NUMERICSERV) == 0) {
    ip = host.data();
    port = std::atoi(service.data());
  }
}

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

Connection::Connection(int socket_fd, const ConnectionLimits& limits, MemoryBudget* budget,
                       std::unique_ptr<TlsSession> tls)
    : tls_(std::move(tls)), socket_fd_(socket_fd), limits_(limits), budget_(budget) {
  fcntl(socket_fd, F_SETFL, fcntl(socket_fd, F_GETFL) | O_NONBLOCK);
  sockaddr_storage address{};
  socklen_t length = sizeof(address);
  if (getpeername(socket_fd_, reinterpret_cast<sockaddr*>(&address), &length) == 0) {
    NumericName(address, length, address_, port_);
  }
}

Connection::~Connection() {
  budget_->Give(held_);
  tls_.reset();
  close(socket_fd_);
}

Connection::Step Connection::Greet() {
  if (tls_ == nullptr) return Step::kDone;
  const ssize_t done = tls_->Handshake(Clock::now());
  if (done > 0) return Step::kDone;
  if (done != -2) return Step::kOver;
  return tls_->wants_output() ? Step::kWantsOutput : Step::kWantsInput;
}

Connection::Step Connection::Receive() {
  // Of the thread, so that a connection that waits has no buffer.
  thread_local std::array<char, kReceiveBytes> buffer;
  ssize_t got = 0;
  bool wait = false;
  if (tls_) {
    got = tls_->Read(buffer.data(), buffer.size(), Clock::now());
    wait = got == -2;
  } else {
    do {
      got = recv(socket_fd_, buffer.data(), buffer.size(), 0);
    } while (got < 0 && errno == EINTR);
    wait = got < 0 && (errno == EAGAIN || errno == EWOULDBLOCK);
  }
  if (got > 0) {
    received_.append(buffer.data(), static_cast<std::size_t>(got));
    return Step::kDone;
  }
  if (!wait) return Step::kOver;
  return tls_ && tls_->wants_output() ? Step::kWantsOutput : Step::kWantsInput;
}

Connection::Step Connection::ReceiveHead() {
  while (true) {
    // Empty lines before a request are tolerated (RFC 9112, section 2.2).
    while (received_.compare(begin_, 2, "\r\n") == 0) begin_ += 2;
    searched_ = std::max(searched_, begin_);
    const std::string_view received = received_;
    head_end_ = EndOfHead(received, searched_);
    const std::size_t known = std::min(head_end_, received.size());
    const std::size_t line = received.rfind('\n') + 1;  // 0 when there is none
    // Empty lines before it count, too: a client could send them for ever.
    if (known > limits_.max_header_bytes ||
        (head_end_ == std::string_view::npos &&
         received.size() - std::max(line, begin_) >= kMaxLineBytes)) {
      fault_ = Fault::kHeadersTooLarge;
      return Step::kDone;
    }
    if (HasBareLineFeed(received.substr(0, known), searched_)) head_end_ = known;
    if (head_end_ != std::string_view::npos) {
      head_ = ReadRequestHead(received.substr(begin_, head_end_ - begin_));
      if (!head_.fault.empty()) fault_ = Fault::kBadHead;
      HideRange(std::span(received_).subspan(begin_, head_end_ - begin_));
      end_ = head_end_;
      chunks_ = ChunkedBody(limits_.max_body_bytes);
      return Step::kDone;
    }
    searched_ = received.size();
    const Step step = Receive();
    if (step != Step::kDone) return step;
  }
}

Connection::Step Connection::ReceiveBody() {
  const std::size_t before = body_bytes_;
  while (true) {
    if (const Step step = JudgeBody(); step == Step::kDone) return step;
    if (sink_ && body_bytes_ - before >= kMostAtOnce) return Step::kWantsInput;
    if (const Step step = Receive(); step != Step::kDone) return step;
  }
}

// kDone: the body is there or refused.
Connection::Step Connection::JudgeBody() {
  if (sink_) return PassOn();
  const std::size_t there = received_.size() - head_end_;
  if (head_.framing == BodyFraming::kNone) {
    body_received_ = true;
  } else if (head_.framing == BodyFraming::kLength) {
    if (head_.length > limits_.max_body_bytes) {
      fault_ = Fault::kBodyTooLarge;
      return Step::kDone;
    }
    end_ = head_end_ + std::min<std::size_t>(head_.length, there);
    body_received_ = end_ - head_end_ == head_.length;
  } else {
    std::size_t used = 0;
    const auto state = chunks_.Take(std::string_view(received_).substr(end_), &used);
    end_ += used;
    body_received_ = state == ChunkedBody::State::kEnded;
    if (state == ChunkedBody::State::kBroken) fault_ = Fault::kBadBody;
    if (state == ChunkedBody::State::kTooLarge ||
        end_ - head_end_ > 2 * limits_.max_body_bytes + kFramingBytes) {
      fault_ = Fault::kBodyTooLarge;
    }
  }
  body_bytes_ = end_ - head_end_;
  if (fault_ == Fault::kNone) Hold(body_bytes_);
  return body_received_ || fault_ != Fault::kNone ? Step::kDone : Step::kWantsInput;
}

// Makes `bytes` the connection's share of the budget.
void Connection::Hold(std::size_t bytes) {
  if (bytes <= held_) return;
  if (budget_->Take(bytes - held_)) {
    held_ = bytes;
  } else {
    fault_ = Fault::kBusy;
  }
}

void Connection::Rewind() {
  read_ = begin_;
  drop_output_ = false;
}

void Connection::ForgetRequest() {
  received_.erase(0, std::min(end_, received_.size()));
  if (received_.capacity() > received_.size() + kReceiveBytes) received_.shrink_to_fit();
  begin_ = read_ = searched_ = head_end_ = end_ = 0;
  head_ = {};
  body_received_ = false;
  body_bytes_ = framing_bytes_ = 0;
  fault_ = Fault::kNone;
  sink_.reset();
  sink_error_ = nullptr;
  const std::size_t keep = unsent_.size() - sent_;
  if (held_ > keep) {
    budget_->Give(held_ - keep);
    held_ = keep;
  }
}

ssize_t Connection::read(char* data, size_t size) {
  const std::size_t count = std::min(size, std::max(end_, read_) - read_);
  std::memcpy(data, received_.data() + read_, count);
  read_ += count;
  return static_cast<ssize_t>(count);  // 0, as at the end of a connection, for more than there is
}

ssize_t Connection::SendSome(std::string_view bytes) {
  if (tls_) {
    const ssize_t sent = tls_->Write(bytes.data(), bytes.size(), Clock::now());
    return sent > 0 ? sent : sent == -2 ? 0 : -1;
  }
  ssize_t sent = 0;
  do {
    sent = send(socket_fd_, bytes.data(), bytes.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
  } while (sent < 0 && errno == EINTR);
  return sent < 0 && (errno == EAGAIN || errno == EWOULDBLOCK) ? 0 : sent;
}

ssize_t Connection::write(const char* data, size_t size) {
  if (drop_output_ || TakesAnnounced(size)) return static_cast<ssize_t>(size);
  std::string_view bytes(data, size);
  while (!over_ && unsent_.empty() && !bytes.empty()) {
    const ssize_t sent = SendSome(bytes);
    over_ = sent < 0;
    if (sent <= 0) break;
    bytes.remove_prefix(static_cast<std::size_t>(sent));
  }
  if (over_) return -1;
  if (bytes.empty()) return static_cast<ssize_t>(size);
  if (budget_->Take(bytes.size())) {
    held_ += bytes.size();
  } else if (unsent_.size() - sent_ + bytes.size() > kAlwaysKeptBytes) {
    over_ = true;  // waiting for this client would let all others wait
    return -1;
  }
  unsent_.append(bytes);
  return static_cast<ssize_t>(size);
}

Connection::Step Connection::Send() {
  while (sent_ < unsent_.size()) {
    const ssize_t sent = SendSome(std::string_view(unsent_).substr(sent_));
    if (sent < 0 || over_) return Step::kOver;
    if (sent == 0) {
      return tls_ && !tls_->wants_output() ? Step::kWantsInput : Step::kWantsOutput;
    }
    sent_ += static_cast<std::size_t>(sent);
  }
  unsent_.clear();
  unsent_.shrink_to_fit();
  sent_ = 0;
  if (held_ > body_bytes_) {
    budget_->Give(held_ - body_bytes_);
    held_ = body_bytes_;
  }
  return over_ ? Step::kOver : SendFileOn();
}

Connection::Step Connection::Swallow() {
  received_.clear();
  while (swallowed_ < kMostSwallowedBytes) {
    std::array<char, 16 * 1024> nothing;  // below TLS: nobody reads it
    const ssize_t got = recv(socket_fd_, nothing.data(), nothing.size(), MSG_DONTWAIT);
    if (got == 0) return Step::kOver;
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) {
      return errno == EAGAIN || errno == EWOULDBLOCK ? Step::kWantsInput : Step::kOver;
    }
    swallowed_ += static_cast<std::size_t>(got);
  }
  return Step::kOver;
}

void Connection::Farewell() {
  if (tls_) tls_->Close();
}

void Connection::EndSending() {
  Farewell();
  shutdown(socket_fd_, SHUT_WR);
}

void Connection::get_remote_ip_and_port(std::string& ip, int& port) const {
  ip = address_;
  port = port_;
}

void Connection::get_local_ip_and_port(std::string& ip, int& port) const {
  sockaddr_storage address{};
  socklen_t length = sizeof(address);
  if (getsockname(socket_fd_, reinterpret_cast<sockaddr*>(&address), &length) == 0) {
    NumericName(address, length, ip, port);
  }
}

}  // namespace pliant::server
