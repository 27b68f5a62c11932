// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/jobs/demonstration.h"

#include <algorithm>

#include "descriptor/base/error.h"
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

AddRequest FlatImage(const DemonstrationObject& object) {
  AddRequest request;
  request.id = object.id();
  request.object = object.name;
  request.metadata = std::string(R"({"made_of": ")") + object.made_of + "\"}";
  request.source = object.id() + ".jpg";
  request.bytes = FlatJpeg(object);
  return request;
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

JobStatus AddDemonstrationJob(Engine& engine, JobStore& jobs, const std::string& collection) {
  return jobs.Add("demo", collection,
                  {{kCollectionCreated, engine.GetCollection(collection).created_ms}});
}

void RegisterDemonstrationJob(JobRunner& runner, ImportServices services) {
  runner.Register("demo", {[services](const JobStatus& job, const JobContext& context) {
                    double done = 0;
                    for (const DemonstrationObject& object : kDemonstrationObjects) {
                      AddInBackground(services.engine, services.pool, job, FlatImage(object),
                                      context.stop);
                      context.progress(++done, kDemonstrationObjects.size());
                    }
                    services.on_added(job.collection);
                    return "/v1/collections/" + job.collection + "/demo";
                  }});
}

}  // namespace pliant::server
