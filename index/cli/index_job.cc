// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/cli/index_job.h"

#include <algorithm>
#include <atomic>
#include <mutex>
#include <utility>

#include "descriptor/base/error.h"
#include "descriptor/base/parallel.h"
#include "index/cli/progress.h"
#include "index/files/text.h"

namespace pliant::cli {
namespace {

class Job {
 public:
  Job(Engine& engine, const std::vector<PictureFile>& files, const IndexJobOptions& options,
      const Interrupt& interrupt)
      : engine_(engine),
        files_(files),
        options_(options),
        interrupt_(interrupt),
        progress_("pictures") {}

  IndexJobResult Run() {
    const int wanted = ResolveThreads(options_.jobs);
    const auto at_once = static_cast<int>(ParallelWorkers(files_.size(), wanted));
    threads_a_picture_ = wanted / std::max(1, at_once);  // a single picture may use them all
    ParallelFor(files_.size(), wanted, [this](std::size_t i) {
      if (interrupt_.requested()) return;
      AddOne(files_[i]);
      progress_.Count(++done_, files_.size());
    });
    result_.interrupted = done_ < files_.size();
    std::sort(result_.skipped.begin(), result_.skipped.end(),
              [](const SkippedFile& a, const SkippedFile& b) { return a.file < b.file; });
    return std::move(result_);
  }

 private:
  void AddOne(const PictureFile& file) {
    try {
      std::vector<std::uint8_t> bytes;
      try {
        bytes = ReadFile(file.path, options_.max_bytes);
      } catch (const Error& error) {
        return Skip(file, error);
      }
      AddRequest request;
      request.collection = options_.collection;
      request.object = file.object;
      request.source = ToDisplayText(file.path.string());
      request.bytes = bytes;
      request.threads = threads_a_picture_;
      const AddResult added = engine_.Add(request);
      const std::lock_guard lock(mutex_);
      ++(added.outcome == AddOutcome::kUnchanged ? result_.unchanged : result_.indexed);
    } catch (const Error& error) {
      if (!ConcernsOnePicture(error)) throw;
      Skip(file, error);
    }
  }

  void Skip(const PictureFile& file, const Error& error) {
    const std::lock_guard lock(mutex_);
    result_.skipped.push_back(
        {ToDisplayText(file.path.string()), error.reason(), ToDisplayText(error.what())});
  }

  Engine& engine_;
  const std::vector<PictureFile>& files_;
  const IndexJobOptions& options_;
  const Interrupt& interrupt_;
  Progress progress_;
  int threads_a_picture_ = 1;
  std::atomic<std::uint64_t> done_{0};
  std::mutex mutex_;  // guards result_
  IndexJobResult result_;
};

}  // namespace

IndexJobResult RunIndexJob(Engine& engine, const std::vector<PictureFile>& files,
                           const IndexJobOptions& options, const Interrupt& interrupt) {
  return Job(engine, files, options, interrupt).Run();
}

}  // namespace pliant::cli
