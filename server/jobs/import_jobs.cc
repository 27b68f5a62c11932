// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/jobs/import_jobs.h"

#include <algorithm>
#include <thread>
#include <utility>

#include "descriptor/base/parallel.h"
#include "index/import/folder_import.h"
#include "index/json/record_json.h"
#include "server/http/parameters.h"
#include "server/http/problem.h"

namespace pliant::server {

namespace {

namespace fs = std::filesystem;

constexpr const char* kFolderKind = "import";
constexpr const char* kBulkKind = "bulk_import";
constexpr int kTriesWhenBusy = 30;
constexpr std::chrono::seconds kPauseWhenBusy{1};
constexpr int kItemsAtOnce = 500;  // read back from the store

ObjectFrom ObjectFromName(const std::string& name) {
  if (name == "folder") return ObjectFrom::kFolder;
  if (name == "stem") return ObjectFrom::kStem;
  return name == "none" ? ObjectFrom::kNone : ObjectFrom::kAuto;
}

// How many images an import has under way: the pool gives cores to some of them, and the others
// wait for the store meanwhile, which commits them together.
int ImportsAtOnce(const WorkerPool& pool) {
  constexpr int kEnoughToWait = 4;
  return std::max(kEnoughToWait, pool.cores() / 2);
}

[[noreturn]] void ThrowImportStopped() {
  throw Error(ErrorCode::kCancelled, "import_cancelled",
              "the import was stopped; the images added so far remain");
}

AddResult AddAndTell(const ImportServices& services, const JobStatus& job, AddRequest request,
                     const std::stop_token& stop) {
  AddResult added = AddInBackground(services.engine, services.pool, job, std::move(request), stop);
  if (added.outcome != AddOutcome::kUnchanged) services.on_added(job.collection);
  return added;
}

std::string ImportFolder(const ImportServices& services, const JobStatus& job,
                         const JobContext& context) {
  const fs::path folder =
      ResolveImportFolder(services.directory, job.parameters.at("folder").get<std::string>());
  const ImageFiles files =
      FindImages({folder}, ObjectFromName(job.parameters.at("object_from").get<std::string>()));
  context.system_files(files.system_files);
  FolderImportOptions how;
  how.collection = job.collection;
  how.threads = ImportsAtOnce(services.pool);
  how.max_bytes = services.max_bytes;
  how.root = fs::canonical(services.directory);
  how.stop = context.stop;
  how.progress = [&](std::uint64_t done, std::uint64_t total) {
    context.progress(static_cast<double>(done), static_cast<double>(total));
  };
  how.skipped = context.skipped;
  how.add = [&](const AddRequest& request) {
    return AddAndTell(services, job, request, context.stop);
  };
  if (ImportImages(services.engine, files, how).interrupted) ThrowImportStopped();
  return "/v1/collections/" + job.collection;
}

// The id of the job's file; empty = the database has the body.
std::string FileOf(const JobStatus& job) { return job.parameters.value("file", ""); }

struct Outcome {
  Json json;
  std::optional<SkippedFile> skipped;
};

SkippedFile SkippedOf(const std::string& name, const Json& problem) {
  return {name, problem.value("code", ""), problem.value("detail", "")};
}

struct BulkImport {
  const ImportServices& services;
  const JobStatus& job;
  const JobContext& context;

  void Run() {
    std::size_t done = ReadBack();
    std::shared_ptr<const std::string_view> file;
    std::optional<std::vector<std::uint8_t>> input;
    std::string_view body;
    if (!FileOf(job).empty()) {
      file = services.files.Open(FileOf(job));
      if (file) body = *file;
    } else {
      input = services.jobs.rows().JobInput(job.id);
      if (input) body = {reinterpret_cast<const char*>(input->data()), input->size()};
    }
    const Json& parameters = job.parameters;
    if (!file && !input) {
      if (done > 0 && done == parameters.value("items", std::size_t{0})) return;
      throw Error(ErrorCode::kConflict, "interrupted", "The import's data is gone. Send it again.");
    }
    const BulkItems items(
        body, parameters.at("type").get<std::string>(),
        {parameters.at("object").get<std::string>(), ToText(parameters.at("metadata")),
         parameters.at("object_from").get<std::string>(), services.files.max_item_bytes()});
    context.system_files(items.system_files());
    const auto at_once = static_cast<std::size_t>(ImportsAtOnce(services.pool));
    const auto progress = [&] {
      context.progress(static_cast<double>(done), static_cast<double>(items.size()));
    };
    for (progress(); done < items.size(); progress()) {
      if (context.stop.stop_requested()) ThrowImportStopped();
      const std::size_t count = std::min(at_once, items.size() - done);
      std::vector<Outcome> outcomes(count);
      ParallelFor(count, static_cast<int>(count),
                  [&](std::size_t i) { outcomes[i] = AddOne(items, done + i); });
      std::vector<std::string> texts;
      for (const Outcome& outcome : outcomes) texts.push_back(ToText(outcome.json));
      services.jobs.rows().AddJobItems(job.id, done, texts);
      for (const Outcome& outcome : outcomes) {
        if (outcome.skipped) context.skipped(*outcome.skipped);
      }
      done += count;
    }
  }

  // How many items have a result from an earlier attempt.
  std::size_t ReadBack() const {
    std::size_t done = 0;
    while (true) {
      const auto items = services.jobs.rows().JobItems(job.id, done, kItemsAtOnce);
      for (const std::string& text : items) {
        const Json item = Json::parse(text, nullptr, /*allow_exceptions=*/false);
        if (!item.is_object() || item.value("index", std::size_t{0}) != done) return done;
        if (const auto problem = item.find("problem"); problem != item.end()) {
          context.skipped(SkippedOf(item.value("source", ""), *problem));
        }
        ++done;
      }
      if (items.empty()) return done;
    }
  }

  void Fetch(BulkItem& item) const {
    FetchedImage fetched = services.fetcher.Fetch(*item.url, Fetcher::For::kJob,
                                                  [this] { return context.stop.stop_requested(); });
    item.request.bytes = *fetched.bytes;
    item.decoded = std::move(fetched.bytes);
    if (item.request.source.empty()) item.request.source = std::move(fetched.source);
  }

  Outcome AddOne(const BulkItems& items, std::size_t i) const {
    const std::string name = items.NameOf(i);
    Outcome outcome{{{"index", i}, {"source", name}}, std::nullopt};
    try {
      BulkItem item = items.Item(i);
      if (item.change) {
        const ImageRecord image =
            services.engine.Change(job.collection, item.request.id.value_or(""), *item.change);
        outcome.json.update({{"status", 200},
                             {"outcome", "changed"},
                             {"image_id", image.id},
                             {"object", image.object}});
        return outcome;
      }
      if (item.url) Fetch(item);
      const AddResult added = AddAndTell(services, job, item.request, context.stop);
      outcome.json["status"] = added.outcome == AddOutcome::kCreated ? 201 : 200;
      outcome.json["outcome"] = OutcomeName(added.outcome);
      outcome.json["image_id"] = added.image.id;
      outcome.json["object"] = added.image.object;
    } catch (...) {
      const Problem problem = CurrentProblem();
      if (problem.code == "stopping" && context.stop.stop_requested()) ThrowImportStopped();
      // These concern all images: the job begins again, or fails.
      if (problem.status >= 500 || problem.code == "collection_not_found") throw;
      Json json = {{"code", problem.code}, {"detail", problem.detail}};
      if (!problem.parameter.empty()) json["parameter"] = problem.parameter;
      outcome.skipped = SkippedOf(name, json);
      outcome.json["status"] = problem.status;
      outcome.json["problem"] = std::move(json);
    }
    return outcome;
  }
};

}  // namespace

fs::path ResolveImportFolder(const fs::path& directory, const std::string& name) {
  if (directory.empty()) {
    throw ProblemError("imports_off",
                       "Folder imports are off. Start the server with --import-dir DIR.");
  }
  const fs::path relative(name);
  if (name.empty() || name.find('\0') != std::string::npos || relative.is_absolute() ||
      std::find(relative.begin(), relative.end(), "..") != relative.end()) {
    ThrowInvalid(
        "folder",
        "folder must be a path inside the import directory, without \"..\". Use \".\" for all.");
  }
  std::error_code error;
  const fs::path root = fs::canonical(directory, error);
  if (error) {
    throw Error(ErrorCode::kInternal, "import_dir_missing",
                "--import-dir " + directory.string() + ": " + error.message());
  }
  const fs::path folder = fs::canonical(root / relative, error);
  if (error || !IsInside(root, folder) || !fs::is_directory(folder, error)) {
    ThrowInvalid("folder", "folder is not a folder inside the import directory.");
  }
  return folder;
}

JobStatus AddImportJob(JobStore& jobs, const CollectionRecord& collection,
                       const std::string& folder, const std::string& object_from) {
  return jobs.Add(kFolderKind, collection.name,
                  {{"folder", folder},
                   {"object_from", object_from},
                   {kCollectionCreated, collection.created_ms}});
}

JobStatus AddBulkImportJob(JobStore& jobs, const CollectionRecord& collection,
                           const Request& request, const BulkDefaults& defaults) {
  const std::string_view body = request.received ? request.received->All() : request.body;
  const BulkItems items(body, request.content_type, defaults);  // throws for a damaged body
  Json parameters = {{kCollectionCreated, collection.created_ms},
                     {"type", request.content_type},
                     {"items", items.size()},
                     {"object", defaults.object},
                     {"metadata", MetadataJson(defaults.metadata)},
                     {"object_from", defaults.object_from}};
  if (!request.received) {
    return jobs.Add(kBulkKind, collection.name, parameters,
                    std::span{reinterpret_cast<const std::uint8_t*>(body.data()), body.size()});
  }
  auto& upload = static_cast<BulkUpload&>(*request.received);
  parameters["file"] = upload.id();
  upload.Sync();
  const JobStatus job = jobs.Add(kBulkKind, collection.name, parameters);
  upload.Keep();
  return job;
}

void RemoveBodyOf(const JobStatus& job, const BulkFiles& files) {
  if (job.kind == kBulkKind) files.Remove(FileOf(job));
}

void RegisterImportJobs(JobRunner& runner, ImportServices services) {
  runner.Register(kFolderKind, {[services](const JobStatus& job, const JobContext& context) {
                    return ImportFolder(services, job, context);
                  }});
  runner.Register(kBulkKind, {[services](const JobStatus& job, const JobContext& context) {
                    BulkImport{services, job, context}.Run();
                    return "/v1/jobs/" + job.id + "/items";
                  }});
}

AddResult AddInBackground(Engine& engine, WorkerPool& pool, const JobStatus& job,
                          AddRequest request, const std::stop_token& stop) {
  request.collection = job.collection;
  request.collection_created_ms = job.parameters.value(kCollectionCreated, std::int64_t{0});
  for (int attempt = 1;; ++attempt) {
    try {
      std::function<AddResult()> write;
      pool.Run(WorkerPool::Lane::kBackground, [&](int cores) {
        if (stop.stop_requested()) ThrowImportStopped();
        request.threads = cores;
        write = engine.BeginAdd(request);
      });
      return write();
    } catch (const Error& error) {
      if (error.code() != ErrorCode::kUnavailable || attempt == kTriesWhenBusy ||
          stop.stop_requested()) {
        throw;
      }
      std::this_thread::sleep_for(kPauseWhenBusy);
    }
  }
}

}  // namespace pliant::server
