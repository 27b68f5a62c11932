// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/jobs/import_job.h"

#include <algorithm>
#include <thread>
#include <utility>

#include "index/import/folder_import.h"

namespace pliant::server {

namespace {

namespace fs = std::filesystem;

constexpr int kTriesWhenBusy = 30;
constexpr std::chrono::seconds kPauseWhenBusy{1};

[[noreturn]] void ThrowBadFolder(const std::string& why) {
  throw ProblemError("invalid_parameter", "folder " + why).Parameter("folder");
}

ObjectFrom ObjectFromName(const std::string& name) {
  if (name == "folder") return ObjectFrom::kFolder;
  if (name == "stem") return ObjectFrom::kStem;
  return name == "none" ? ObjectFrom::kNone : ObjectFrom::kAuto;
}

std::string Import(Engine& engine, WorkerPool& pool, const ImportOptions& options,
                   const JobStatus& job, const JobContext& context) {
  const fs::path folder =
      ResolveImportFolder(options.directory, job.parameters.at("folder").get<std::string>());
  const ImageFiles files =
      FindImages({folder}, ObjectFromName(job.parameters.at("object_from").get<std::string>()));
  FolderImportOptions how;
  how.collection = job.collection;
  how.threads = ImportsAtOnce(pool);
  how.max_bytes = options.max_bytes;
  how.root = fs::canonical(options.directory);
  how.stop = context.stop();
  how.progress = [&](std::uint64_t done, std::uint64_t total) {
    context.Progress(static_cast<double>(done), static_cast<double>(total));
  };
  how.skipped = [&](const SkippedFile& file) {
    context.Skipped({file.file, file.code, file.reason});
  };
  how.add = [&](AddRequest request) {
    KeepTo(job, request);
    AddResult added = AddPatiently(engine, pool, request, context.stop());
    if (added.outcome != AddOutcome::kUnchanged) options.on_added(job.collection);
    return added;
  };
  if (ImportImages(engine, files, how).interrupted) ThrowImportStopped();
  return "/v1/collections/" + job.collection;
}

}  // namespace

fs::path ResolveImportFolder(const fs::path& directory, const std::string& name) {
  if (directory.empty()) {
    throw ProblemError("imports_off",
                       "The operator has named no directory to import from (--import-dir).");
  }
  const fs::path relative(name);
  if (name.empty() || name.find('\0') != std::string::npos || relative.is_absolute() ||
      std::find(relative.begin(), relative.end(), "..") != relative.end()) {
    ThrowBadFolder(
        "must be a path inside the import directory, without \"..\"; \".\" is all of it.");
  }
  std::error_code error;
  const fs::path root = fs::canonical(directory, error);
  if (error) {
    throw Error(ErrorCode::kInternal, "import_dir_missing",
                "--import-dir " + directory.string() + ": " + error.message());
  }
  const fs::path folder = fs::canonical(root / relative, error);
  if (error || !IsInside(root, folder) || !fs::is_directory(folder, error)) {
    ThrowBadFolder("is no folder inside the import directory.");
  }
  return folder;
}

JobStatus AddImportJob(JobQueue& jobs, const CollectionRecord& collection,
                       const std::string& folder, const std::string& object_from) {
  return jobs.Add("import", collection.name,
                  {{"folder", folder},
                   {"object_from", object_from},
                   {kCollectionCreated, collection.created_ms}});
}

void KeepTo(const JobStatus& job, AddRequest& request) {
  request.collection = job.collection;
  request.collection_created_ms = job.parameters.value(kCollectionCreated, std::int64_t{0});
}

int ImportsAtOnce(const WorkerPool& pool) {
  constexpr int kEnoughToWait = 4;
  return std::max(kEnoughToWait, pool.cores() / 2);
}

void ThrowImportStopped() {
  throw Error(ErrorCode::kCancelled, "import_cancelled",
              "the import was stopped; what it has added stays");
}

AddResult AddPatiently(Engine& engine, WorkerPool& pool, const AddRequest& request,
                       const std::stop_token& stop) {
  for (int attempt = 1;; ++attempt) {
    try {
      std::function<AddResult()> write;
      pool.Run(WorkerPool::Lane::kBackground, [&](int cores) {
        if (stop.stop_requested()) ThrowImportStopped();
        AddRequest with_cores = request;
        with_cores.threads = cores;
        write = engine.BeginAdd(with_cores);
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

void RegisterImportJob(JobQueue& jobs, Engine& engine, WorkerPool& pool, ImportOptions options) {
  jobs.Register("import", {[&engine, &pool, options = std::move(options)](
                               const JobStatus& job, const JobContext& context) {
                  return Import(engine, pool, options, job, context);
                }});
}

}  // namespace pliant::server
