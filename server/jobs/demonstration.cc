// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/jobs/demonstration.h"

#include <algorithm>
#include <utility>

#include "descriptor/base/error.h"
#include "server/jobs/import_job.h"
#include "server/web/web_assets.h"

namespace pliant::server {

namespace {

Bytes FlatJpeg(const DemonstrationObject& object) {
  const std::string path = std::string("/assets/demo/") + object.file + ".jpg";
  const auto assets = WebAssets();
  const auto asset = std::find_if(assets.begin(), assets.end(),
                                  [&](const WebAsset& one) { return one.path == path; });
  if (asset == assets.end()) throw Error(ErrorCode::kInternal, "no_such_asset", path);
  return {reinterpret_cast<const std::uint8_t*>(asset->data), asset->bytes};
}

void AddFlatImage(Engine& engine, const JobStatus& job, const DemonstrationObject& object,
                  int threads) {
  AddRequest request;
  KeepTo(job, request);
  request.id = object.id();
  request.object = object.name;
  request.metadata = std::string(R"({"made_of": ")") + object.made_of + "\"}";
  request.source = object.id() + ".jpg";
  request.bytes = FlatJpeg(object);
  request.threads = threads;
  engine.Add(request);
}

}  // namespace

bool HasDemonstration(Engine& engine, const std::string& collection) {
  engine.GetCollection(collection);
  for (const DemonstrationObject& object : kDemonstrationObjects) {
    try {
      engine.Get(collection, object.id());
      return true;
    } catch (const Error& error) {
      if (error.code() != ErrorCode::kNotFound) throw;
    }
  }
  return false;
}

JobStatus AddDemonstrationJob(Engine& engine, JobQueue& jobs, const std::string& collection) {
  // Before the job: the caller gets the error.
  const CollectionRecord record = engine.GetCollection(collection);
  return jobs.Add("demo", collection, {{kCollectionCreated, record.created_ms}});
}

void RegisterDemonstrationJob(JobQueue& jobs, Engine& engine, WorkerPool& pool,
                              std::function<void(const std::string& collection)> on_added) {
  jobs.Register("demo", {[&engine, &pool, on_added = std::move(on_added)](
                             const JobStatus& job, const JobContext& context) {
                  const auto lease = pool.BorrowCores(std::max(1, pool.cores() / 2));
                  double done = 0;
                  for (const DemonstrationObject& object : kDemonstrationObjects) {
                    if (context.stop().stop_requested()) {
                      throw Error(ErrorCode::kCancelled, "demonstration_stopped", "stopped");
                    }
                    AddFlatImage(engine, job, object, std::max(1, lease->cores()));
                    context.Progress(++done, kDemonstrationObjects.size());
                  }
                  on_added(job.collection);
                  return "/v1/collections/" + job.collection + "/demo";
                }});
}

}  // namespace pliant::server
