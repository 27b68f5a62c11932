// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/jobs/auto_trainer.h"

#include <algorithm>
#include <exception>

#include <spdlog/spdlog.h>

#include "index/engine/training_policy.h"
#include "server/jobs/training_job.h"

namespace pliant::server {

AutoTrainer::AutoTrainer(Engine& engine, JobQueue& jobs) : engine_(engine), jobs_(jobs) {
  // What an earlier run of the server left undone.
  for (const std::string& collection : engine_.ListCollections()) OnAdded(collection);
  thread_ = std::thread([this] { Run(); });
}

AutoTrainer::~AutoTrainer() { Stop(); }

void AutoTrainer::Stop() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  wake_.notify_all();
  if (thread_.joinable()) thread_.join();
}

void AutoTrainer::OnAdded(const std::string& collection) {
  const Clock::time_point now = Clock::now();
  const std::lock_guard lock(mutex_);
  added_.try_emplace(collection, Added{now, now}).first->second.last = now;
  wake_.notify_all();
}

std::vector<std::string> AutoTrainer::TakeDue() {
  std::vector<std::string> due;
  for (auto it = added_.begin(); it != added_.end();) {
    if (it->second.due() > Clock::now()) {
      ++it;
      continue;
    }
    due.push_back(it->first);
    it = added_.erase(it);
  }
  return due;
}

void AutoTrainer::Run() {
  std::unique_lock lock(mutex_);
  while (true) {
    wake_.wait(lock, [&] { return stopping_ || !added_.empty(); });
    if (stopping_) return;
    const std::vector<std::string> due = TakeDue();
    if (due.empty()) {
      const auto next = std::min_element(added_.begin(), added_.end(), [](auto& a, auto& b) {
        return a.second.due() < b.second.due();
      });
      const Clock::time_point when = next->second.due();  // the map may change during the wait
      wake_.wait_until(lock, when);
      continue;
    }
    lock.unlock();
    for (const std::string& collection : due) {
      try {
        TrainIfDue(collection);
      } catch (const std::exception& error) {
        spdlog::warn("automatic training of '{}': {}", collection, error.what());
      }
    }
    lock.lock();
  }
}

std::optional<JobStatus> AutoTrainer::TrainIfDue(const std::string& collection) {
  const std::lock_guard lock(train_mutex_);
  jobs_.LookNow();  // another server may be at it
  if (auto active = jobs_.Active("train", collection)) {
    OnAdded(collection);  // look again later: what came meanwhile may call for the next one
    return active;
  }
  if (!AutomaticTrainingIsDue(engine_.GetCollection(collection))) return std::nullopt;
  TrainOptions options;
  options.collection = collection;
  options.seed = kSeed;
  options.automatic = true;
  if (auto added = AddAutomaticTrainingJob(jobs_, options)) return added;
  OnAdded(collection);  // another server was faster; its job is seen soon
  jobs_.LookNow();
  return jobs_.Active("train", collection);
}

}  // namespace pliant::server
