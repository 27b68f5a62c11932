// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/jobs/import_job.h"

#include <algorithm>
#include <atomic>
#include <thread>

#include "descriptor/base/parallel.h"
#include "index/files/text.h"
#include "server/http/json.h"

namespace pliant::server {

namespace {

namespace fs = std::filesystem;

constexpr int kTriesWhenBusy = 30;
constexpr std::chrono::seconds kPauseWhenBusy{1};

[[noreturn]] void ThrowBadFolder(const std::string& why) {
  throw ProblemError("invalid_parameter", "folder " + why).Parameter("folder");
}

bool IsInside(const fs::path& directory, const fs::path& path) {
  return std::mismatch(directory.begin(), directory.end(), path.begin(), path.end()).first ==
         directory.end();
}

ObjectFrom ObjectFromName(const std::string& name) {
  if (name == "folder") return ObjectFrom::kFolder;
  if (name == "stem") return ObjectFrom::kStem;
  return name == "none" ? ObjectFrom::kNone : ObjectFrom::kAuto;
}

class Import {
 public:
  Import(Engine& engine, WorkerPool& pool, const ImportOptions& options, const JobStatus& job,
         const JobContext& context)
      : engine_(engine), pool_(pool), options_(options), job_(job), context_(context) {}

  std::string Run() {
    const Json parameters = Json::parse(job_.parameters);
    root_ = fs::canonical(options_.directory);
    const fs::path folder =
        ResolveImportFolder(options_.directory, parameters.at("folder").get<std::string>());
    PictureFiles found =
        FindPictures({folder}, ObjectFromName(parameters.at("object_from").get<std::string>()));
    for (const SkippedFile& skipped : found.skipped) {
      context_.Skipped({NameOf(skipped.file), skipped.code, skipped.reason});
    }
    files_ = std::move(found.pictures);
    context_.Progress(0, static_cast<double>(files_.size()));
    ParallelFor(files_.size(), std::max(1, pool_.cores() / 2), [this](std::size_t i) {
      if (context_.stop().stop_requested()) return;
      AddOne(files_[i]);
      context_.Progress(static_cast<double>(++done_), static_cast<double>(files_.size()));
    });
    if (done_ < files_.size()) {
      throw Error(ErrorCode::kCancelled, "import_cancelled",
                  "the import was stopped; what it has added stays");
    }
    return "/v1/collections/" + job_.collection;
  }

 private:
  // For people: below the import directory.
  std::string NameOf(const fs::path& path) const {
    return ToDisplayText(path.lexically_relative(root_).string());
  }

  void AddOne(const PictureFile& file) {
    try {
      std::error_code error;
      if (!IsInside(root_, fs::canonical(file.path, error)) || error) {
        context_.Skipped({NameOf(file.path), "outside", "it leads out of the import directory"});
        return;
      }
      std::vector<std::uint8_t> bytes;
      try {
        bytes = ReadFile(file.path, options_.max_bytes);
      } catch (const Error& unread) {
        context_.Skipped({NameOf(file.path), unread.reason(), "it cannot be read or is too large"});
        return;
      }
      AddRequest request;
      request.collection = job_.collection;
      request.object = file.object;
      request.source = NameOf(file.path);
      request.bytes = bytes;
      if (AddPatiently(request)) options_.on_added(job_.collection);
    } catch (const Error& error) {
      if (!ConcernsOnePicture(error)) throw;
      context_.Skipped({NameOf(file.path), error.reason(), ToDisplayText(error.what())});
    }
  }

  // True when something was stored.
  bool AddPatiently(const AddRequest& request) {
    for (int attempt = 1;; ++attempt) {
      try {
        AddResult result;
        pool_.Run(WorkerPool::Lane::kBackground, [&](int cores) {
          AddRequest with_cores = request;
          with_cores.threads = cores;
          result = engine_.Add(with_cores);
        });
        return result.outcome != AddOutcome::kUnchanged;
      } catch (const Error& error) {
        if (error.code() != ErrorCode::kUnavailable || attempt == kTriesWhenBusy ||
            context_.stop().stop_requested()) {
          throw;
        }
        std::this_thread::sleep_for(kPauseWhenBusy);
      }
    }
  }

  Engine& engine_;
  WorkerPool& pool_;
  const ImportOptions& options_;
  const JobStatus& job_;
  const JobContext& context_;
  fs::path root_;
  std::vector<PictureFile> files_;
  std::atomic<std::size_t> done_{0};
};

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

JobStatus AddImportJob(JobQueue& jobs, const std::string& collection, const std::string& folder,
                       const std::string& object_from) {
  return jobs.Add("import", collection,
                  ToText(Json{{"folder", folder}, {"object_from", object_from}}));
}

void RegisterImportJob(JobQueue& jobs, Engine& engine, WorkerPool& pool, ImportOptions options) {
  jobs.Register("import", {[&engine, &pool, options = std::move(options)](
                               const JobStatus& job, const JobContext& context) {
                  return Import(engine, pool, options, job, context).Run();
                }});
}

}  // namespace pliant::server
