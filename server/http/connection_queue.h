// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Threads that serve connections, and a bounded queue of those that wait for one.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

#include "server/http/library.h"

namespace pliant::server {

// Owned and deleted by the HTTP library.
class ConnectionQueue final : public httplib::TaskQueue {
 public:
  // `waiting` is kept at the number of connections in the queue. When the queue is full, the task
  // runs on the caller's thread with Rejecting() true: it then answers 503 and nothing else.
  ConnectionQueue(int threads, int limit, std::atomic<int>& waiting);

  static bool Rejecting();

  Enqueued enqueue(std::function<void()> serve) override;
  void shutdown() override;  // serves what waits, then joins

 private:
  void Run();

  const std::size_t limit_;
  std::atomic<int>& waiting_;
  std::mutex mutex_;  // guards queue_ and stopping_
  std::condition_variable wake_;
  std::deque<std::function<void()>> queue_;
  bool stopping_ = false;
  std::vector<std::thread> threads_;
};

}  // namespace pliant::server
