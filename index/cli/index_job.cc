// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/cli/index_job.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <thread>

#include "descriptor/base/error.h"
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
    const auto cores = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
    const int wanted = options_.jobs > 0 ? options_.jobs : cores;
    const int threads = std::max(1, std::min(wanted, static_cast<int>(files_.size())));
    threads_a_picture_ = std::max(1, wanted / threads);  // a single picture may use them all
    {
      std::vector<std::jthread> workers;
      for (int t = 1; t < threads; ++t) workers.emplace_back([this] { Work(); });
      Work();
    }
    if (failure_) std::rethrow_exception(failure_);
    result_.interrupted = done_ < files_.size();
    std::sort(result_.skipped.begin(), result_.skipped.end(),
              [](const SkippedFile& a, const SkippedFile& b) { return a.file < b.file; });
    return std::move(result_);
  }

 private:
  void Work() {
    try {
      while (!interrupt_.requested() && !failed_) {
        const std::size_t i = next_++;
        if (i >= files_.size()) return;
        AddOne(files_[i]);
        progress_.Count(++done_, files_.size());
      }
    } catch (...) {
      failed_ = true;
      const std::lock_guard lock(mutex_);
      if (!failure_) failure_ = std::current_exception();
    }
  }

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
  std::atomic<std::size_t> next_{0};
  std::atomic<std::uint64_t> done_{0};
  std::atomic<bool> failed_{false};
  std::mutex mutex_;  // guards result_ and failure_
  IndexJobResult result_;
  std::exception_ptr failure_;
};

}  // namespace

IndexJobResult RunIndexJob(Engine& engine, const std::vector<PictureFile>& files,
                           const IndexJobOptions& options, const Interrupt& interrupt) {
  return Job(engine, files, options, interrupt).Run();
}

}  // namespace pliant::cli
