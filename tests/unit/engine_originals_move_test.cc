// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Originals that move from one directory to another.
#include <vector>

#include <gmock/gmock.h>

#include "tests/unit/expect_error.h"
#include "tests/unit/originals_fixture.h"

namespace pliant::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr std::uint64_t kImages = 11;  // more than a batch

class MoveOriginalsTest : public EngineOriginalsTest {
 protected:
  void Fill(const MaybeDirectory& directory) {
    Engine engine(Options(directory));
    engine.CreateCollection("other");
    for (std::uint64_t i = 1; i <= kImages; ++i) Add(engine, i, "p" + std::to_string(i));
    Add(engine, 1, "shared", "other");
  }
  static void ExpectAll(Engine& engine) {
    for (std::uint64_t i = 1; i <= kImages; ++i) {
      EXPECT_EQ(engine.GetContent("default", "p" + std::to_string(i)), RandomPng(i));
    }
    EXPECT_EQ(engine.GetContent("other", "shared"), RandomPng(1));
    EXPECT_THAT(engine.Check(), IsEmpty());
  }
  fs::path Elsewhere(std::uint64_t seed) const {
    return elsewhere_ / FileOf(seed).lexically_relative(directory_);
  }
  fs::path elsewhere_ = folder_ / "elsewhere";
};

TEST_F(MoveOriginalsTest, FromADirectoryToAnotherAndBack) {
  Fill(directory_);
  Engine server(Options({}));  // runs all the time
  Engine tool(Looking(db_));
  double share = 0;
  const auto moved = tool.MoveOriginals(elsewhere_, [&](double done) { share = done; });
  EXPECT_EQ(moved.moved, kImages + 1);
  EXPECT_EQ(moved.left, 0U);
  EXPECT_EQ(share, 1);
  EXPECT_EQ(Files(), 0U);
  EXPECT_TRUE(fs::exists(Elsewhere(3)));
  EXPECT_EQ(BytesInDatabase(), 0);
  EXPECT_EQ(tool.DescribeOriginals()->directory, elsewhere_);
  EXPECT_EQ(tool.MoveOriginals(elsewhere_).moved, 0U);
  ExpectAll(tool);
  ExpectAll(server);
  // It has not heard of the other directory, and loses nothing.
  Add(server, 50, "later");
  EXPECT_EQ(Files(), 0U);
  EXPECT_TRUE(server.Remove("default", "later"));
  Add(server, 51, "later");
  {
    Engine later(Options({}));
    ExpectAll(later);
    EXPECT_EQ(later.GetContent("default", "later"), RandomPng(51));
    EXPECT_TRUE(later.DescribeOriginals()->owned);
    Add(later, 52, "newest");
    EXPECT_TRUE(fs::exists(Elsewhere(52)));
  }
  EXPECT_EQ(tool.MoveOriginals(directory_).moved, kImages + 3) << "one was in the database";
  EXPECT_FALSE(fs::exists(Elsewhere(3)));
  EXPECT_EQ(BytesInDatabase(), 0);
  ExpectAll(server);
}

TEST_F(MoveOriginalsTest, WhatWasCutOffGoesOn) {
  Fill(directory_);
  // Some files are there already, one of them cut short.
  fs::create_directory(elsewhere_);
  fs::copy_file(directory_ / "pliant-originals", elsewhere_ / "pliant-originals");
  WriteBytes(Elsewhere(2), RandomPng(2));
  WriteText(Elsewhere(3), "half");
  Engine tool(Looking(db_));
  EXPECT_EQ(tool.MoveOriginals(elsewhere_).moved, kImages + 1);
  ExpectAll(tool);
  EXPECT_EQ(Files(), 0U);
}

TEST_F(MoveOriginalsTest, TheSameDirectoryByAnotherNameLosesNothing) {
  Fill(directory_);
  fs::create_directory_symlink(directory_, elsewhere_);
  Engine tool(Looking(db_));
  tool.MoveOriginals(elsewhere_);
  ExpectAll(tool);
  EXPECT_EQ(Files(), kImages);
}

TEST_F(MoveOriginalsTest, LostFilesAreCountedAndAForeignDirectoryIsRefused) {
  Fill(directory_);
  const auto lost = ReadBytes(FileOf(3));
  fs::remove(FileOf(3));
  WriteText(FileOf(4), "damaged");
  Engine tool(Looking(db_));
  fs::create_directory(elsewhere_);
  WriteText(elsewhere_ / "pliant-originals", std::string(32, 'a') + "\n/another.db\n");
  ExpectError(ErrorCode::kConflict, "originals_foreign", [&] { tool.MoveOriginals(elsewhere_); });
  EXPECT_EQ(tool.DescribeOriginals()->directory, directory_);
  fs::remove_all(elsewhere_);
  const auto moved = tool.MoveOriginals(elsewhere_);
  EXPECT_EQ(moved.moved, kImages - 1);
  EXPECT_EQ(moved.left, 2U);
  EXPECT_EQ(Files(), 1U) << "the damaged one";
  WriteBytes(Elsewhere(3), lost);
  WriteBytes(Elsewhere(4), RandomPng(4));
  ExpectAll(tool);
}

TEST_F(MoveOriginalsTest, FilesThatWereMovedByHandAreFoundWhereTheyAreSaidToBe) {
  Fill(directory_);
  fs::rename(directory_, elsewhere_);
  const auto refused = [&](const fs::path& target) {
    Engine tool(Looking(db_));
    try {
      tool.MoveOriginals(target);
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_THAT(refused({}), HasSubstr("(it was " + directory_.string() + ")"));
  EXPECT_THAT(refused(folder_ / "third"), HasSubstr("(it was " + directory_.string() + ")"));
  EngineOptions looking = Looking(db_);
  looking.originals_dir = elsewhere_;
  {
    Engine tool(looking);
    EXPECT_EQ(tool.MoveOriginals({}).moved, kImages + 1);
    ExpectAll(tool);
  }
  Engine tool(Looking(db_));
  EXPECT_EQ(tool.MoveOriginals(elsewhere_).moved, kImages + 1);
  fs::rename(elsewhere_, directory_);
  looking.originals_dir = directory_;
  EXPECT_EQ(Engine(looking).MoveOriginals(folder_ / "third").moved, kImages + 1);
  ExpectAll(tool);
}

}  // namespace
}  // namespace pliant::testing
