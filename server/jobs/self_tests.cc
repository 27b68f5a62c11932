// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/jobs/self_tests.h"

#include <utility>

#include "descriptor/base/unix_time.h"
#include "index/selftest/self_test_json.h"

namespace pliant::server {

JobStatus AddSelfTestJob(JobStore& jobs, const SelfTestOptions& options) {
  return jobs.Add("selftest", options.collection,
                  Json{{"pictures", options.pictures},
                       {"false_alarms", options.false_alarms},
                       {"seed", options.seed}});
}

void RegisterSelfTestJob(JobRunner& runner, Engine& engine, WorkerPool& pool, ImageDecoder decode) {
  const auto run = [&engine, &pool, decode = std::move(decode)](const JobStatus& job,
                                                                const JobContext& context) {
    const auto lease = pool.BorrowCores(pool.cores() / 2);
    SelfTestOptions options;
    options.collection = job.collection;
    options.pictures = job.parameters.at("pictures");
    options.false_alarms = job.parameters.at("false_alarms");
    options.seed = job.parameters.at("seed");
    options.decode = decode;
    options.threads = lease->threads();
    options.stop = context.stop;
    options.progress = [&](std::uint64_t done, std::uint64_t total) {
      context.progress(static_cast<double>(done), static_cast<double>(total));
    };
    Json report = SelfTestJson(RunSelfTest(engine, options), options, /*examples=*/true);
    report["made_at"] = IsoTime(NowMs());
    engine.ChangeCollection(job.collection, {.self_test = ToText(report)});
    return "/v1/collections/" + job.collection + "/selftest";
  };
  runner.Register("selftest", {run});
}

}  // namespace pliant::server
