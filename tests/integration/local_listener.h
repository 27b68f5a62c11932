// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What servers of tests have in common: a free port of 127.0.0.1, and a thread for each connection.
#pragma once

#include <atomic>
#include <functional>
#include <thread>
#include <vector>

namespace pliant::testing {

class LocalListener {
 public:
  static constexpr int kLookMs = 20;  // between two looks whether the end has come

  // `serve` closes the connection; the first has number 1. Throws std::runtime_error.
  explicit LocalListener(std::function<void(int fd, int connection)> serve);
  // Waits for every connection's end: what `serve` uses must be there until then.
  ~LocalListener();
  LocalListener(const LocalListener&) = delete;
  LocalListener& operator=(const LocalListener&) = delete;

  int port() const { return port_; }
  int connections() const { return connections_; }  // so far
  bool ending() const { return ending_; }

  static bool Readable(int fd);  // within kLookMs

 private:
  void Accept();

  std::function<void(int, int)> serve_;
  int listener_ = -1;
  int port_ = 0;
  std::atomic<bool> ending_{false};
  std::atomic<int> connections_{0};
  std::vector<std::thread> threads_;  // the accepting one's until it has ended
  std::thread accepting_;
};

}  // namespace pliant::testing
