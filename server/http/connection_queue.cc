// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/http/connection_queue.h"

#include <utility>

namespace pliant::server {

namespace {

thread_local bool rejecting = false;

}  // namespace

bool ConnectionQueue::Rejecting() { return rejecting; }

ConnectionQueue::ConnectionQueue(int threads, int limit, std::atomic<int>& waiting)
    : limit_(static_cast<std::size_t>(limit)), waiting_(waiting) {
  for (int i = 0; i < threads; ++i) threads_.emplace_back([this] { Run(); });
}

Enqueued ConnectionQueue::enqueue(std::function<void()> serve) {
  {
    const std::lock_guard lock(mutex_);
    if (queue_.size() < limit_) {
      queue_.push_back(std::move(serve));
      waiting_ = static_cast<int>(queue_.size());
      wake_.notify_one();
      return Enqueued(true);
    }
  }
  rejecting = true;
  serve();
  rejecting = false;
  return Enqueued(true);
}

void ConnectionQueue::Run() {
  while (true) {
    std::function<void()> serve;
    {
      std::unique_lock lock(mutex_);
      wake_.wait(lock, [&] { return stopping_ || !queue_.empty(); });
      if (queue_.empty()) return;
      serve = std::move(queue_.front());
      queue_.pop_front();
      waiting_ = static_cast<int>(queue_.size());
    }
    serve();
  }
}

void ConnectionQueue::shutdown() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  wake_.notify_all();
  for (std::thread& thread : threads_) thread.join();
}

}  // namespace pliant::server
