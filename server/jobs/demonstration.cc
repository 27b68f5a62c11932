// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/jobs/demonstration.h"

#include <algorithm>
#include <utility>

#include "descriptor/base/error.h"
#include "descriptor/image/image.h"
#include "descriptor/simulation/demonstration.h"
#include "server/jobs/import_job.h"

namespace pliant::server {

namespace {

constexpr int kJpegQuality = 90;

const std::vector<std::string>& Names() { return simulation::DemonstrationObjects(); }

void AddFlatPicture(Engine& engine, const JobStatus& job, std::size_t number, int threads) {
  const std::vector<std::uint8_t> jpeg =
      EncodeJpeg(simulation::PaintDemonstrationObject(number), kJpegQuality);
  AddRequest request;
  KeepTo(job, request);
  request.id = DemonstrationId(number);
  request.object = Names()[number];
  request.metadata = R"({"made_of": ")" + simulation::DemonstrationMaterial(number) + "\"}";
  request.source = *request.id + ".jpg";
  request.bytes = jpeg;
  request.threads = threads;
  engine.Add(request);
}

void CheckStop(const JobContext& context) {
  if (!context.stop().stop_requested()) return;
  throw Error(ErrorCode::kCancelled, "demonstration_stopped", "stopped");
}

}  // namespace

std::string DemonstrationId(std::size_t number) {
  std::string id = "demo-" + Names().at(number);
  std::replace(id.begin(), id.end(), ' ', '-');
  return id;
}

bool HasDemonstration(Engine& engine, const std::string& collection) {
  engine.GetCollection(collection);
  for (std::size_t number = 0; number < Names().size(); ++number) {
    try {
      engine.Get(collection, DemonstrationId(number));
      return true;
    } catch (const Error& error) {
      if (error.code() != ErrorCode::kNotFound) throw;
    }
  }
  return false;
}

CrumpledPictures::CrumpledPictures() {
  for (std::size_t i = 0; i < Names().size(); ++i) {
    pictures_.push_back(std::make_unique<Picture>());
  }
}

std::shared_ptr<const std::string> CrumpledPictures::Get(std::size_t number) {
  if (number >= pictures_.size()) return nullptr;
  Picture& picture = *pictures_[number];
  std::call_once(picture.once, [&] {
    const std::vector<std::uint8_t> jpeg =
        EncodeJpeg(simulation::CrumpleDemonstrationObject(number), kJpegQuality);
    picture.jpeg = std::make_shared<const std::string>(jpeg.begin(), jpeg.end());
  });
  return picture.jpeg;
}

JobStatus AddDemonstrationJob(Engine& engine, JobQueue& jobs, const std::string& collection) {
  // Before the job: the caller gets the error.
  const CollectionRecord record = engine.GetCollection(collection);
  return jobs.Add("demo", collection, {{kCollectionCreated, record.created_ms}});
}

void RegisterDemonstrationJob(JobQueue& jobs, Engine& engine, WorkerPool& pool,
                              CrumpledPictures& crumpled,
                              std::function<void(const std::string& collection)> on_added) {
  jobs.Register("demo", {[&engine, &pool, &crumpled, on_added = std::move(on_added)](
                             const JobStatus& job, const JobContext& context) {
                  const auto lease = pool.BorrowCores(std::max(1, pool.cores() / 2));
                  const std::size_t count = Names().size();
                  const auto total = static_cast<double>(2 * count);
                  for (std::size_t i = 0; i < count; ++i) {
                    CheckStop(context);
                    AddFlatPicture(engine, job, i, std::max(1, lease->cores()));
                    context.Progress(static_cast<double>(i + 1), total);
                  }
                  on_added(job.collection);
                  for (std::size_t i = 0; i < count; ++i) {
                    CheckStop(context);
                    crumpled.Get(i);
                    context.Progress(static_cast<double>(count + i + 1), total);
                  }
                  return "/v1/collections/" + job.collection + "/demo";
                }});
}

}  // namespace pliant::server
