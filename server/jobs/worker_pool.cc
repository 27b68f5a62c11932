// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/jobs/worker_pool.h"

#include <algorithm>
#include <cmath>
#include <exception>

#include "descriptor/base/parallel.h"
#include "server/http/problem.h"

namespace pliant::server {

namespace {

using Clock = std::chrono::steady_clock;

constexpr int kLongestRetryAfterS = 60;

}  // namespace

struct WorkerPool::Task {
  enum class State { kWaiting, kRunning, kDone, kDropped };
  const std::function<void(int)>* work = nullptr;
  State state = State::kWaiting;
  std::exception_ptr error;
  bool background = false;
};

WorkerPool::WorkerPool(WorkerPoolOptions options)
    : options_(options), cores_(ResolveThreads(options.cores)), free_cores_(cores_) {
  for (int i = 0; i < cores_; ++i) threads_.emplace_back([this] { Work(); });
}

WorkerPool::~WorkerPool() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
    for (Queue* waiting : {&searches_, &uploads_, &background_}) {
      for (const auto& task : *waiting) task->state = Task::State::kDropped;
      waiting->clear();
    }
  }
  work_changed_.notify_all();
  task_changed_.notify_all();
  for (std::thread& thread : threads_) thread.join();
  std::unique_lock lock(mutex_);
  task_changed_.wait(lock, [&] { return callers_ == 0; });
}

void WorkerPool::Run(Lane lane, const std::function<void(int cores)>& work) {
  const auto task = std::make_shared<Task>();
  task->work = &work;
  task->background = lane == Lane::kBackground;
  std::unique_lock lock(mutex_);
  if (stopping_) throw ProblemError("stopping", "The server is stopping.");
  if (!task->background && queue(lane).size() >= static_cast<std::size_t>(options_.queue_length)) {
    throw ProblemError("busy", "Too many requests are waiting. Try again shortly.",
                       {.retry_after_s = RetryAfterSeconds()});
  }
  queue(lane).push_back(task);
  ++callers_;
  work_changed_.notify_all();  // a borrower of cores may be waiting on it too
  const std::shared_ptr<void> leaving(nullptr, [this](void*) {  // with the lock
    if (--callers_ == 0 && stopping_) task_changed_.notify_all();
  });
  Await(lock, lane, task);
}

void WorkerPool::Await(std::unique_lock<std::mutex>& lock, Lane lane,
                       const std::shared_ptr<Task>& task) {
  const auto has_begun = [&] { return task->state != Task::State::kWaiting; };
  if (task->background) {
    task_changed_.wait(lock, has_begun);
  } else if (!task_changed_.wait_until(lock, Clock::now() + options_.queue_timeout, has_begun)) {
    std::erase(queue(lane), task);
    throw ProblemError("busy", "The request waited too long for a core. Try again shortly.",
                       {.retry_after_s = RetryAfterSeconds()});
  }
  task_changed_.wait(lock, [&] { return task->state != Task::State::kRunning; });
  if (task->state == Task::State::kDropped) {
    throw ProblemError("stopping", "The server is stopping.");
  }
  if (task->error) std::rethrow_exception(task->error);
}

void WorkerPool::Work() {
  std::unique_lock lock(mutex_);
  while (true) {
    work_changed_.wait(lock, [&] { return stopping_ || HasWork(); });
    if (stopping_) return;
    const std::shared_ptr<Task> task = TakeNext();
    const int cores = task->background ? 1 : ShareOfFreeCores();
    free_cores_ -= cores;
    background_cores_ += task->background ? 1 : 0;
    task->state = Task::State::kRunning;
    task_changed_.notify_all();

    lock.unlock();
    const Clock::time_point start = Clock::now();
    try {
      (*task->work)(cores);
    } catch (...) {
      task->error = std::current_exception();
    }
    const std::chrono::duration<double> seconds = Clock::now() - start;
    lock.lock();

    mean_task_s_ += (seconds.count() - mean_task_s_) / 16;
    free_cores_ += cores;
    background_cores_ -= task->background ? 1 : 0;
    task->state = Task::State::kDone;
    task_changed_.notify_all();
    work_changed_.notify_all();
  }
}

bool WorkerPool::HasWork() const {
  if (free_cores_ <= claimed_cores_) return false;
  return !searches_.empty() || !uploads_.empty() || MayRunBackground();
}

bool WorkerPool::MayRunBackground() const {
  return !background_.empty() && background_cores_ < std::max(1, cores_ / 2);
}

std::shared_ptr<WorkerPool::Task> WorkerPool::TakeNext() {
  const bool may_be_background = MayRunBackground();
  const bool others_wait = !searches_.empty() || !uploads_.empty();
  if (may_be_background && (!others_wait || others_in_a_row_ >= kOthersInARow)) {
    others_in_a_row_ = 0;
    const std::shared_ptr<Task> task = background_.front();
    background_.pop_front();
    return task;
  }
  if (may_be_background) ++others_in_a_row_;
  const bool uploads_turn = searches_in_a_row_ >= kSearchesInARow && !uploads_.empty();
  const bool search = !searches_.empty() && !uploads_turn;
  searches_in_a_row_ = search ? searches_in_a_row_ + 1 : 0;
  Queue& from = search ? searches_ : uploads_;
  const std::shared_ptr<Task> task = from.front();
  from.pop_front();
  return task;
}

int WorkerPool::ShareOfFreeCores() const {
  const auto others = static_cast<int>(searches_.size() + uploads_.size());
  return std::max(1, (free_cores_ - claimed_cores_) / (1 + others));
}

int WorkerPool::RetryAfterSeconds() const {
  const double waiting = static_cast<double>(searches_.size() + uploads_.size()) + 1;
  return std::clamp(static_cast<int>(std::ceil(waiting * mean_task_s_ / cores_)), 1,
                    kLongestRetryAfterS);
}

std::unique_ptr<WorkerPool::Lease> WorkerPool::BorrowCores(int wanted) {
  std::unique_lock lock(mutex_);
  // With a single core there is none to take away: the borrower runs beside the tasks.
  const int lend = std::clamp(wanted, 0, cores_ - 1 - lent_cores_);
  lent_cores_ += lend;
  claimed_cores_ += lend;
  work_changed_.wait(lock, [&] { return free_cores_ >= lend; });
  claimed_cores_ -= lend;
  free_cores_ -= lend;
  return std::make_unique<Lease>(*this, lend);
}

WorkerPool::Lease::~Lease() {
  {
    const std::lock_guard lock(pool_.mutex_);
    pool_.free_cores_ += cores_;
    pool_.lent_cores_ -= cores_;
  }
  pool_.work_changed_.notify_all();
}

WorkerPool::Load WorkerPool::load() const {
  const std::lock_guard lock(mutex_);
  return {searches_.size(), uploads_.size(), background_.size(), cores_ - free_cores_};
}

}  // namespace pliant::server
