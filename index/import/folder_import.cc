// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/import/folder_import.h"

#include <algorithm>
#include <atomic>
#include <mutex>
#include <utility>

#include "descriptor/base/error.h"
#include "descriptor/base/parallel.h"
#include "index/files/text.h"

namespace pliant {
namespace {

namespace fs = std::filesystem;

class FolderImport {
 public:
  FolderImport(Engine& engine, const ImageFiles& files, const FolderImportOptions& options)
      : engine_(engine), files_(files.images), options_(options) {
    result_.system_files = files.system_files;
    for (const SkippedFile& file : files.skipped) Skip({NameOf(file.file), file.code, file.reason});
    from_search_ = static_cast<std::ptrdiff_t>(result_.skipped.size());
  }

  FolderImportResult Run() {
    const int wanted = ResolveThreads(options_.threads);
    const int at_once = std::min(wanted, static_cast<int>(files_.size()));
    threads_per_image_ = wanted / std::max(1, at_once);
    Report(0);
    ParallelFor(files_.size(), wanted, [this](std::size_t i) {
      if (options_.stop.stop_requested()) return;
      AddOne(files_[i]);
      Report(++done_);
    });
    result_.interrupted = done_ < files_.size();
    std::sort(result_.skipped.begin() + from_search_, result_.skipped.end(),
              [](const SkippedFile& a, const SkippedFile& b) { return a.file < b.file; });
    return std::move(result_);
  }

 private:
  void AddOne(const ImageFile& file) {
    try {
      if (LeadsOut(file.path)) {
        return Skip({NameOf(file.path), "outside", "The path leads out of the import directory."});
      }
      std::vector<std::uint8_t> bytes;
      try {
        bytes = ReadFile(file.path, options_.max_bytes);
      } catch (const Error& error) {  // its text has the whole path
        if (error.code() == ErrorCode::kUnavailable) throw;
        return Skip({NameOf(file.path), error.reason(),
                     options_.root.empty() ? ToDisplayText(error.what())
                                           : "The file is unreadable or too large."});
      }
      AddRequest request;
      request.collection = options_.collection;
      request.object = file.object;
      request.source = NameOf(file.path);
      request.bytes = bytes;
      request.threads = threads_per_image_;
      const AddResult added = options_.add ? options_.add(request) : engine_.Add(request);
      const std::lock_guard lock(mutex_);
      ++(added.outcome == AddOutcome::kUnchanged ? result_.unchanged : result_.indexed);
    } catch (const Error& error) {
      if (!ConcernsOneImage(error)) throw;
      Skip({NameOf(file.path), error.reason(), ToDisplayText(error.what())});
    }
  }

  bool LeadsOut(const fs::path& path) const {
    if (options_.root.empty()) return false;
    std::error_code error;
    return !IsInside(options_.root, fs::canonical(path, error)) || error;
  }

  std::string NameOf(const fs::path& path) const {
    return ToDisplayText(
        (options_.root.empty() ? path : path.lexically_relative(options_.root)).string());
  }

  void Skip(SkippedFile file) {
    if (options_.skipped) options_.skipped(file);
    const std::lock_guard lock(mutex_);
    result_.skipped.push_back(std::move(file));
  }

  void Report(std::uint64_t done) const {
    if (options_.progress) options_.progress(done, files_.size());
  }

  Engine& engine_;
  const std::vector<ImageFile>& files_;
  const FolderImportOptions& options_;
  std::ptrdiff_t from_search_ = 0;  // of result_.skipped
  int threads_per_image_ = 1;
  std::atomic<std::uint64_t> done_{0};
  std::mutex mutex_;  // guards result_
  FolderImportResult result_;
};

}  // namespace

FolderImportResult ImportImages(Engine& engine, const ImageFiles& files,
                                const FolderImportOptions& options) {
  return FolderImport(engine, files, options).Run();
}

}  // namespace pliant
