// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/clickhouse/request_watch.h"

#include <algorithm>
#include <utility>

namespace pliant::clickhouse {
namespace {

// A request that was ended between two of its steps begins the next one: it is ended again.
constexpr std::chrono::milliseconds kAgain{20};

}  // namespace

RequestWatch::RequestWatch() : thread_([this] { Run(); }) {}

RequestWatch::~RequestWatch() {
  {
    const std::lock_guard lock(mutex_);
    closing_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void RequestWatch::Hurry() {
  {
    const std::lock_guard lock(mutex_);
    hurry_ = true;
  }
  changed_.notify_all();
}

void RequestWatch::Run() {
  std::unique_lock lock(mutex_);
  while (!closing_) {
    const Clock::time_point now = Clock::now();
    Clock::time_point next = now + std::chrono::hours(1);
    for (const WatchedRequest& request : requests_) {
      if (request.deadline <= now || request.stop.stop_requested()) {
        request.end();
        next = std::min(next, now + kAgain);
      } else {
        next = std::min(next, request.deadline);
      }
    }
    hurry_ = false;
    changed_.wait_until(lock, next, [this] { return hurry_ || closing_; });
  }
}

RequestWatch::Guard::Guard(RequestWatch& watch, Clock::time_point deadline,
                           const std::stop_token& stop, std::function<void()> end)
    : watch_(watch),
      place_([&] {
        const std::lock_guard lock(watch.mutex_);
        watch.requests_.push_front({deadline, stop, std::move(end)});
        return watch.requests_.begin();
      }()),
      wake_(stop, Wake{&watch}) {
  watch_.Hurry();  // its deadline may be the next one
}

RequestWatch::Guard::~Guard() {
  const std::lock_guard lock(watch_.mutex_);
  watch_.requests_.erase(place_);
}

}  // namespace pliant::clickhouse
