// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// pliant eval matching and pliant match, the real program.
#include <fstream>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "descriptor/simulation/procedural.h"
#include "descriptor/simulation/scene_folder.h"
#include "tests/integration/charts.h"
#include "tests/integration/program.h"

namespace pliant {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;
using testing::ProgramResult;
using testing::RunProgram;

class CliMatching : public ::testing::Test {
 protected:
  // Scene folders below the temporary folder; made once, because the cloth takes a second.
  static const testing::TemporaryFolder& Scenes() {
    static const testing::TemporaryFolder folder;
    static const bool made = [] {
      const simulation::TextureSource textures = simulation::ProceduralTextures(6, 5, 320);
      simulation::SceneOptions options;
      options.width = 320;
      options.height = 240;
      options.strength = 0.4F;
      options.occluders = 0.0F;
      options.views = 2;
      for (std::uint64_t i = 0; i < 2; ++i) {
        simulation::WriteSceneFolder(folder / "pairs" / ("scene_00000" + std::to_string(i)),
                                     simulation::MakeScene(textures, options, 3, i));
      }
      options.preset = simulation::Preset::kScale;
      options.views = 3;
      simulation::WriteSceneFolder(folder / "scale" / "scene_000000",
                                   simulation::MakeScene(textures, options, 3, 0));
      return true;
    }();
    EXPECT_TRUE(made);
    return folder;
  }
  static std::string At(const std::string& name) { return (Scenes() / name).string(); }

  // Keypoints on the object are many enough in these small images.
  static ProgramResult Eval(std::vector<std::string> more) {
    std::vector<std::string> arguments = {"eval", "matching"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    arguments.insert(arguments.end(), {"--keypoints", "200", "--min-true-pairs", "4"});
    return RunProgram(arguments);
  }
  testing::TemporaryFolder out_;
};

TEST_F(CliMatching, JsonTableCsvAndChartsTellTheSame) {
  const std::string csv = (out_ / "table.csv").string();
  const ProgramResult result =
      Eval({At("scale"), "--descriptor", "deal,sift,brisk", "--csv", csv, "--json"});
  ASSERT_EQ(result.status, 0) << result.err;
  EXPECT_EQ(result.err, "");  // no progress where nobody looks
  const json report = result.json();
  EXPECT_EQ(report["pairs"], 2);
  EXPECT_EQ(report["layout"], "folders");
  ASSERT_EQ(report["results"].size(), 3U);
  EXPECT_EQ(report["results"][0]["descriptor"], "deal");
  EXPECT_EQ(report["results"][1]["ms_ratio_to_sift"], 1.0);
  for (const json& row : report["results"]) {
    for (const char* figure : {"ms", "mma", "mutual_precision"}) {
      EXPECT_GE(row[figure].get<double>(), 0);
      EXPECT_LE(row[figure].get<double>(), 1);
    }
    EXPECT_GT(row["correct_matches"], 0);
  }
  ASSERT_EQ(report["curves"].size(), 1U);
  const json& curve = report["curves"][0];
  EXPECT_EQ(curve["over"], "scale");
  EXPECT_EQ(curve["values"], json::parse("[0.25, 1.0]"));
  ASSERT_EQ(curve["series"].size(), 3U);
  EXPECT_EQ(curve["series"][2]["descriptor"], "brisk");
  EXPECT_EQ(curve["series"][2]["ms"].size(), 2U);

  std::ifstream file(csv);
  std::string line;
  ASSERT_TRUE(std::getline(file, line));
  EXPECT_THAT(line, ::testing::StartsWith("set,value,descriptor,model_id,pairs,ms,"));
  int lines = 0;
  while (std::getline(file, line)) ++lines;
  EXPECT_EQ(lines, 3 + 2 * 3);
  testing::ExpectCharts(result.out, 500);
}

TEST_F(CliMatching, TextSaysHowManyPairs) {
  const ProgramResult result = Eval({At("pairs"), "--descriptor", "rootsift", "--jobs", "1"});
  ASSERT_EQ(result.status, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("2 pairs (folders), 0 excluded"));
  EXPECT_THAT(result.out, HasSubstr("rootsift"));
}

TEST_F(CliMatching, WrongUseIsNamed) {
  EXPECT_EQ(Eval({At("pairs"), "--descriptor", "surf"}).status, 2);
  EXPECT_EQ(Eval({At("pairs"), "--layout", "coco"}).status, 2);
  const ProgramResult missing = Eval({At("nowhere"), "--json"});
  EXPECT_EQ(missing.status, 1);
  EXPECT_EQ(missing.json()["error"]["code"], "dataset_not_found");
  EXPECT_EQ(RunProgram({"eval"}).status, 2);
}

TEST_F(CliMatching, MatchJudgesImagesOfAScene) {
  const std::string a = At("pairs/scene_000000/view_00.png");
  const std::string b = At("pairs/scene_000000/view_01.png");
  const std::string drawing = (out_ / "matches.png").string();
  const ProgramResult result = RunProgram(
      {"match", a, b, "--max-keypoints", "200", "--verify", "--draw", drawing, "--json"});
  ASSERT_EQ(result.status, 0) << result.err;
  const json report = result.json();
  ASSERT_EQ(report["keypoints"].size(), 2U);
  const auto n1 = report["keypoints"][0].get<std::size_t>();
  const auto n2 = report["keypoints"][1].get<std::size_t>();
  ASSERT_EQ(report["positions"][0].size(), n1);
  for (const json& match : report["matches"]) {
    ASSERT_EQ(match.size(), 3U);
    EXPECT_LT(match[0].get<std::size_t>(), n1);
    EXPECT_LT(match[1].get<std::size_t>(), n2);
    EXPECT_GE(match[2].get<double>(), 0);
  }
  EXPECT_GT(report["correct"].get<int>(), 10);
  EXPECT_LE(report["correct"], report["known"]);
  EXPECT_LE(report["known"].get<std::size_t>(), report["matches"].size());
  EXPECT_TRUE(report["verification"]["verified"].get<bool>());
  EXPECT_EQ(ReadImageHeader(testing::ReadBytes(drawing)).width, 320 + 320 + 8);
}

// As the files of HPatches are.
TEST_F(CliMatching, PpmIsReadAsPngIs) {
  const auto write = [this](const std::string& stem, const std::vector<std::uint8_t>& png) {
    const Image image = DecodeImage(png, {.max_side_px = 0, .colour = true}).image;
    std::string ppm =
        "P6\n" + std::to_string(image.width) + " " + std::to_string(image.height) + "\n255\n";
    ppm.append(image.pixels.begin(), image.pixels.end());
    testing::WriteText(out_ / (stem + ".ppm"), ppm);
    testing::WriteBytes(out_ / (stem + ".png"), png);
  };
  write("1", testing::RandomPng(5));
  write("2", testing::OtherViewPng(5));
  const auto matches = [this](const std::string& extension) {
    const ProgramResult result =
        RunProgram({"match", (out_ / ("1" + extension)).string(),
                    (out_ / ("2" + extension)).string(), "--descriptor", "rootsift", "--draw",
                    (out_ / ("drawn" + extension + ".png")).string(), "--json"});
    EXPECT_EQ(result.status, 0) << result.err;
    return result.json()["matches"];
  };
  EXPECT_GT(matches(".ppm").size(), 30U);
  EXPECT_EQ(matches(".ppm"), matches(".png"));
  EXPECT_EQ(testing::ReadBytes(out_ / "drawn.ppm.png"), testing::ReadBytes(out_ / "drawn.png.png"));
  EXPECT_EQ(RunProgram({"describe", (out_ / "1.ppm").string(), "--descriptor", "orb", "--out",
                        (out_ / "1.npz").string()})
                .status,
            0);
}

// Standard input is there once, and drawing needs it, too; "-" as a drawing is standard output.
TEST_F(CliMatching, ImagesAndDrawingsGoThroughPipes) {
  const std::string a = (out_ / "a.png").string(), b = (out_ / "b.png").string();
  testing::WriteBytes(a, testing::RandomPng(5));
  testing::WriteBytes(b, testing::OtherViewPng(5));
  const auto shell = [this](const std::string& arguments) {
    return testing::Program(
               {"-c", "cd " + (out_ / ".").string() + "; " + testing::PliantPath().string() +
                          " match " + arguments + " --descriptor rootsift"},
               {}, "/bin/sh")
        .Wait();
  };
  EXPECT_EQ(shell("a.png b.png --draw named.png").status, 0);
  EXPECT_EQ(shell("- b.png --draw first.png < a.png").status, 0);
  EXPECT_EQ(shell("a.png - --draw second.png < b.png").status, 0);
  const ProgramResult piped = shell("a.png - --draw - < b.png > piped.png");
  EXPECT_EQ(piped.status, 0) << piped.err;
  EXPECT_THAT(piped.err, HasSubstr("mutual matches")) << "where it is not part of the image";
  for (const char* name : {"first.png", "second.png", "piped.png"})
    EXPECT_EQ(testing::ReadBytes(out_ / name), testing::ReadBytes(out_ / "named.png")) << name;

  const ProgramResult both = shell("- - < a.png");
  EXPECT_EQ(both.status, 2);
  EXPECT_THAT(both.err, HasSubstr("only one of the two images can be standard input"));
  const ProgramResult twice = shell("a.png b.png --draw - --json");
  EXPECT_EQ(twice.status, 2);
  EXPECT_THAT(twice.err, HasSubstr("--draw - and --json would both write to standard output"));
}

TEST_F(CliMatching, AnUnwritableImageIsSaidBeforeTheWork) {
  const std::string file = (out_ / "absent" / "x.png").string();
  for (const std::vector<std::string>& command :
       {std::vector<std::string>{"match", "a.png", "b.png", "--draw"},
        {"track", "a.png", "b.mp4", "--sheet"}}) {
    std::vector<std::string> arguments = command;
    arguments.insert(arguments.end(), {file, "--json"});
    const ProgramResult result = RunProgram(arguments);
    EXPECT_EQ(result.json()["error"]["code"], "write_failed") << result.err;
  }
}

TEST_F(CliMatching, AnImageIsNotOverwrittenByTheDrawing) {
  const std::string a = (out_ / "a.png").string(), b = (out_ / "b.png").string();
  testing::WriteBytes(a, testing::RandomPng(5));
  testing::WriteBytes(b, testing::OtherViewPng(5));
  for (const std::string& drawing : {a, b}) {
    const ProgramResult result = RunProgram({"match", a, b, "--draw", drawing, "--json"});
    EXPECT_EQ(result.status, 2);
    EXPECT_EQ(result.json()["error"]["code"], "same_file");
    EXPECT_THAT(result.err, HasSubstr(drawing + " is an input"));
  }
  EXPECT_EQ(testing::ReadBytes(a), testing::RandomPng(5));
  EXPECT_EQ(testing::ReadBytes(b), testing::OtherViewPng(5));
}

TEST_F(CliMatching, WhatWasMeantIsSaid) {
  const auto says = [](std::vector<std::string> arguments) {
    const ProgramResult result = RunProgram(arguments);
    EXPECT_EQ(result.status, 2) << result.err;
    return result.err;
  };
  EXPECT_THAT(says({"eval", "matching", At("pairs"), "--descriptor", "sift,mine:dael=x.bin"}),
              HasSubstr("did you mean deal?"));
  EXPECT_THAT(says({"eval", "matching", At("pairs"), "--layout", "folder"}),
              HasSubstr("did you mean folders?"));
  EXPECT_THAT(says({"eval", "tracking", At("pairs"), "--descriptor", "rotsift"}),
              HasSubstr("did you mean rootsift?"));
  EXPECT_THAT(says({"simulate", "--textures", "procedural", "--out", "x", "--preset", "objets"}),
              HasSubstr("did you mean objects?"));
}

TEST_F(CliMatching, MatchJudgesByAHomography) {
  testing::WriteBytes(out_ / "a.png", testing::RandomPng(5));
  testing::WriteBytes(out_ / "b.png", testing::OtherViewPng(5));  // shifted by (5, 3)
  testing::WriteText(out_ / "right.txt", "1 0 5 0 1 3 0 0 1");
  testing::WriteText(out_ / "wrong.txt", "1 0 50 0 1 3 0 0 1");
  const auto correct = [this](const std::string& homography) {
    const ProgramResult result =
        RunProgram({"match", (out_ / "a.png").string(), (out_ / "b.png").string(), "--descriptor",
                    "sift", "--homography", (out_ / homography).string(), "--json"});
    EXPECT_EQ(result.status, 0) << result.err;
    return result.json()["correct"].get<int>();
  };
  EXPECT_GT(correct("right.txt"), 30);
  EXPECT_LT(correct("wrong.txt"), 5);
  const ProgramResult unknown =
      RunProgram({"match", (out_ / "a.png").string(), (out_ / "b.png").string(), "--descriptor",
                  "orb", "--json"});
  ASSERT_EQ(unknown.status, 0) << unknown.err;
  EXPECT_TRUE(unknown.json()["correct"].is_null());
  EXPECT_EQ(RunProgram({"match", (out_ / "a.png").string(), (out_ / "none.png").string()}).status,
            1);
}

}  // namespace
}  // namespace pliant
