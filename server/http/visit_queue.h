// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Threads that serve requests, and a bounded queue of those that wait for one.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include "server/http/reception.h"

namespace pliant::server {

// Thread-safe.
class VisitQueue {
 public:
  using Serve = std::function<void(std::unique_ptr<Visit>)>;

  VisitQueue(int threads, int limit, Serve serve);
  ~VisitQueue();  // serves what waits, then joins
  VisitQueue(const VisitQueue&) = delete;
  VisitQueue& operator=(const VisitQueue&) = delete;

  // Takes the visit; leaves it where it is and returns false when the queue is full, unless the
  // visit was `served_before`: how many of those there are is limited elsewhere.
  bool Offer(std::unique_ptr<Visit>& visit, bool served_before = false);

 private:
  void Run();

  const std::size_t limit_;
  const Serve serve_;
  std::mutex mutex_;  // guards queue_ and stopping_
  std::condition_variable wake_;
  std::deque<std::unique_ptr<Visit>> queue_;
  bool stopping_ = false;
  std::vector<std::thread> threads_;
};

}  // namespace pliant::server
