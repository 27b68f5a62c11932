// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "tests/integration/odd_server.h"

#include <algorithm>
#include <cstdlib>
#include <utility>

#include <sys/socket.h>
#include <unistd.h>

namespace pliant::testing {
namespace {

using std::chrono::milliseconds;

std::size_t BodyBytes(const std::string& head) {
  const std::string name = "Content-Length: ";
  const std::size_t at = head.find(name);
  return at == std::string::npos ? 0 : std::strtoul(head.c_str() + at + name.size(), nullptr, 10);
}

}  // namespace

OddServer::OddServer(std::function<Answer(const Request&)> answer)
    : answer_(std::move(answer)),
      listener_([this](int fd, int connection) { Serve(fd, connection); }) {}

void OddServer::Serve(int fd, int connection) {
  std::string buffer;
  for (int number = 1; !hangs_up_; ++number) {
    Request request{.head = "", .body = "", .connection = connection, .number = number};
    if (!Read(fd, buffer, request)) break;
    {
      const std::lock_guard lock(mutex_);
      requests_.push_back(request);
    }
    const Answer answer = answer_(request);
    if (!Sleep(answer.before) || !Send(fd, answer)) break;
    if (answer.reset) {
      const linger now{1, 0};
      setsockopt(fd, SOL_SOCKET, SO_LINGER, &now, sizeof(now));
    }
    if (answer.close || answer.reset) break;
  }
  close(fd);
}

bool OddServer::Read(int fd, std::string& buffer, Request& request) {
  for (;;) {
    const std::size_t end = buffer.find("\r\n\r\n");
    if (end != std::string::npos) {
      request.head = buffer.substr(0, end + 4);
      const std::size_t bytes = BodyBytes(request.head);
      if (buffer.size() >= end + 4 + bytes) {
        request.body = buffer.substr(end + 4, bytes);
        buffer.erase(0, end + 4 + bytes);
        return true;
      }
    }
    while (!LocalListener::Readable(fd)) {
      if (listener_.ending() || hangs_up_) return false;
    }
    char piece[16384];
    const ssize_t got = recv(fd, piece, sizeof(piece), 0);
    if (got <= 0 || listener_.ending()) return false;
    buffer.append(piece, static_cast<std::size_t>(got));
  }
}

bool OddServer::Send(int fd, const Answer& answer) {
  const bool drips = answer.each_byte.count() > 0;
  for (std::size_t sent = 0; sent < answer.bytes.size();) {
    const std::size_t most = drips ? 1 : answer.bytes.size() - sent;
    const ssize_t n = send(fd, answer.bytes.data() + sent, most, MSG_NOSIGNAL);
    if (n <= 0 || !Sleep(answer.each_byte)) return false;
    sent += static_cast<std::size_t>(n);
  }
  return true;
}

bool OddServer::Sleep(milliseconds time) const {
  const auto until = std::chrono::steady_clock::now() + time;
  while (!listener_.ending() && std::chrono::steady_clock::now() < until) {
    std::this_thread::sleep_for(std::min(time, milliseconds(LocalListener::kLookMs)));
  }
  return !listener_.ending();
}

std::vector<OddServer::Request> OddServer::requests() const {
  const std::lock_guard lock(mutex_);
  return requests_;
}

OddServer::Answer OddServer::Ok(const std::string& body, const std::string& more_headers) {
  return Status("HTTP/1.1 200 OK", body, more_headers);
}

OddServer::Answer OddServer::Status(const std::string& line, const std::string& body,
                                    const std::string& more_headers) {
  Answer answer;
  answer.bytes = line + "\r\nContent-Length: " + std::to_string(body.size()) + "\r\n" +
                 more_headers + "\r\n" + body;
  return answer;
}

OddServer::Answer OddServer::Chunked(const std::string& body, std::size_t piece) {
  Answer answer;
  answer.bytes = "HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n";
  for (std::size_t at = 0; at < body.size(); at += piece) {
    const std::string part = body.substr(at, piece);
    char size[32];
    std::snprintf(size, sizeof(size), "%zx\r\n", part.size());
    answer.bytes += size + part + "\r\n";
  }
  answer.bytes += "0\r\n\r\n";
  return answer;
}

}  // namespace pliant::testing
