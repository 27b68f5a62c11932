// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Somebody else's server, which keeps pictures and behaves as it likes: it answers with what a test
// has written, byte by byte.
#pragma once

#include <atomic>
#include <functional>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

namespace pliant::testing {

class Elsewhere {
 public:
  // On a free port of 127.0.0.1. `answer(head)` gives all bytes that are sent for a request with
  // that head; then the connection is closed. A path that begins with /drip is answered with a byte
  // every 50 ms; /silent is not answered at all.
  explicit Elsewhere(std::function<std::string(const std::string& head)> answer);
  ~Elsewhere();
  Elsewhere(const Elsewhere&) = delete;
  Elsewhere& operator=(const Elsewhere&) = delete;

  int port() const { return port_; }
  std::string host() const { return "127.0.0.1:" + std::to_string(port_); }
  std::string url(const std::string& path) const { return "http://" + host() + path; }

  std::vector<std::string> heads() const;  // of all requests so far
  int connections() const { return connections_; }

  static std::string Ok(const std::string& body, const std::string& more_headers = "");
  static std::string Redirect(const std::string& location, int status = 302);

 private:
  void Accept();
  void Serve(int fd);
  bool Send(int fd, const std::string& bytes, bool drip);

  std::function<std::string(const std::string&)> answer_;
  int listener_ = -1;
  int port_ = 0;
  std::atomic<bool> ending_{false};
  std::atomic<int> connections_{0};
  mutable std::mutex mutex_;  // guards heads_
  std::vector<std::string> heads_;
  std::vector<std::thread> threads_;  // of connections; the accepting one's until it has ended
  std::thread accepting_;
};

}  // namespace pliant::testing
