// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Somebody else's server, which keeps images and behaves as it likes: it answers with what a test
// has written, byte by byte.
#pragma once

#include <functional>
#include <mutex>
#include <string>
#include <vector>

#include "tests/integration/local_listener.h"

namespace pliant::testing {

class Elsewhere {
 public:
  // On a free port of 127.0.0.1. `answer(head)` gives all bytes that are sent for a request with
  // that head; then the connection is closed. A path that begins with /drip is answered with a byte
  // every 50 ms; /silent is not answered at all.
  explicit Elsewhere(std::function<std::string(const std::string& head)> answer);

  int port() const { return listener_.port(); }
  std::string host() const { return "127.0.0.1:" + std::to_string(port()); }
  std::string url(const std::string& path) const { return "http://" + host() + path; }

  std::vector<std::string> heads() const;  // of all requests so far
  int connections() const { return listener_.connections(); }

  static std::string Ok(const std::string& body, const std::string& more_headers = "");
  static std::string Redirect(const std::string& location, int status = 302);

 private:
  void Serve(int fd);
  bool Send(int fd, const std::string& bytes, bool drip);

  std::function<std::string(const std::string&)> answer_;
  mutable std::mutex mutex_;  // guards heads_
  std::vector<std::string> heads_;
  LocalListener listener_;  // ends first
};

}  // namespace pliant::testing
