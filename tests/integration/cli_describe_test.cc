// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What `pliant describe` writes.
#include <cstring>

#include <gmock/gmock.h>

#include "tests/integration/cli_fixture.h"

namespace pliant::testing {
namespace {

using ::testing::HasSubstr;
using ::testing::SizeIs;
using ::testing::StartsWith;

TEST_F(CliTest, DescribeWritesSafetensors) {
  WriteBytes(folder_ / "q.png", RandomPng(1));
  for (const std::string name : {"rootsift", "orb"}) {
    const auto out = folder_ / (name + ".safetensors");
    const ProgramResult result =
        RunProgram({"describe", (folder_ / "q.png").string(), "--descriptor", name,
                    "--max-keypoints", "50", "--out", out.string(), "--json"});
    ASSERT_EQ(result.status, 0) << result.err;
    EXPECT_EQ(result.json()["keypoints"], 50);
    const std::vector<std::uint8_t> bytes = ReadBytes(out);
    std::uint64_t length = 0;
    std::memcpy(&length, bytes.data(), 8);
    EXPECT_EQ(length % 8, 0u);
    const Json header =
        Json::parse(bytes.begin() + 8, bytes.begin() + 8 + static_cast<std::ptrdiff_t>(length));
    const std::uint64_t dim = name == "orb" ? 32 : 128;
    const std::uint64_t width = name == "orb" ? 1 : 4;
    EXPECT_EQ(header["keypoints"]["shape"], (Json{50, 6}));
    EXPECT_EQ(header["descriptors"]["shape"], (Json{50, dim}));
    EXPECT_EQ(header["descriptors"]["dtype"], name == "orb" ? "U8" : "F32");
    EXPECT_EQ(bytes.size(), 8 + length + 50 * 6 * 4 + 50 * dim * width);
    EXPECT_THAT(header["__metadata__"]["model_id"].get<std::string>(), StartsWith(name));
  }
  for (const char* file : {"/nowhere/x.safetensors", "/nowhere/x.npz"}) {
    EXPECT_EQ(
        RunProgram({"describe", (folder_ / "q.png").string(), "--descriptor", "orb", "--out", file})
            .status,
        1);
  }
}

TEST_F(CliTest, ResultsGoToStandardOutput) {
  WriteBytes(folder_ / "views" / "q.png", RandomPng(1));
  WriteBytes(folder_ / "views" / "r.png", RandomPng(2));
  const auto shell = [this](const std::string& arguments) {
    return Program({"-c", "cd " + (folder_ / ".").string() + "; " + PliantPath().string() + " " +
                              arguments},
                   {}, "/bin/sh")
        .Wait();
  };
  for (const std::string what : {"views/q.png", "views"}) {
    const std::string describe = "describe " + what + " --descriptor orb --out ";
    EXPECT_EQ(shell(describe + "named.npz").status, 0);
    const ProgramResult piped = shell(describe + "- > piped.npz");
    EXPECT_EQ(piped.status, 0) << piped.err;
    EXPECT_THAT(piped.err, HasSubstr("key points"));
    EXPECT_EQ(ReadBytes(folder_ / "piped.npz"), ReadBytes(folder_ / "named.npz"));
    EXPECT_FALSE(std::filesystem::exists(folder_ / "-"));
  }
  const ProgramResult full = shell("describe views/q.png --descriptor orb --out - > /dev/full");
  EXPECT_EQ(full.status, 1);
  EXPECT_THAT(full.err, HasSubstr("standard output could not be written"));

  ASSERT_EQ(shell("index views --db x.db --descriptor orb").status, 0);
  EXPECT_EQ(shell("db export records.ndjson --db x.db").status, 0);
  const ProgramResult records = shell("db export - --db x.db");
  EXPECT_EQ(records.status, 0) << records.err;
  const std::vector<std::uint8_t> named = ReadBytes(folder_ / "records.ndjson");
  EXPECT_EQ(records.out, std::string(named.begin(), named.end()));
  EXPECT_EQ(shell("query views/q.png --db x.db --draw named.png").status, 0);
  EXPECT_EQ(shell("query - --db x.db --draw - < views/q.png > piped.png").status, 0);
  EXPECT_EQ(ReadBytes(folder_ / "piped.png"), ReadBytes(folder_ / "named.png"));
}

// That NumPy reads it is tests/python's.
TEST_F(CliTest, DescribeWritesWhatTheNameSays) {
  WriteBytes(folder_ / "q.png", RandomPng(1));
  const auto describe = [&](const std::string& name) {
    return RunProgram({"describe", (folder_ / "q.png").string(), "--descriptor", "orb", "--out",
                       (folder_ / name).string()});
  };
  ASSERT_EQ(describe("q.npz").status, 0);
  const std::vector<std::uint8_t> bytes = ReadBytes(folder_ / "q.npz");
  EXPECT_EQ(std::string(bytes.begin(), bytes.begin() + 4), "PK\x03\x04");
  for (const std::string name : {"q.npy", "q.txt", "q", "q.npz.bak", "q.H5"}) {
    const ProgramResult result = describe(name);
    EXPECT_EQ(result.status, 2);
    EXPECT_THAT(result.err, HasSubstr(".npz (NumPy), .h5 (HDF5) or .safetensors")) << name;
    EXPECT_FALSE(std::filesystem::exists(folder_ / name));
  }
}

// That NumPy reads it is tests/python's, too; HDF5 has a test of its own.
TEST_F(CliTest, DescribeTakesAFolder) {
  WriteObjects(3);
  WriteBytes(folder_ / "objects" / "o2" / "small.png",
             EncodePng({4, 4, 1, std::vector<std::uint8_t>(16)}));
  std::filesystem::create_symlink("nowhere", folder_ / "objects" / "o3" / "gone.png");
  const auto describe = [&](const std::string& folder, const std::string& out) {
    return RunProgram({"describe", (folder_ / folder).string(), "--descriptor", "orb", "--out",
                       (folder_ / out).string(), "--json"});
  };
  const ProgramResult some = describe("objects", "all.safetensors");
  EXPECT_EQ(some.status, 3) << some.err;
  EXPECT_EQ(some.json()["images"], 3);
  ASSERT_THAT(some.json()["skipped"], SizeIs(2));
  EXPECT_EQ(some.json()["skipped"][0]["file"], "o3/gone.png");
  EXPECT_EQ(some.json()["skipped"][0]["code"], "cannot_read");
  EXPECT_EQ(some.json()["skipped"][1]["file"], "o2/small.png");
  EXPECT_EQ(some.json()["skipped"][1]["code"], "image_too_small");
  const std::vector<std::uint8_t> bytes = ReadBytes(folder_ / "all.safetensors");
  std::uint64_t length = 0;
  std::memcpy(&length, bytes.data(), 8);
  const Json header =
      Json::parse(bytes.begin() + 8, bytes.begin() + 8 + static_cast<std::ptrdiff_t>(length));
  EXPECT_EQ(Json::parse(header["__metadata__"]["names"].get<std::string>()),
            (Json{"o1/view.png", "o2/view.png", "o3/view.png"}));
  EXPECT_EQ(header["starts"]["shape"], Json{4});
  EXPECT_EQ(header["keypoints"]["shape"], (Json{some.json()["keypoints"], 6}));
  std::filesystem::remove(folder_ / "objects" / "o2" / "small.png");
  std::filesystem::remove(folder_ / "objects" / "o3" / "gone.png");
  EXPECT_EQ(describe("objects", "all.npz").status, 0);
  std::filesystem::create_directory(folder_ / "empty");
  const ProgramResult none = describe("empty", "none.npz");
  EXPECT_EQ(none.status, 1);
  EXPECT_EQ(none.json()["error"]["code"], "no_pictures");
  EXPECT_FALSE(std::filesystem::exists(folder_ / "none.npz"));
}

}  // namespace
}  // namespace pliant::testing
