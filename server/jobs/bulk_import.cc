// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/jobs/bulk_import.h"

#include <algorithm>
#include <utility>

#include "descriptor/base/parallel.h"
#include "index/json/record_json.h"
#include "server/http/problem.h"
#include "server/jobs/import_job.h"

namespace pliant::server {

namespace {

constexpr const char* kKind = "bulk_import";
constexpr int kItemsAtOnce = 500;  // read back from the store

BulkDefaults DefaultsOf(const Json& parameters, std::size_t max_item_bytes) {
  return {parameters.at("object").get<std::string>(), ToText(parameters.at("metadata")),
          parameters.at("object_from").get<std::string>(), max_item_bytes};
}

Json ParametersOf(const CollectionRecord& collection, const BulkItems& items,
                  const std::string& type, const BulkDefaults& defaults) {
  return {{kCollectionCreated, collection.created_ms},
          {"type", type},
          {"items", items.size()},
          {"object", defaults.object},
          {"metadata", MetadataJson(defaults.metadata)},
          {"object_from", defaults.object_from}};
}

// The id of the job's file; empty = what it works on is in the store.
std::string FileOf(const JobStatus& job) { return job.parameters.value("file", ""); }

// Problems that concern the server, not the image: the job begins again, or fails as a whole.
bool ConcernsAll(const Problem& problem) { return problem.status >= 500; }

struct Outcome {
  Json json;
  std::optional<SkippedItem> skipped;
};

SkippedItem SkippedOf(const std::string& name, const Json& problem) {
  return {name, problem.value("code", ""), problem.value("detail", "")};
}

class BulkImport {
 public:
  BulkImport(JobQueue& jobs, Engine& engine, WorkerPool& pool, Fetcher& fetcher,
             const BulkFiles& files, const JobStatus& job, const JobContext& context,
             const std::function<void(const std::string&)>& on_added)
      : jobs_(jobs),
        engine_(engine),
        pool_(pool),
        fetcher_(fetcher),
        files_(files),
        job_(job),
        context_(context),
        on_added_(on_added) {}

  void Run() {
    std::size_t done = ReadBack();
    const std::unique_ptr<MappedFile> file =
        FileOf(job_).empty() ? nullptr : files_.Open(FileOf(job_));
    const auto input = FileOf(job_).empty() ? jobs_.store().JobInput(job_.id) : std::nullopt;
    if (!file && !input) {
      if (done > 0 && done == job_.parameters.value("items", std::size_t{0})) return;
      throw Error(ErrorCode::kConflict, "interrupted", "what was sent is no longer there");
    }
    const std::string_view body =
        file ? file->bytes()
             : std::string_view(reinterpret_cast<const char*>(input->data()), input->size());
    const BulkItems items(body, job_.parameters.at("type").get<std::string>(),
                          DefaultsOf(job_.parameters, files_.max_item_bytes()));
    context_.Progress(static_cast<double>(done), static_cast<double>(items.size()));
    const auto at_once = static_cast<std::size_t>(ImportsAtOnce(pool_));
    while (done < items.size()) {
      if (context_.stop().stop_requested()) ThrowImportStopped();
      const std::size_t count = std::min(at_once, items.size() - done);
      std::vector<Outcome> outcomes(count);
      ParallelFor(count, static_cast<int>(count),
                  [&](std::size_t i) { outcomes[i] = AddOne(items, done + i); });
      std::vector<std::string> texts;
      for (const Outcome& outcome : outcomes) texts.push_back(ToText(outcome.json));
      jobs_.store().AddJobItems(job_.id, done, texts);
      for (const Outcome& outcome : outcomes) {
        if (outcome.skipped) context_.Skipped(*outcome.skipped);
      }
      done += count;
      context_.Progress(static_cast<double>(done), static_cast<double>(items.size()));
    }
  }

 private:
  // How many items an earlier attempt has said something of.
  std::size_t ReadBack() {
    std::size_t done = 0;
    while (true) {
      const auto items = jobs_.store().JobItems(job_.id, done, kItemsAtOnce);
      for (const std::string& text : items) {
        const Json item = Json::parse(text, nullptr, /*allow_exceptions=*/false);
        if (!item.is_object() || item.value("index", std::size_t{0}) != done) return done;
        if (const auto problem = item.find("problem"); problem != item.end()) {
          context_.Skipped(SkippedOf(item.value("source", ""), *problem));
        }
        ++done;
      }
      if (items.empty()) return done;
    }
  }

  void Fetch(BulkItem& item) {
    const auto stop = [this] { return context_.stop().stop_requested(); };
    FetchedImage fetched = fetcher_.Fetch(*item.url, Fetcher::For::kJob, stop);
    item.request.bytes = *fetched.bytes;
    item.decoded = std::move(fetched.bytes);
    if (item.request.source.empty()) item.request.source = std::move(fetched.source);
  }

  Outcome AddOne(const BulkItems& items, std::size_t i) {
    const std::string name = items.NameOf(i);
    Outcome outcome{{{"index", i}, {"source", name}}, std::nullopt};
    try {
      BulkItem item = items.Item(i);
      if (item.url) Fetch(item);
      KeepTo(job_, item.request);
      const AddResult added = AddPatiently(engine_, pool_, item.request, context_.stop());
      if (added.outcome != AddOutcome::kUnchanged) on_added_(job_.collection);
      outcome.json["status"] = added.outcome == AddOutcome::kCreated ? 201 : 200;
      outcome.json["outcome"] = OutcomeName(added.outcome);
      outcome.json["image_id"] = added.image.id;
      outcome.json["object"] = added.image.object;
    } catch (...) {
      const Problem problem = CurrentProblem();
      if (problem.code == "stopping" && context_.stop().stop_requested()) ThrowImportStopped();
      if (ConcernsAll(problem)) throw;
      if (problem.code == "collection_not_found") throw;  // it was removed meanwhile
      Json json = {{"code", problem.code}, {"detail", problem.detail}};
      if (!problem.parameter.empty()) json["parameter"] = problem.parameter;
      outcome.skipped = SkippedOf(name, json);
      outcome.json["status"] = problem.status;
      outcome.json["problem"] = std::move(json);
    }
    return outcome;
  }

  JobQueue& jobs_;
  Engine& engine_;
  WorkerPool& pool_;
  Fetcher& fetcher_;
  const BulkFiles& files_;
  const JobStatus& job_;
  const JobContext& context_;
  const std::function<void(const std::string&)>& on_added_;
};

}  // namespace

JobStatus AddBulkImportJob(JobQueue& jobs, const CollectionRecord& collection,
                           const std::string& body, const std::string& type,
                           const BulkDefaults& defaults) {
  const BulkItems items(body, type, defaults);  // says now what is wrong with the whole
  return jobs.AddWithInput(kKind, collection.name, ParametersOf(collection, items, type, defaults),
                           {reinterpret_cast<const std::uint8_t*>(body.data()), body.size()});
}

JobStatus AddBulkImportJob(JobQueue& jobs, const CollectionRecord& collection, BulkUpload& body,
                           const std::string& type, const BulkDefaults& defaults) {
  const BulkItems items(body.All(), type, defaults);
  Json parameters = ParametersOf(collection, items, type, defaults);
  parameters["file"] = body.id();
  body.Sync();
  const JobStatus job = jobs.Add(kKind, collection.name, parameters);
  body.Keep();
  return job;
}

void RegisterBulkImportJob(JobQueue& jobs, Engine& engine, WorkerPool& pool, Fetcher& fetcher,
                           const BulkFiles& files,
                           std::function<void(const std::string& collection)> on_added) {
  JobKind kind;
  kind.run = [&jobs, &engine, &pool, &fetcher, &files, on_added = std::move(on_added)](
                 const JobStatus& job, const JobContext& context) {
    BulkImport(jobs, engine, pool, fetcher, files, job, context, on_added).Run();
    return "/v1/jobs/" + job.id + "/items";
  };
  kind.ended = [&files](const JobStatus& job) { files.Remove(FileOf(job)); };
  jobs.Register(kKind, std::move(kind));
}

}  // namespace pliant::server
