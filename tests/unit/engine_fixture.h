// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// An engine on a temporary database, for the parts of engine_test; the same tests run on every kind
// of database (test_database.h).
#pragma once

#include <atomic>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "index/engine/engine.h"
#include "tests/unit/expect_error.h"
#include "tests/unit/index_test_images.h"
#include "tests/unit/test_database.h"

namespace pliant::testing {

// Counts how often it is asked, so that tests see which work was not done.
class CountingDescriptor : public Descriptor {
 public:
  explicit CountingDescriptor(std::shared_ptr<const Descriptor> inner) : inner_(std::move(inner)) {}
  const DescriptorInfo& info() const override { return inner_->info(); }
  Descriptors Describe(const Image& grey, std::span<const Keypoint> keypoints,
                       int threads) const override {
    ++calls;
    return inner_->Describe(grey, keypoints, threads);
  }
  mutable std::atomic<int> calls{0};

 private:
  std::shared_ptr<const Descriptor> inner_;
};

class EngineTest : public ::testing::Test {
 protected:
  EngineOptions Options() {
    EngineOptions options;
    options.database = Database(folder_ / "a.db");
    options.descriptor = "rootsift";
    options.custom_descriptor = descriptor_;
    options.busy_timeout_ms = 300;
    options.keep_originals = true;
    return options;
  }
  static AddResult Add(Engine& engine, const std::vector<std::uint8_t>& bytes,
                       const std::string& object, std::optional<std::string> id = {},
                       const std::string& metadata = "{}") {
    AddRequest request;
    request.bytes = bytes;
    request.object = object;
    request.id = std::move(id);
    request.metadata = metadata;
    request.source = "somewhere/" + object;
    return engine.Add(request);
  }
  // Images 1..count, two views an object: o1 = {1, 2}, o2 = {3, 4}...
  void AddMany(Engine& engine, int count) {
    for (int i = 1; i <= count; ++i) {
      Add(engine, RandomPng(static_cast<std::uint64_t>(i)), "o" + std::to_string((i + 1) / 2),
          "p" + std::to_string(i));
    }
  }
  static VocabularyRecord Train(Engine& engine, int words = 100, std::uint64_t seed = 1) {
    TrainOptions train;
    train.words = words;
    train.sample = 2000;
    train.seed = seed;
    return engine.TrainVocabulary(train);
  }
  static std::vector<std::string> Ids(const SearchResult& result) {
    std::vector<std::string> ids;
    for (const Hit& hit : result.hits) ids.push_back(hit.image_id);
    return ids;
  }
  static SearchOptions ByImage(std::size_t limit = 10) {
    SearchOptions options;
    options.group_by = GroupBy::kImage;
    options.limit = limit;
    return options;
  }

  TemporaryFolder folder_;
  std::shared_ptr<CountingDescriptor> descriptor_ =
      std::make_shared<CountingDescriptor>(MakeDescriptor("rootsift"));
};

}  // namespace pliant::testing
