// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Threads of the HTTP library, and a bounded queue of tasks that wait for one.
#pragma once

#include <atomic>
#include <cstddef>
#include <functional>
#include <utility>

#include <httplib.h>

namespace pliant::server {

// Thread-safe.
class Workers {
 public:
  Workers(int threads, int limit) : limit_(limit), pool_(static_cast<std::size_t>(threads)) {}
  ~Workers() { Finish(); }
  Workers(const Workers&) = delete;
  Workers& operator=(const Workers&) = delete;

  // False when the queue is full; with `past_limit` it takes the task although it is.
  bool Run(std::function<void()> task, bool past_limit = false) {
    if (++waiting_ > limit_ && !past_limit) {
      --waiting_;
      return false;
    }
    pool_.enqueue([this, task = std::move(task)] {
      --waiting_;
      task();
    });
    return true;
  }

  // Runs the tasks that wait, then ends the threads. From one thread.
  void Finish() {
    if (!std::exchange(finished_, true)) pool_.shutdown();
  }

 private:
  const int limit_;
  std::atomic<int> waiting_{0};
  bool finished_ = false;
  httplib::ThreadPool pool_;
};

}  // namespace pliant::server
