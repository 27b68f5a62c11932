// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/jobs/training_job.h"

#include <algorithm>

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
  const auto lease = pool.BorrowCores(std::max(1, pool.cores() / 2));
  TrainOptions options;
  options.collection = job.collection;
  options.words = parameters.at("words");
  options.sample = parameters.at("sample");
  options.seed = parameters.at("seed");
  options.threads = std::max(1, lease->cores());
  options.stop = context.stop();
  options.automatic = automatic;
  options.progress = [&](double done, double) { context.Progress(done, 1); };
  const VocabularyRecord made = engine.TrainVocabulary(options);
  if (parameters.at("activate").get<bool>() && !made.active) {
    engine.UseVocabulary(options.collection, made.id,
                         {options.threads, {}, context.stop(), options.automatic});
  }
  spdlog::info("vocabulary {} of '{}': {} words from {} of {} descriptors", made.id, job.collection,
               made.words, made.origin.sampled, made.origin.available);
  return VocabularyPath(job.collection, made.id);
}

std::string Activate(const JobStatus& job, const JobContext& context, Engine& engine,
                     WorkerPool& pool) {
  const auto lease = pool.BorrowCores(std::max(1, pool.cores() / 2));
  const std::int64_t id = job.parameters.at("vocabulary");
  const UseOptions options{std::max(1, lease->cores()),
                           [&](double done) { context.Progress(done, 1); }, context.stop(),
                           /*automatic=*/false};
  engine.UseVocabulary(job.collection, id, options);
  return VocabularyPath(job.collection, id);
}

}  // namespace

JobStatus AddTrainingJob(JobQueue& jobs, const TrainOptions& options, bool activate) {
  return jobs.Add("train", options.collection, Parameters(options, activate));
}

std::optional<JobStatus> AddAutomaticTrainingJob(JobQueue& jobs, const TrainOptions& options) {
  return jobs.AddOnly("train", options.collection, Parameters(options, /*activate=*/true));
}

JobStatus AddActivationJob(JobQueue& jobs, const std::string& collection, std::int64_t vocabulary) {
  return jobs.Add("activate", collection, Json{{"vocabulary", vocabulary}});
}

void RegisterVocabularyJobs(JobQueue& jobs, Engine& engine, WorkerPool& pool) {
  jobs.Register("train", {[&](const JobStatus& job, const JobContext& context) {
                  return Train(job, context, engine, pool);
                }});
  jobs.Register("activate", {[&](const JobStatus& job, const JobContext& context) {
                  return Activate(job, context, engine, pool);
                }});
}

}  // namespace pliant::server
