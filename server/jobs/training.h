// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The jobs that train and activate vocabularies, on request and without being asked: someone who
// uploads a few images and searches expects an answer.
#pragma once

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "index/engine/engine.h"
#include "server/jobs/job_runner.h"
#include "server/jobs/worker_pool.h"

namespace pliant::server {

// Queues the training of a vocabulary. `activate` = activate it when it is done.
JobStatus AddTrainingJob(JobStore& jobs, const TrainOptions& options, bool activate);
// Queues the switch to a vocabulary, which quantises the collection's images first.
JobStatus AddActivationJob(JobStore& jobs, const std::string& collection, std::int64_t vocabulary);

// Kinds "train" and "activate": both begin again after a restart, with the same result.
// Each takes half of the cores. `engine` and `pool` must outlive the runner.
void RegisterVocabularyJobs(JobRunner& runner, Engine& engine, WorkerPool& pool);

// The policy, for each collection:
// - no vocabulary and at least one image: train, once uploads pause for kPause (at the latest
//   kLongestWait after the first), or at once when a search comes;
// - the active vocabulary was trained automatically, and the collection has outgrown it
//   (index/engine/training_policy.h): train again and switch. A vocabulary that a person trained or
//   chose stays: the database remembers which (CollectionRecord::automatic).
class AutoTrainer {
 public:
  static constexpr std::uint64_t kSeed = 0x50'4c'49'41'4e'54;  // "PLIANT"
  static constexpr std::chrono::milliseconds kPause{1'000};
  static constexpr std::chrono::milliseconds kLongestWait{10'000};

  AutoTrainer(Engine& engine, JobStore& jobs);
  ~AutoTrainer();
  AutoTrainer(const AutoTrainer&) = delete;
  AutoTrainer& operator=(const AutoTrainer&) = delete;

  // Makes no more jobs. Called by the destructor too.
  void Stop();

  void OnAdded(const std::string& collection);

  // The running or new training job of the collection; nothing when none is due. For a search that
  // found no vocabulary: then training is due if there is an image. Throws Error kNotFound.
  std::optional<JobStatus> TrainIfDue(const std::string& collection);

 private:
  using Clock = std::chrono::steady_clock;
  struct Added {
    Clock::time_point first;  // since TrainIfDue() was called
    Clock::time_point last;

    Clock::time_point due() const { return std::min(last + kPause, first + kLongestWait); }
  };

  void Run();

  Engine& engine_;
  JobStore& jobs_;
  std::mutex mutex_;  // guards all below
  std::condition_variable wake_;
  std::map<std::string, Added> added_;  // by collection
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace pliant::server
