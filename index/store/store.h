// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// One opened store: its readers, its writer, its feed. The engine works on this alone.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>

#include "index/records/index_share.h"
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

  // The same for all processes that use this database; another one for a copy of it.
  std::string Identity() const;
  const StoredModel& model() const;
  // Stores how images are described, unless that is stored already. Returns the stored values:
  // another process can have been first.
  ExtractionLimits SettleExtraction(const ExtractionLimits& limits);
  // Sets the location of uploaded bytes (EngineOptions::originals_dir). `claim`: can become the
  // owner of the directory.
  void OpenOriginals(const std::optional<std::filesystem::path>& directory, bool claim);
  // Enables writing: `after_commit` runs after each commit of this process, before the writing call
  // returns. Before this, every writing call throws kReadOnly "read_only".
  void BeginWriting(std::function<void()> after_commit);
  // Calls `wake`, which must not throw, soon after commits of other processes, in the returned
  // thread. No thread if the database does not report commits. Searches still poll the feed: this
  // only reduces their work.
  std::jthread FollowOthers(const std::function<void()>& wake);

  Catalogue& catalogue() { return catalogue_; }
  Writer& writer() { return writer_; }
  // Of the images of a share. Must not outlive the store.
  std::unique_ptr<ChangeFeed> OpenFeed(const IndexShare& share = {});

 private:
  const std::unique_ptr<Access> access_;
  const std::unique_ptr<const ModelRow> model_;
  const std::unique_ptr<OriginalsKeeper> originals_;
  Catalogue catalogue_;
  Writer writer_;
};

}  // namespace pliant
