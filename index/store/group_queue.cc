// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/group_queue.h"

#include <algorithm>
#include <array>

namespace pliant {

std::size_t GroupQueue::NextBatch() const {
  if (!jobs_.empty() && jobs_.front()->alone) return 1;
  const auto end =
      std::find_if(jobs_.begin(), jobs_.end(), [](const Job* job) { return job->alone; });
  return std::min(static_cast<std::size_t>(end - jobs_.begin()), kMaxBatch);
}

void GroupQueue::Run(Job& job, const Execute& execute) {
  std::unique_lock lock(mutex_);
  jobs_.push_back(&job);
  while (!job.done) {
    changed_.wait(lock, [&] { return job.done || !busy_; });
    if (job.done) break;
    // Nothing throws before busy_ is false again, or everybody would wait for ever: `execute` keeps
    // what it catches.
    busy_ = true;
    std::array<Job*, kMaxBatch> jobs;
    const std::size_t count = NextBatch();
    std::copy_n(jobs_.begin(), count, jobs.begin());
    jobs_.erase(jobs_.begin(), jobs_.begin() + static_cast<std::ptrdiff_t>(count));
    const std::span<Job* const> batch = std::span(jobs).first(count);
    lock.unlock();
    execute(batch);
    lock.lock();
    for (Job* each : batch) each->done = true;
    busy_ = false;
    changed_.notify_all();
  }
  lock.unlock();
  if (job.failure) std::rethrow_exception(job.failure);
}

}  // namespace pliant
