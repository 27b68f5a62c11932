// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// An HTTP server that keeps connections and does with each request what a test says, byte by byte.
#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <mutex>
#include <string>
#include <vector>

#include "tests/integration/local_listener.h"

namespace pliant::testing {

class OddServer {
 public:
  struct Request {
    std::string head;
    std::string body;
    int connection = 0;  // 1: the first of the server
    int number = 0;      // 1: the first of its connection
  };
  struct Answer {
    std::string bytes;
    bool close = false;                      // after them
    bool reset = false;                      // the same, without a good-bye
    std::chrono::milliseconds before{0};     // the first byte
    std::chrono::milliseconds each_byte{0};  // a byte at a time
  };

  // On a free port of 127.0.0.1. `answer` is called in several threads at once.
  explicit OddServer(std::function<Answer(const Request&)> answer);

  int port() const { return listener_.port(); }
  int connections() const { return listener_.connections(); }
  std::vector<Request> requests() const;
  // From now on, connections are closed in place of being read.
  void HangUp() { hangs_up_ = true; }

  static Answer Ok(const std::string& body, const std::string& more_headers = "");
  // Pieces of `piece` bytes.
  static Answer Chunked(const std::string& body, std::size_t piece);
  static Answer Status(const std::string& line, const std::string& body,
                       const std::string& more_headers = "");

 private:
  void Serve(int fd, int connection);
  bool Read(int fd, std::string& buffer, Request& request);
  bool Send(int fd, const Answer& answer);
  bool Sleep(std::chrono::milliseconds time) const;

  const std::function<Answer(const Request&)> answer_;
  std::atomic<bool> hangs_up_{false};
  mutable std::mutex mutex_;  // guards requests_
  std::vector<Request> requests_;
  LocalListener listener_;  // ends first
};

}  // namespace pliant::testing
