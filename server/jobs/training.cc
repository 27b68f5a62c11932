// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/jobs/training.h"

#include <exception>

#include <spdlog/spdlog.h>

#include "index/engine/training_policy.h"

namespace pliant::server {

namespace {

std::string VocabularyPath(const std::string& collection, std::int64_t id) {
  return "/v1/collections/" + collection + "/vocabularies/" + std::to_string(id);
}

Json Parameters(const TrainOptions& options, bool activate) {
  return {{"words", options.words},
          {"sample", options.sample},
          {"seed", options.seed},
          {"activate", activate},
          {"automatic", options.automatic}};
}

std::string Train(const JobStatus& job, const JobContext& context, Engine& engine,
                  WorkerPool& pool) {
  const Json& parameters = job.parameters;
  const bool automatic = parameters.value("automatic", false);
  if (automatic) {  // since it was queued, another server or a person may have trained one
    const CollectionRecord record = engine.GetCollection(job.collection);
    if (record.vocabulary && !AutomaticTrainingIsDue(record)) {
      return VocabularyPath(job.collection, record.vocabulary->id);
    }
  }
  const auto lease = pool.BorrowCores(pool.cores() / 2);
  TrainOptions options;
  options.collection = job.collection;
  options.words = parameters.at("words");
  options.sample = parameters.at("sample");
  options.seed = parameters.at("seed");
  options.threads = lease->threads();
  options.stop = context.stop;
  options.automatic = automatic;
  options.progress = [&](double done, double) { context.progress(done, 1); };
  const VocabularyRecord made = engine.TrainVocabulary(options);
  if (parameters.at("activate").get<bool>() && !made.active) {
    engine.UseVocabulary(options.collection, made.id,
                         {options.threads, {}, context.stop, options.automatic});
  }
  spdlog::info("vocabulary {} of '{}': {} words from {} of {} descriptors", made.id, job.collection,
               made.words, made.origin.sampled, made.origin.available);
  return VocabularyPath(job.collection, made.id);
}

std::string Activate(const JobStatus& job, const JobContext& context, Engine& engine,
                     WorkerPool& pool) {
  const auto lease = pool.BorrowCores(pool.cores() / 2);
  const std::int64_t id = job.parameters.at("vocabulary");
  engine.UseVocabulary(job.collection, id,
                       {lease->threads(), [&](double done) { context.progress(done, 1); },
                        context.stop, /*automatic=*/false});
  return VocabularyPath(job.collection, id);
}

}  // namespace

JobStatus AddTrainingJob(JobStore& jobs, const TrainOptions& options, bool activate) {
  return jobs.Add("train", options.collection, Parameters(options, activate));
}

JobStatus AddActivationJob(JobStore& jobs, const std::string& collection, std::int64_t vocabulary) {
  return jobs.Add("activate", collection, Json{{"vocabulary", vocabulary}});
}

void RegisterVocabularyJobs(JobRunner& runner, Engine& engine, WorkerPool& pool) {
  runner.Register("train", {[&](const JobStatus& job, const JobContext& context) {
                    return Train(job, context, engine, pool);
                  }});
  runner.Register("activate", {[&](const JobStatus& job, const JobContext& context) {
                    return Activate(job, context, engine, pool);
                  }});
}

AutoTrainer::AutoTrainer(Engine& engine, JobStore& jobs) : engine_(engine), jobs_(jobs) {
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

void AutoTrainer::Run() {
  std::unique_lock lock(mutex_);
  while (true) {
    wake_.wait(lock, [&] { return stopping_ || !added_.empty(); });
    if (stopping_) return;
    const auto next = std::min_element(added_.begin(), added_.end(), [](auto& a, auto& b) {
      return a.second.due() < b.second.due();
    });
    if (const Clock::time_point due = next->second.due(); due > Clock::now()) {
      wake_.wait_until(lock, due);  // the map may change during the wait
      continue;
    }
    const std::string collection = next->first;
    added_.erase(next);
    lock.unlock();
    try {
      TrainIfDue(collection);
    } catch (const std::exception& error) {
      spdlog::warn("automatic training of '{}' failed: {}", collection, error.what());
    }
    lock.lock();
  }
}

std::optional<JobStatus> AutoTrainer::TrainIfDue(const std::string& collection) {
  if (auto active = jobs_.Active("train", collection)) {
    OnAdded(collection);  // check again later: new images may call for the next training
    return active;
  }
  if (!AutomaticTrainingIsDue(engine_.GetCollection(collection))) return std::nullopt;
  TrainOptions options;
  options.collection = collection;
  options.seed = kSeed;
  options.automatic = true;
  if (auto added = jobs_.AddOnly("train", collection, Parameters(options, /*activate=*/true))) {
    return added;
  }
  OnAdded(collection);  // another server, or search, was faster
  return jobs_.Active("train", collection);
}

}  // namespace pliant::server
