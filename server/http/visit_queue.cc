// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/http/visit_queue.h"

#include <utility>

namespace pliant::server {

VisitQueue::VisitQueue(int threads, int limit, Serve serve)
    : limit_(static_cast<std::size_t>(limit)), serve_(std::move(serve)) {
  for (int i = 0; i < threads; ++i) threads_.emplace_back([this] { Run(); });
}

VisitQueue::~VisitQueue() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  wake_.notify_all();
  for (std::thread& thread : threads_) thread.join();
}

bool VisitQueue::Offer(std::unique_ptr<Visit>& visit, bool served_before) {
  const std::lock_guard lock(mutex_);
  if (queue_.size() >= limit_ && !served_before) return false;
  try {
    queue_.push_back(std::move(visit));
  } catch (const std::bad_alloc&) {
    return false;  // it is where it was
  }
  wake_.notify_one();
  return true;
}

void VisitQueue::Run() {
  while (true) {
    std::unique_ptr<Visit> visit;
    {
      std::unique_lock lock(mutex_);
      wake_.wait(lock, [&] { return stopping_ || !queue_.empty(); });
      if (queue_.empty()) return;
      visit = std::move(queue_.front());
      queue_.pop_front();
    }
    serve_(std::move(visit));
  }
}

}  // namespace pliant::server
