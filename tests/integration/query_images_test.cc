// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// `pliant query --draw` and `--unwarp`.
#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/integration/program.h"

namespace pliant::testing {
namespace {

using ::testing::HasSubstr;

class QueryImagesTest : public ::testing::Test {
 protected:
  QueryImagesTest() {
    for (std::uint64_t i = 1; i <= 3; ++i) {
      WriteBytes(folder_ / ("set/o" + std::to_string(i) + "/a.png"), RandomPng(i));
    }
    WriteBytes(folder_ / "query.png", OtherViewPng(2));
  }
  void Index(const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments = {"index",      Path("set"),    "--db",
                                          Path("x.db"), "--descriptor", "rootsift"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    ASSERT_EQ(RunProgram(arguments).status, 0);
  }
  ProgramResult Query(const std::vector<std::string>& more,
                      const std::string& image = "query.png") {
    std::vector<std::string> arguments = {"query", Path(image), "--db", Path("x.db"), "--json"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return RunProgram(arguments);
  }
  Image Load(const std::string& name) {
    DecodeOptions options;
    options.colour = true;
    options.max_side_px = 0;
    return DecodeImage(ReadBytes(folder_ / name), options).image;
  }
  std::string Path(const std::string& name) { return (folder_ / name).string(); }

  TemporaryFolder folder_;
};

// Where a pixel's channels differ clearly, something was drawn: the images are grey.
int Coloured(const Image& image, int x0, int x1, int y0, int y1) {
  int count = 0;
  for (int y = y0; y < y1; ++y) {
    for (int x = x0; x < x1; ++x) {
      const std::uint8_t* p = &image.pixels[(static_cast<std::size_t>(y) * image.width + x) * 3];
      count += std::abs(p[0] - p[1]) > 40 || std::abs(p[1] - p[2]) > 40 ? 1 : 0;
    }
  }
  return count;
}

TEST_F(QueryImagesTest, DrawsARowAHitWithLinesWhereItMatches) {
  Index();
  const ProgramResult result = Query({"--draw", Path("out.png")});
  ASSERT_EQ(result.status, 0) << result.err;
  const auto hits = result.json()["hits"];
  EXPECT_EQ(hits[0]["object"], "o2");
  EXPECT_FALSE(hits[0].contains("explain"));  // not asked for
  const Image sheet = Load("out.png");
  const int row = sheet.height / static_cast<int>(hits.size());
  EXPECT_GT(Coloured(sheet, 0, sheet.width, 0, row), 3000);
  if (hits.size() > 1) {
    EXPECT_LT(Coloured(sheet, 0, sheet.width, sheet.height - row, sheet.height), 600);
  }
}

TEST_F(QueryImagesTest, UnwarpsTheObjectOntoTheReference) {
  Index();
  ASSERT_EQ(Query({"--unwarp", Path("flat.png")}).status, 0);
  const Image sheet = Load("flat.png");
  // Flattened and stored image stand side by side, each 640 pixels wide (160 x 120 scaled): well
  // inside, they differ by the view's brightness (value 9 / 10 + 20) and the blur of resampling.
  const int gap = sheet.width - 2 * 640;
  const int step = 640 + gap / 3;
  double difference = 0;
  int count = 0;
  for (int y = 100; y < sheet.height - 100; ++y) {
    for (int x = gap / 3 + 120; x < gap / 3 + 520; ++x) {
      const auto at = [&](int px) {
        return sheet.pixels[(static_cast<std::size_t>(y) * sheet.width + px) * 3];
      };
      difference += std::abs(at(x) - (at(x + step) * 0.9 + 20));
      ++count;
    }
  }
  EXPECT_LT(difference / count, 12);

  ASSERT_EQ(Query({"--unwarp", Path("flats")}).status, 0);
  EXPECT_TRUE(std::filesystem::exists(folder_ / "flats/01-o2.png"));
}

TEST_F(QueryImagesTest, NothingFoundIsSaid) {
  Index();
  WriteBytes(folder_ / "stranger.png", RandomPng(77));
  const ProgramResult result = Query({"--unwarp", Path("flat.png")}, "stranger.png");
  EXPECT_EQ(result.status, 3);
  EXPECT_THAT(result.err, HasSubstr("nothing was found"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "flat.png"));
}

TEST_F(QueryImagesTest, WithoutStoredImagesTheRowSaysSo) {
  Index({"--no-originals"});
  ASSERT_EQ(Query({"--draw", Path("out.png"), "--unwarp", Path("flat.png")}).status, 0);
  EXPECT_EQ(Load("flat.png").width, 640 + 2 * 24);  // the flattened object alone
  EXPECT_GT(Load("out.png").width, 640);
}

TEST_F(QueryImagesTest, ALostImageIsNamedAndTheAnswerIsPrinted) {
  Index({"--originals-dir", Path("originals")});
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder_ / "originals")) {
    if (entry.path().filename().string().size() == 64) std::filesystem::remove(entry.path());
  }
  for (const char* flag : {"--draw", "--unwarp"}) {
    const ProgramResult result = Query({flag, Path("out.png")});
    EXPECT_EQ(result.status, 3) << result.err;
    EXPECT_EQ(result.json()["hits"][0]["object"], "o2");
    EXPECT_THAT(result.err, HasSubstr("skipped the image of hit 1, o2: ")) << flag;
    EXPECT_GT(Load("out.png").width, 640);
    std::filesystem::remove(folder_ / "out.png");
  }
}

TEST_F(QueryImagesTest, AnUnwritableFileIsSaidBeforeTheSearch) {
  for (const char* flag : {"--draw", "--unwarp"}) {
    const ProgramResult result = Query({flag, Path("absent/out.jpg")});  // and there is no database
    EXPECT_EQ(result.status, 1);
    EXPECT_EQ(result.json()["error"]["code"], "write_failed") << flag;
    EXPECT_THAT(result.err, HasSubstr("absent/out.jpg cannot be written; check that the folder"));
  }
}

TEST_F(QueryImagesTest, TheQueryImageIsNotOverwritten) {
  Index();
  const std::vector<std::uint8_t> before = ReadBytes(folder_ / "query.png");
  std::filesystem::create_symlink("query.png", folder_ / "link.png");
  for (const char* flag : {"--draw", "--unwarp"}) {
    for (const char* name : {"query.png", "set/../query.png", "link.png"}) {
      const ProgramResult result = Query({flag, Path(name)});
      EXPECT_EQ(result.status, 2);
      EXPECT_EQ(result.json()["error"]["code"], "same_file");
      EXPECT_THAT(result.err, HasSubstr(Path(name) + " is an input"));
    }
  }
  EXPECT_EQ(ReadBytes(folder_ / "query.png"), before);
}

}  // namespace
}  // namespace pliant::testing
