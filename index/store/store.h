// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// One opened store: its readers, its writer, its feed. The engine works on this alone.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>

#include "index/store/catalogue.h"
#include "index/store/change_feed.h"
#include "index/store/writer.h"

namespace pliant {

class Store {
 public:
  virtual ~Store() = default;

  virtual const StoredModel& model() const = 0;
  // Writes down how pictures are described, where that is not decided yet; what is written down
  // then: another process may have been first.
  virtual ExtractionLimits SettleExtraction(const ExtractionLimits& limits) = 0;
  // Where uploaded bytes go (EngineOptions::originals_dir); `claim`: may make the directory its
  // own.
  virtual void OpenOriginals(const std::optional<std::filesystem::path>& directory, bool claim) = 0;
  // From here on `after_commit` runs after each commit of this process, before the writing call
  // returns. Without it every writing call throws kReadOnly "read_only".
  virtual void BeginWriting(std::function<void()> after_commit) = 0;

  virtual Catalogue& catalogue() = 0;
  virtual Writer& writer() = 0;
  virtual std::unique_ptr<ChangeFeed> OpenFeed() = 0;  // must not outlive the store
};

}  // namespace pliant
