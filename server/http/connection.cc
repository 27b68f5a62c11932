// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/http/connection.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>

#include <netdb.h>
#include <poll.h>
#include <sys/socket.h>

#include "server/http/library.h"

namespace pliant::server {

namespace {

constexpr std::size_t kBufferBytes = 16 * 1024;
constexpr std::size_t kLingerBytes = 4 * 1024 * 1024;
constexpr std::chrono::milliseconds kLingerTime{1'000};
// What chunked encoding and part headers may add to the body itself.
constexpr std::size_t kFramingBytes = 64 * 1024;

int MillisecondsLeft(Clock::time_point deadline) {
  const auto left =
      std::chrono::duration_cast<std::chrono::milliseconds>(deadline - Clock::now()).count();
  return static_cast<int>(std::clamp<long long>(left, 0, 3'600'000));
}

// poll() that goes on after a signal. > 0 ready, 0 deadline passed, < 0 failed.
int PollUntil(pollfd* fds, nfds_t count, Clock::time_point deadline) {
  while (true) {
    const int ready = poll(fds, count, MillisecondsLeft(deadline));
    if (ready >= 0 || errno != EINTR) return ready;
  }
}

void NumericName(const sockaddr_storage& address, socklen_t length, std::string& ip, int& port) {
  std::array<char, NI_MAXHOST> host{};
  std::array<char, NI_MAXSERV> service{};
  if (getnameinfo(reinterpret_cast<const sockaddr*>(&address), length, host.data(), host.size(),
                  service.data(), service.size(), NI_NUMERICHOST | NI_NUMERICSERV) == 0) {
    ip = host.data();
    port = std::atoi(service.data());
  }
}

}  // namespace

Connection::Connection(int socket_fd, int wake_fd, const ConnectionLimits& limits,
                       std::unique_ptr<TlsSession> tls)
    : tls_(std::move(tls)),
      socket_fd_(socket_fd),
      wake_fd_(wake_fd),
      limits_(limits),
      buffer_(kBufferBytes) {}

bool Connection::Handshake() {
  return tls_ == nullptr || tls_->Handshake(Clock::now() + limits_.header_timeout);
}

bool Connection::AwaitRequest(std::chrono::milliseconds idle_timeout) {
  if (begin_ < end_ || (tls_ && tls_->HasPending())) return true;  // pipelined
  std::array<pollfd, 2> fds = {{{socket_fd_, POLLIN, 0}, {wake_fd_, POLLIN, 0}}};
  if (PollUntil(fds.data(), fds.size(), Clock::now() + idle_timeout) <= 0) return false;
  return fds[0].revents != 0;
}

void Connection::BeginHeaders() {
  in_body_ = false;
  answering_ = false;
  line_bytes_ = 0;
  header_bytes_ = 0;
  body_bytes_ = 0;
  fault_ = Fault::kNone;
  deadline_ = Clock::now() + limits_.header_timeout;
}

void Connection::BeginBody() {
  in_body_ = true;
  deadline_ = Clock::now() + limits_.body_timeout;
}

bool Connection::FillFromTls() {
  const ssize_t got = tls_->Read(buffer_.data(), buffer_.size(), deadline_);
  if (got <= 0) {
    fault_ = got == -2 ? Fault::kTimeout : Fault::kClosed;
    return false;
  }
  begin_ = 0;
  end_ = static_cast<std::size_t>(got);
  return true;
}

bool Connection::Fill() {
  if (tls_) return FillFromTls();
  pollfd fd = {socket_fd_, POLLIN, 0};
  const int ready = PollUntil(&fd, 1, deadline_);
  if (ready <= 0) {
    fault_ = ready == 0 ? Fault::kTimeout : Fault::kClosed;
    return false;
  }
  ssize_t got = 0;
  do {
    got = recv(socket_fd_, buffer_.data(), buffer_.size(), 0);
  } while (got < 0 && errno == EINTR);
  if (got <= 0) {
    fault_ = Fault::kClosed;
    return false;
  }
  begin_ = 0;
  end_ = static_cast<std::size_t>(got);
  return true;
}

ssize_t Connection::read(char* data, size_t size) {
  if (fault_ != Fault::kNone) return -1;
  // A drip of bytes keeps every single read short, so the deadline is checked here too.
  if (begin_ == end_ && (Clock::now() >= deadline_ ? (fault_ = Fault::kTimeout, true) : !Fill())) {
    return fault_ == Fault::kClosed ? 0 : -1;
  }
  const std::size_t count = std::min(size, end_ - begin_);
  if (in_body_) {
    body_bytes_ += count;
    if (body_bytes_ > limits_.max_body_bytes + kFramingBytes) fault_ = Fault::kBodyTooLarge;
  } else {
    header_bytes_ += count;
    if (header_bytes_ > limits_.max_header_bytes) fault_ = Fault::kHeadersTooLarge;
  }
  // The library reads lines, also those between chunks of a body, byte by byte.
  line_bytes_ = size == 1 && buffer_[begin_] != '\n' ? line_bytes_ + 1 : 0;
  if (line_bytes_ >= kMaxLineBytes) {
    fault_ = in_body_ ? Fault::kBodyTooLarge : Fault::kHeadersTooLarge;
  }
  if (fault_ != Fault::kNone) return -1;
  std::memcpy(data, buffer_.data() + begin_, count);
  begin_ += count;
  return static_cast<ssize_t>(count);
}

ssize_t Connection::write(const char* data, size_t size) {
  if (!answering_) {
    answering_ = true;
    answer_deadline_ = Clock::now() + limits_.answer_timeout;
  }
  const Clock::time_point deadline =
      std::min(answer_deadline_, Clock::now() + limits_.write_timeout);
  if (tls_) {
    const ssize_t sent = tls_->Write(data, size, deadline);
    return sent > 0 ? sent : -1;
  }
  pollfd fd = {socket_fd_, POLLOUT, 0};
  if (Clock::now() >= answer_deadline_ || PollUntil(&fd, 1, deadline) <= 0) return -1;
  ssize_t sent = 0;
  do {
    sent = send(socket_fd_, data, size, MSG_NOSIGNAL | MSG_DONTWAIT);
  } while (sent < 0 && errno == EINTR);
  if (sent < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) return 0;
  return sent;
}

bool Connection::is_readable() const { return begin_ < end_; }

bool Connection::is_writable() const { return true; }

void Connection::SendNow(const std::string& text) {
  if (tls_) {
    tls_->Write(text.data(), text.size(), Clock::now());
    return;
  }
  [[maybe_unused]] const ssize_t sent =
      send(socket_fd_, text.data(), text.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
}

void Connection::Farewell() {
  if (tls_) tls_->Close();
}

void Connection::LingeringClose() {
  Farewell();
  shutdown(socket_fd_, SHUT_WR);
  const Clock::time_point deadline = Clock::now() + kLingerTime;
  std::size_t swallowed = 0;
  pollfd fd = {socket_fd_, POLLIN, 0};
  while (swallowed < kLingerBytes && PollUntil(&fd, 1, deadline) > 0) {
    const ssize_t got = recv(socket_fd_, buffer_.data(), buffer_.size(), MSG_DONTWAIT);
    if (got == 0 || (got < 0 && errno != EINTR && errno != EAGAIN)) return;
    if (got > 0) swallowed += static_cast<std::size_t>(got);
  }
}

void Connection::get_remote_ip_and_port(std::string& ip, int& port) const {
  sockaddr_storage address{};
  socklen_t length = sizeof(address);
  if (getpeername(socket_fd_, reinterpret_cast<sockaddr*>(&address), &length) == 0) {
    NumericName(address, length, ip, port);
  }
}

void Connection::get_local_ip_and_port(std::string& ip, int& port) const {
  sockaddr_storage address{};
  socklen_t length = sizeof(address);
  if (getsockname(socket_fd_, reinterpret_cast<sockaddr*>(&address), &length) == 0) {
    NumericName(address, length, ip, port);
  }
}

}  // namespace pliant::server
