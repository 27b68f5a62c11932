// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Engines that keep originals as files of a directory, for the parts of engine_originals.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include <SQLiteCpp/SQLiteCpp.h>
#include <gtest/gtest.h>

#include "descriptor/base/sha256.h"
#include "index/engine/engine.h"
#include "tests/unit/index_test_images.h"

namespace pliant::testing {

class EngineOriginalsTest : public ::testing::Test {
 protected:
  using MaybeDirectory = std::optional<std::filesystem::path>;

  EngineOptions Options(const MaybeDirectory& directory) {
    EngineOptions options;
    options.database = db_;
    options.custom_descriptor = descriptor_;
    options.originals_dir = directory;
    options.busy_timeout_ms = 2000;
    return options;
  }
  // As `pliant db` opens it.
  EngineOptions Looking(const std::filesystem::path& database) {
    EngineOptions options;
    options.database = database;
    options.create = false;
    options.load_descriptor = false;
    options.load_index = false;
    return options;
  }
  static AddResult Add(Engine& engine, std::uint64_t seed, const std::string& id,
                       const std::string& collection = "default") {
    const auto png = RandomPng(seed);
    AddRequest request;
    request.bytes = png;
    request.id = id;
    request.collection = collection;
    return engine.Add(request);
  }
  std::filesystem::path FileOf(std::uint64_t seed) const {
    const std::string sha256 = Sha256Hex(RandomPng(seed));
    return directory_ / sha256.substr(0, 2) / sha256;
  }
  // Published files and those that are being written, without the owner's.
  std::size_t Files() const {
    std::size_t files = 0;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(directory_)) {
      files += entry.is_regular_file() && entry.path().filename() != "pliant-originals" ? 1 : 0;
    }
    return files;
  }
  std::int64_t BytesInDatabase() {
    return SQLite::Database(db_.string(), SQLite::OPEN_READONLY)
        .execAndGet("SELECT coalesce(sum(length(data)), 0) FROM originals")
        .getInt64();
  }

  TemporaryFolder folder_;
  std::filesystem::path db_ = folder_ / "a.db";
  std::filesystem::path directory_ = folder_ / "originals";
  std::shared_ptr<const Descriptor> descriptor_ = MakeDescriptor("rootsift");
};

}  // namespace pliant::testing
