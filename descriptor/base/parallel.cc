// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/base/parallel.h"

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <deque>
#include <exception>
#include <mutex>
#include <thread>

#include <pthread.h>

namespace pliant {
namespace {

// One call of ParallelForWorkers. Lives on its caller's stack.
struct Loop {
  const std::size_t n;
  const std::function<void(std::size_t, std::size_t)>& body;
  std::atomic<std::size_t> next{0};

  std::size_t joined = 0;   // helpers so far; guarded by the pool's mutex, as the next two
  std::size_t running = 0;  // helpers that have not left
  std::condition_variable left = {};

  std::mutex mutex = {};  // guards failure and failed_at
  std::exception_ptr failure = {};
  std::size_t failed_at = n;

  void Work(std::size_t worker) {
    for (std::size_t i = next++; i < n; i = next++) {
      try {
        body(i, worker);
      } catch (...) {
        const std::lock_guard lock(mutex);
        if (i < failed_at) {
          failed_at = i;
          failure = std::current_exception();
        }
        next = n;
      }
    }
  }
};

// The threads that all loops of the process share. They start when a loop finds too few idle ones,
// and wait for the next loop afterwards.
class Pool {
 public:
  // A caller waits only for helpers that have joined, never for ones to come: nested loops cannot
  // deadlock.
  void Run(Loop& loop, std::size_t helpers) {
    Invite(loop, helpers);
    loop.Work(0);
    std::unique_lock lock(mutex_);
    std::erase(invitations_, &loop);
    loop.left.wait(lock, [&] { return loop.running == 0; });
  }

 private:
  void Invite(Loop& loop, std::size_t helpers) {
    const std::lock_guard lock(mutex_);
    invitations_.insert(invitations_.end(), helpers, &loop);
    try {
      for (; idle_ < invitations_.size(); ++idle_) std::thread([this] { Serve(); }).detach();
    } catch (const std::exception&) {
      // The system has no more threads: the existing ones and the caller do all the work.
    }
    for (std::size_t i = 0; i < helpers; ++i) wake_.notify_one();
  }

  void Serve() {
    std::unique_lock lock(mutex_);
    while (true) {
      wake_.wait(lock, [&] { return !invitations_.empty(); });
      Loop& loop = *invitations_.front();
      invitations_.pop_front();
      --idle_;
      ++loop.running;
      const std::size_t worker = ++loop.joined;
      lock.unlock();
      loop.Work(worker);
      lock.lock();
      ++idle_;
      if (--loop.running == 0) loop.left.notify_one();  // under the lock: then the loop may go
    }
  }

  std::mutex mutex_;
  std::condition_variable wake_;
  std::deque<Loop*> invitations_;  // one for each helper that a loop still wants
  std::size_t idle_ = 0;           // threads that wait for an invitation
};

Pool* shared = nullptr;

// Never destroyed: idle threads outlive main.
Pool& SharedPool() {
  static const bool made = [] {
    shared = new Pool;
    // The child of a fork has none of the parent's threads, and perhaps a locked mutex.
    return ::pthread_atfork(nullptr, nullptr, [] { shared = new Pool; }) == 0;
  }();
  static_cast<void>(made);
  return *shared;
}

}  // namespace

int ResolveThreads(int threads) {
  if (threads > 0) return threads;
  return std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

std::size_t ParallelWorkers(std::size_t n, int threads) {
  return std::min<std::size_t>(n, static_cast<std::size_t>(ResolveThreads(threads)));
}

void ParallelFor(std::size_t n, int threads, const std::function<void(std::size_t)>& body) {
  ParallelForWorkers(n, threads, [&body](std::size_t i, std::size_t) { body(i); });
}

void ParallelForWorkers(std::size_t n, int threads,
                        const std::function<void(std::size_t, std::size_t)>& body) {
  const std::size_t workers = ParallelWorkers(n, threads);
  if (workers <= 1) {
    for (std::size_t i = 0; i < n; ++i) body(i, 0);
    return;
  }
  Loop loop{n, body};
  SharedPool().Run(loop, workers - 1);
  if (loop.failure) std::rethrow_exception(loop.failure);
}

}  // namespace pliant
