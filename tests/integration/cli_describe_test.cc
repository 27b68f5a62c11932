// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What `pliant describe` writes.
#include <gmock/gmock.h>

#include "tests/integration/cli_fixture.h"

namespace pliant::testing {
namespace {

using ::testing::HasSubstr;
using ::testing::SizeIs;
using ::testing::StartsWith;

// That NumPy reads it is tests/python's.
TEST_F(CliTest, DescribeWritesArrays) {
  WriteBytes(folder_ / "q.png", RandomPng(1));
  for (const std::string name : {"rootsift", "orb"}) {
    const auto out = folder_ / (name + ".npz");
    const ProgramResult result =
        RunProgram({"describe", (folder_ / "q.png").string(), "--descriptor", name,
                    "--max-keypoints", "50", "--out", out.string(), "--json"});
    ASSERT_EQ(result.status, 0) << result.err;
    EXPECT_EQ(result.json()["keypoints"], 50);
    EXPECT_THAT(result.json()["model_id"].get<std::string>(), StartsWith(name));
    const std::vector<std::uint8_t> bytes = ReadBytes(out);
    const std::string text(bytes.begin(), bytes.end());
    const bool binary = name == "orb";
    EXPECT_THAT(text, StartsWith("PK\x03\x04"));
    EXPECT_THAT(text, HasSubstr("{'descr': '<f4', 'fortran_order': False, 'shape': (50,6,)"));
    EXPECT_THAT(text,
                HasSubstr(binary ? "{'descr': '|u1', 'fortran_order': False, 'shape': (50,32,)"
                                 : "{'descr': '<f4', 'fortran_order': False, 'shape': (50,128,)"));
  }
}

TEST_F(CliTest, EnlargedIsWhatASearchCompares) {
  const std::string image = (folder_ / "views" / "q.png").string();
  const std::string database = (folder_ / "x.db").string();
  const std::string out = (folder_ / "q.npz").string();
  WriteBytes(image, RandomPng(1));
  ASSERT_EQ(RunProgram({"index", (folder_ / "views").string(), "--db", database, "--descriptor",
                        "rootsift"})
                .status,
            0);
  const ProgramResult query = RunProgram({"query", image, "--db", database, "--json"});
  const ProgramResult plain =
      RunProgram({"describe", image, "--descriptor", "rootsift", "--out", out, "--json"});
  const ProgramResult enlarged = RunProgram(
      {"describe", image, "--descriptor", "rootsift", "--enlarge", "--out", out, "--json"});
  ASSERT_EQ(enlarged.status, 0) << enlarged.err;
  EXPECT_EQ(enlarged.json()["keypoints"], query.json()["keypoints"]);
  EXPECT_LT(plain.json()["keypoints"], enlarged.json()["keypoints"]);
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
    EXPECT_THAT(piped.err, HasSubstr("keypoints"));
    EXPECT_EQ(ReadBytes(folder_ / "piped.npz"), ReadBytes(folder_ / "named.npz"));
    EXPECT_FALSE(std::filesystem::exists(folder_ / "-"));
  }
  const ProgramResult full = shell("describe views/q.png --descriptor orb --out - > /dev/full");
  EXPECT_EQ(full.status, 1);
  EXPECT_THAT(full.err, HasSubstr("cannot write to standard output"));

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

TEST_F(CliTest, DescribeRefusesOtherNames) {
  WriteBytes(folder_ / "q.png", RandomPng(1));
  for (const std::string name : {"q.npy", "q.txt", "q", "q.npz.bak", "q.h5", "q.safetensors"}) {
    const ProgramResult result =
        RunProgram({"describe", (folder_ / "q.png").string(), "--descriptor", "orb", "--out",
                    (folder_ / name).string()});
    EXPECT_EQ(result.status, 2);
    EXPECT_THAT(result.err, HasSubstr("end the name in .npz (NumPy)")) << name;
    EXPECT_FALSE(std::filesystem::exists(folder_ / name));
  }
}

// That NumPy reads it is tests/python's, too.
TEST_F(CliTest, DescribeTakesAFolder) {
  WriteObjects(3);
  WriteBytes(folder_ / "objects" / "o2" / "small.png",
             EncodePng({4, 4, 1, std::vector<std::uint8_t>(16)}));
  std::filesystem::create_symlink("nowhere", folder_ / "objects" / "o3" / "gone.png");
  const auto describe = [&](const std::string& folder, const std::string& out,
                            const ProgramLimits& limits = {}) {
    return RunProgram({"describe", (folder_ / folder).string(), "--descriptor", "orb", "--out",
                       (folder_ / out).string(), "--json"},
                      limits);
  };
  const ProgramResult some = describe("objects", "all.npz");
  EXPECT_EQ(some.status, 3) << some.err;
  EXPECT_EQ(some.json()["images"], 3);
  ASSERT_THAT(some.json()["skipped"], SizeIs(2));
  EXPECT_EQ(some.json()["skipped"][0]["file"], "o3/gone.png");
  EXPECT_EQ(some.json()["skipped"][0]["code"], "cannot_read");
  EXPECT_EQ(some.json()["skipped"][1]["file"], "o2/small.png");
  EXPECT_EQ(some.json()["skipped"][1]["code"], "image_too_small");
  std::filesystem::remove(folder_ / "objects" / "o2" / "small.png");
  std::filesystem::remove(folder_ / "objects" / "o3" / "gone.png");
  EXPECT_EQ(describe("objects", "all.npz").status, 0);
  const std::vector<std::uint8_t> before = ReadBytes(folder_ / "all.npz");
  std::filesystem::create_directory(folder_ / "empty");
  const ProgramResult none = describe("empty", "none.npz");
  EXPECT_EQ(none.status, 1);
  EXPECT_EQ(none.json()["error"]["code"], "no_images");
  EXPECT_FALSE(std::filesystem::exists(folder_ / "none.npz"));
  const ProgramResult full = describe("objects", "all.npz", {.max_file_bytes = before.size() / 2});
  EXPECT_EQ(full.status, 1);
  EXPECT_EQ(full.json()["error"]["code"], "write_failed");
  EXPECT_THAT(full.err, HasSubstr("File too large"));
  EXPECT_EQ(ReadBytes(folder_ / "all.npz"), before) << "what cannot be written leaves the old file";
}

TEST_F(CliTest, DescribeChecksTheNameBeforeTheWork) {
  std::filesystem::create_directory(folder_ / "no.npz");
  for (const auto& wrong : {folder_ / "none" / "x.npz", folder_ / "no.npz"}) {
    const ProgramResult result =
        RunProgram({"describe", "/no such image", "--out", wrong.string(), "--json"});
    EXPECT_EQ(result.status, 1);
    EXPECT_EQ(result.json()["error"]["code"], "write_failed");
  }
}

}  // namespace
}  // namespace pliant::testing
