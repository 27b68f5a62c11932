// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Shares the cores: description and ranking run here, never on the threads that serve connections,
// so the processor is not oversubscribed by any number of clients.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

namespace pliant::server {

struct WorkerPoolOptions {
  int cores = 0;          // to use in all; 0 = those of the machine
  int queue_length = 64;  // tasks of one lane that may wait; more are refused
  std::chrono::milliseconds queue_timeout{30'000};  // longest wait for a turn
};

// Thread-safe.
class WorkerPool {
 public:
  // Searches have priority, but at most kSearchesInARow of them while uploads wait. Background
  // tasks run when neither waits, and after kOthersInARow of both, so that jobs progress on a busy
  // server. Each uses one core, all together half of the cores (at least one), so that a search
  // gets a core soon during long jobs.
  enum class Lane { kSearch, kUpload, kBackground };
  static constexpr int kSearchesInARow = 4;
  static constexpr int kOthersInARow = 16;

  explicit WorkerPool(WorkerPoolOptions options);
  ~WorkerPool();  // waits for running tasks and callers of Run(); waiting tasks get "stopping"
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;

  // Runs `task(cores)` and waits for its end. `cores` is how many it may use: all free ones if
  // nothing else waits, otherwise fewer. Throws what the task throws, and
  // ProblemError "busy" (with Retry-After) when the lane's queue is full or the wait timed out,
  // "stopping" during shutdown. Background tasks wait without a limit.
  void Run(Lane lane, const std::function<void(int cores)>& task);

  // Reserves cores for the lifetime of the lease; at least one is left to the tasks.
  class Lease {
   public:
    Lease(WorkerPool& pool, int cores) : pool_(pool), cores_(cores) {}
    ~Lease();
    Lease(const Lease&) = delete;
    Lease& operator=(const Lease&) = delete;
    int cores() const { return cores_; }
    int threads() const { return cores_ > 0 ? cores_ : 1; }  // for the borrower to use

   private:
    WorkerPool& pool_;
    int cores_;
  };
  std::unique_ptr<Lease> BorrowCores(int wanted);

  int cores() const { return cores_; }

  struct Load {
    std::size_t waiting_searches = 0;
    std::size_t waiting_uploads = 0;
    std::size_t waiting_background = 0;
    int busy_cores = 0;
  };
  Load load() const;

 private:
  struct Task;
  using Queue = std::deque<std::shared_ptr<Task>>;

  void Await(std::unique_lock<std::mutex>& lock, Lane lane, const std::shared_ptr<Task>& task);
  void Work();
  bool HasWork() const;              // that may run now; mutex_ held
  bool MayRunBackground() const;     // one waits, and a core is left for it; mutex_ held
  std::shared_ptr<Task> TakeNext();  // mutex_ held, HasWork()
  int ShareOfFreeCores() const;      // mutex_ held
  int RetryAfterSeconds() const;     // mutex_ held
  Queue& queue(Lane lane) {
    return lane == Lane::kSearch ? searches_ : lane == Lane::kUpload ? uploads_ : background_;
  }

  const WorkerPoolOptions options_;
  const int cores_;
  mutable std::mutex mutex_;  // guards all below
  std::condition_variable work_changed_;
  std::condition_variable task_changed_;
  Queue searches_;
  Queue uploads_;
  Queue background_;
  int background_cores_ = 0;  // in use by background tasks
  int free_cores_;
  int lent_cores_ = 0;     // to leases, also while they still wait for them
  int claimed_cores_ = 0;  // of these, not handed over yet: tasks leave them alone
  int searches_in_a_row_ = 0;
  int others_in_a_row_ = 0;   // searches and uploads begun while a background task might have been
  double mean_task_s_ = 0.5;  // running mean, for Retry-After
  int callers_ = 0;           // inside Run()
  bool stopping_ = false;
  std::vector<std::thread> threads_;
};

}  // namespace pliant::server
