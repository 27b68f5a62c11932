// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "tests/integration/elsewhere.h"

#include <chrono>
#include <thread>
#include <utility>

#include <sys/socket.h>
#include <unistd.h>

namespace pliant::testing {
namespace {

constexpr std::chrono::milliseconds kDrip{50};  // between two bytes

}  // namespace

Elsewhere::Elsewhere(std::function<std::string(const std::string&)> answer)
    : answer_(std::move(answer)), listener_([this](int fd, int) { Serve(fd); }) {}

void Elsewhere::Serve(int fd) {
  std::string head;
  while (!listener_.ending() && head.find("\r\n\r\n") == std::string::npos) {
    if (!LocalListener::Readable(fd)) continue;
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
    while (!listener_.ending() && !LocalListener::Readable(fd)) {
    }
  } else {
    Send(fd, answer_(head), path.starts_with("/drip"));
  }
  shutdown(fd, SHUT_WR);
  close(fd);
}

bool Elsewhere::Send(int fd, const std::string& bytes, bool drip) {
  std::size_t sent = 0;
  while (!listener_.ending() && sent < bytes.size()) {
    const ssize_t n = send(fd, bytes.data() + sent, drip ? 1 : bytes.size() - sent, MSG_NOSIGNAL);
    if (n <= 0) return false;
    sent += static_cast<std::size_t>(n);
    if (drip) std::this_thread::sleep_for(kDrip);
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
