// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Vocabularies without being asked: someone who uploads a few images and searches expects an
// answer.
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
#include <vector>

#include "index/engine/engine.h"
#include "server/jobs/jobs.h"

namespace pliant::server {

// The policy, for each collection:
// - no vocabulary and at least one image: train, once uploads pause for kPause (at the latest
//   kLongestWait after the first), or at once when a search comes;
// - the active vocabulary is one of ours and outgrown (index/engine/training_policy.h): train again
// and switch. A vocabulary that somebody trained or chose by hand is left alone: the database
// remembers which (CollectionRecord::automatic).
class AutoTrainer {
 public:
  static constexpr std::uint64_t kSeed = 0x50'4c'49'41'4e'54;  // "PLIANT"
  static constexpr std::chrono::milliseconds kPause{1'000};
  static constexpr std::chrono::milliseconds kLongestWait{10'000};

  AutoTrainer(Engine& engine, JobQueue& jobs);
  ~AutoTrainer();
  AutoTrainer(const AutoTrainer&) = delete;
  AutoTrainer& operator=(const AutoTrainer&) = delete;

  // Makes no more jobs. Called by the destructor too.
  void Stop();

  void OnAdded(const std::string& collection);

  // The running or new training job of the collection; nothing when none is due. For a search that
  // found no vocabulary: then it is due as soon as there is an image. Throws Error kNotFound.
  std::optional<JobStatus> TrainIfDue(const std::string& collection);

 private:
  using Clock = std::chrono::steady_clock;
  struct Added {
    Clock::time_point first;  // since the last look
    Clock::time_point last;

    Clock::time_point due() const { return std::min(last + kPause, first + kLongestWait); }
  };

  void Run();
  // Takes what is due out of added_; mutex_ held.
  std::vector<std::string> TakeDue();

  Engine& engine_;
  JobQueue& jobs_;
  std::mutex train_mutex_;  // one decision at a time
  std::mutex mutex_;        // guards all below
  std::condition_variable wake_;
  std::map<std::string, Added> added_;  // by collection
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace pliant::server
