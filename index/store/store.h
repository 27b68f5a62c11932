// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// One opened store: its readers, its writer, its feed. The engine works on this alone.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <thread>

#include "index/store/catalogue.h"
#include "index/store/change_feed.h"
#include "index/store/writer.h"

namespace pliant {

class Store {
 public:
  explicit Store(std::unique_ptr<Access> access);
  ~Store();
  Store(const Store&) = delete;
  Store& operator=(const Store&) = delete;

  const StoredModel& model() const;
  // Writes down how images are described, where that is not decided yet; what is written down
  // then: another process may have been first.
  ExtractionLimits SettleExtraction(const ExtractionLimits& limits);
  // Where uploaded bytes go (EngineOptions::originals_dir); `claim`: may make the directory its
  // own.
  void OpenOriginals(const std::optional<std::filesystem::path>& directory, bool claim);
  // From here on `after_commit` runs after each commit of this process, before the writing call
  // returns. Without it every writing call throws kReadOnly "read_only".
  void BeginWriting(std::function<void()> after_commit);
  // Calls `wake`, which must not throw, soon after another process has committed, in the thread
  // that is returned; none where the database does not tell. Searches ask the feed all the same:
  // this only saves them the work.
  std::jthread FollowOthers(std::function<void()> wake);

  Catalogue& catalogue() { return catalogue_; }
  Writer& writer() { return writer_; }
  std::unique_ptr<ChangeFeed> OpenFeed();  // must not outlive the store

 private:
  const std::unique_ptr<Access> access_;
  const std::unique_ptr<const ModelRow> model_;
  const std::unique_ptr<OriginalsKeeper> originals_;
  Catalogue catalogue_;
  Writer writer_;
};

}  // namespace pliant
