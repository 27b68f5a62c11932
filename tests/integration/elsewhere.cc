// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "tests/integration/elsewhere.h"

#include <chrono>
#include <stdexcept>
#include <utility>

#include <arpa/inet.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

namespace pliant::testing {

namespace {

constexpr int kLookMs = 50;

bool Readable(int fd) {
  pollfd waiting = {fd, POLLIN, 0};
  return poll(&waiting, 1, kLookMs) > 0;
}

}  // namespace

Elsewhere::Elsewhere(std::function<std::string(const std::string&)> answer)
    : answer_(std::move(answer)), listener_(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t length = sizeof(address);
  if (bind(listener_, reinterpret_cast<const sockaddr*>(&address), length) != 0 ||
      listen(listener_, 64) != 0 ||
      getsockname(listener_, reinterpret_cast<sockaddr*>(&address), &length) != 0) {
    throw std::runtime_error("there is no port for another server");
  }
  port_ = ntohs(address.sin_port);
  accepting_ = std::thread([this] { Accept(); });
}

Elsewhere::~Elsewhere() {
  ending_ = true;
  accepting_.join();
  for (std::thread& thread : threads_) thread.join();
  close(listener_);
}

void Elsewhere::Accept() {
  while (!ending_) {
    if (!Readable(listener_)) continue;
    const int fd = accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
    if (fd < 0) continue;
    ++connections_;
    threads_.emplace_back([this, fd] { Serve(fd); });
  }
}

void Elsewhere::Serve(int fd) {
  std::string head;
  while (!ending_ && head.find("\r\n\r\n") == std::string::npos) {
    if (!Readable(fd)) continue;
    char buffer[4096];
    const ssize_t got = recv(fd, buffer, sizeof(buffer), 0);
    if (got <= 0) break;
    head.append(buffer, static_cast<std::size_t>(got));
  }
  {
    const std::lock_guard lock(mutex_);
    heads_.push_back(head);
  }
  const std::string path = head.substr(head.find(' ') + 1);
  if (path.starts_with("/silent")) {
    while (!ending_ && !Readable(fd)) {
    }
  } else {
    Send(fd, answer_(head), path.starts_with("/drip"));
  }
  shutdown(fd, SHUT_WR);
  close(fd);
}

bool Elsewhere::Send(int fd, const std::string& bytes, bool drip) {
  std::size_t sent = 0;
  while (!ending_ && sent < bytes.size()) {
    const ssize_t n = send(fd, bytes.data() + sent, drip ? 1 : bytes.size() - sent, MSG_NOSIGNAL);
    if (n <= 0) return false;
    sent += static_cast<std::size_t>(n);
    if (drip) std::this_thread::sleep_for(std::chrono::milliseconds(kLookMs));
  }
  return true;
}

std::vector<std::string> Elsewhere::heads() const {
  const std::lock_guard lock(mutex_);
  return heads_;
}

std::string Elsewhere::Ok(const std::string& body, const std::string& more_headers) {
  return "HTTP/1.1 200 OK\r\nContent-Length: " + std::to_string(body.size()) + "\r\n" +
         more_headers + "\r\n" + body;
}

std::string Elsewhere::Redirect(const std::string& location, int status) {
  return "HTTP/1.1 " + std::to_string(status) + " Moved\r\nLocation: " + location +
         "\r\nContent-Length: 5\r\n\r\nmoved";
}

}  // namespace pliant::testing
