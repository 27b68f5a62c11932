// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// An engine with a shop of images, for the parts of engine_options.
#pragma once

#include <string>

#include "tests/unit/engine_fixture.h"

namespace pliant::testing {

class EngineOptionsTest : public EngineTest {
 protected:
  static constexpr int kImages = 12;

  EngineOptions Options() {
    EngineOptions options;
    options.database = folder_ / "a.db";
    options.descriptor = "rootsift";
    return options;
  }
  // Images p1..p12 of objects o0..o3 in turn, of the years 2001..2012, in the shops east and
  // west.
  static void Fill(Engine& engine) {
    for (int i = 1; i <= kImages; ++i) {
      Add(engine, RandomPng(static_cast<std::uint64_t>(i)), "o" + std::to_string(i % 4),
          "p" + std::to_string(i),
          "{\"year\": " + std::to_string(2000 + i) + ", \"shop\": \"" +
              (i % 3 == 0 ? "west" : "east") + "\"}");
    }
    TrainOptions train;
    train.words = 60;
    train.sample = 3000;
    engine.TrainVocabulary(train);
  }
  static SearchOptions ByImage() { return EngineTest::ByImage(0); }
};

}  // namespace pliant::testing
