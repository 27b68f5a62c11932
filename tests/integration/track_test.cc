// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// pliant track, the real program: a bending sheet, real videos, and what cannot be tracked.
#include <sstream>
#include <tuple>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "descriptor/image/video.h"
#include "tests/integration/program.h"
#include "tests/unit/bent_images.h"

namespace pliant::testing {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;
using Json = nlohmann::json;

constexpr int kFrames = 5;
const std::filesystem::path kVideos = "/usr/share/doc/opencv-doc/examples/data";

std::vector<Json> Lines(const std::string& text) {
  std::vector<Json> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(Json::parse(line));
  return lines;
}

class TrackTest : public ::testing::Test {
 protected:
  TrackTest() {
    const Image reference = RichImage(1);
    WriteBytes(folder_ / "reference.png", EncodePng(reference));
    VideoWriter writer(folder_ / "clip.avi", 400, 300, 10);
    for (int i = 0; i < kFrames; ++i) {
      const Bend bend{0.2 * i, 12.0 * i, {2.0 * i, 0}};
      const Image frame = i == 3 ? RichImage(77) : BentImage(reference, bend);
      writer.Write(frame);
      WriteBytes(folder_ / "frames" / ("f" + std::to_string(i + 8) + ".png"), EncodePng(frame));
    }
    writer.Close();
  }
  ProgramResult Track(const std::string& input, const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments = {"track", Path("reference.png"), Path(input),
                                          "--descriptor", "rootsift"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return RunProgram(arguments);
  }
  std::string Path(const std::string& name) const { return (folder_ / name).string(); }

  TemporaryFolder folder_;
};

TEST_F(TrackTest, ALineOfJsonAFrame) {
  for (const char* input : {"clip.avi", "frames"}) {
    const ProgramResult result = Track(input, {"--json"});
    ASSERT_EQ(result.status, 0) << result.err;
    const std::vector<Json> lines = Lines(result.out);
    ASSERT_EQ(lines.size(), kFrames + 1U);
    for (int i = 0; i < kFrames; ++i) {
      const Json& line = lines[static_cast<std::size_t>(i)];
      EXPECT_EQ(line["frame"], i);
      EXPECT_EQ(line["found"], i != 3) << line.dump();
      EXPECT_EQ(line["reason"].is_null(), i != 3);
      EXPECT_EQ(line.contains("time_s"), std::string(input) == "clip.avi");
      EXPECT_EQ(line.contains("file"), std::string(input) == "frames");
      if (i == 3) continue;
      EXPECT_GT(line["inliers"], 50);
      EXPECT_GT(line["inlier_rate"], 0.5);
      EXPECT_GE(line["outline"].size(), 3U);
      const Bend bend{0.2 * i, 12.0 * i, {2.0 * i, 0}};
      const Json& mesh = line["mesh"];
      const int middle =
          mesh["rows"].get<int>() / 2 * mesh["columns"].get<int>() + mesh["columns"].get<int>() / 2;
      const Vec2 truth = bend.ToFrame({199.5, 149.5});
      EXPECT_NEAR(mesh["points"][middle][0].get<double>(), truth.x, 2.5);
      EXPECT_NEAR(mesh["points"][middle][1].get<double>(), truth.y, 2.5);
    }
    const Json& summary = lines.back()["summary"];
    EXPECT_EQ(summary["frames"], kFrames);
    EXPECT_EQ(summary["found"], kFrames - 1);
    EXPECT_GT(summary["frames_per_second"], 0.0);
    EXPECT_EQ(summary["template"]["region"], (Json{0, 0, 400, 300}));
  }
}

TEST_F(TrackTest, VideosImagesAndContactSheets) {
  const ProgramResult video =
      Track("clip.avi", {"--out", Path("out.mp4"), "--sheet", Path("sheet.png"), "--every", "2"});
  ASSERT_EQ(video.status, 0) << video.err;
  EXPECT_THAT(video.out, StartsWith("frame 0"));
  EXPECT_THAT(video.out, HasSubstr("frames/s"));
  VideoReader reader(Path("out.mp4"));
  EXPECT_EQ(reader.info().height, 300);
  EXPECT_GT(reader.info().width, 800);
  EXPECT_NEAR(reader.info().frames_per_second, 5, 0.1);
  int frames = 0;
  while (reader.Next()) ++frames;
  EXPECT_EQ(frames, 3);
  EXPECT_GT(DecodeImage(ReadBytes(Path("sheet.png"))).image.width, 600);

  const ProgramResult images = Track("frames", {"--out", Path("out")});
  ASSERT_EQ(images.status, 0) << images.err;
  for (int i = 0; i < kFrames; ++i) {
    EXPECT_TRUE(std::filesystem::exists(Path("out/frame_00000" + std::to_string(i) + ".jpg")));
  }
}

TEST_F(TrackTest, RegionsAndMasks) {
  const auto summary = [&](const std::vector<std::string>& more) {
    std::vector<std::string> arguments = {"--json"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const ProgramResult result = Track("frames", arguments);
    EXPECT_EQ(result.status, 0) << result.err;
    return Lines(result.out).back()["summary"];
  };
  Image mask{400, 300, 1, std::vector<std::uint8_t>(120000, 0)};
  for (std::size_t i = 40000; i < 80000; ++i) mask.pixels[i] = 255;
  WriteBytes(folder_ / "mask.png", EncodePng(mask));
  EXPECT_EQ(summary({"--region", "50,40,200,150"})["template"]["region"], (Json{50, 40, 200, 150}));
  const Json masked = summary({"--mask", Path("mask.png")});
  EXPECT_EQ(masked["template"]["region"], (Json{0, 100, 400, 100}));
  EXPECT_EQ(masked["found"], kFrames - 1);
}

TEST_F(TrackTest, WhatCannotBeTrackedIsSaid) {
  WriteText(folder_ / "text.mp4", "no video");
  WriteText(folder_ / "empty.avi", "");
  std::filesystem::create_directory(folder_ / "nothing");
  WriteBytes(folder_ / "varying" / "a.png", EncodePng(RandomImage(1, 100, 100)));
  WriteBytes(folder_ / "varying" / "b.png", EncodePng(RandomImage(1, 100, 101)));
  WriteBytes(folder_ / "single" / "a.png", EncodePng(RandomImage(1, 100, 100)));
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"nowhere.mp4", "cannot_read"},   {"text.mp4", "video_unreadable"},
      {"empty.avi", "video_empty"},     {"nothing", "no_frames"},
      {"varying", "frames_vary"},       {"single", "single_frame"},
      {"reference.png", "single_frame"}};
  for (const auto& [input, code] : cases) {
    const ProgramResult result = Track(input, {"--json"});
    EXPECT_EQ(result.status, 1) << input;
    EXPECT_EQ(Lines(result.out).back()["error"]["code"], code) << result.out;
    EXPECT_THAT(result.err, HasSubstr(input));
  }
  for (const std::vector<std::string>& wrong : std::vector<std::vector<std::string>>{
           {"--region", "1,2,3"},
           {"--region", "390,0,50,50"},
           {"--every", "0"},
           {"--iterations", "0"},
           {"--max-ratio", "2"},
           {"--tolerance", "0"},
           {"--min-inliers", "2"},
           {"--sheet", Path("sheet.txt")},
           {"--descriptor", "nonsense"},
           {"--mask", Path("frames/f8.png"), "--region", "0,0,5,5"}}) {
    EXPECT_EQ(Track("frames", wrong).status, 2) << ::testing::PrintToString(wrong);
  }
  for (const char* input : {"frames", "nowhere.mp4"}) {  // said before anything is looked at
    const ProgramResult gif = Track(input, {"--out", Path("o.gif")});
    EXPECT_EQ(gif.status, 2);
    EXPECT_THAT(gif.err, HasSubstr("cannot write .gif files"));
    EXPECT_FALSE(std::filesystem::exists(Path("o.gif")));
    EXPECT_EQ(Track(input, {"--out", Path("nowhere/x.mp4")}).status, 1);
  }
  const ProgramResult image = Track("reference.png");
  EXPECT_THAT(image.err, HasSubstr("is an image"));
  EXPECT_EQ(image.out, "");
  for (const char* folder : {"run.2", "o.gif/"}) {
    EXPECT_EQ(Track("frames", {"--out", Path(folder), "--every", "4"}).status, 0);
    EXPECT_TRUE(std::filesystem::exists(Path(folder) + "/frame_000000.jpg"));
  }
  EXPECT_EQ(Track("frames", {"--out", "/nowhere/at/all/x.mp4"}).status, 1);
  EXPECT_EQ(Track("frames", {"--out", "/proc/nowhere"}).status, 1);

  std::vector<std::uint8_t> png = RandomPng(5);
  png.resize(png.size() / 2);
  WriteBytes(folder_ / "frames" / "f9.png", png);  // 160 x 120 by its header
  EXPECT_EQ(Track("frames").status, 1) << "of another size";
  png = EncodePng(RichImage(5));
  png.resize(png.size() / 2);
  WriteBytes(folder_ / "frames" / "f9.png", png);
  const ProgramResult damaged = Track("frames", {"--json"});
  EXPECT_EQ(damaged.status, 3) << damaged.err;
  EXPECT_EQ(Lines(damaged.out).back()["summary"]["skipped"][0]["file"], "f9.png");
}

TEST_F(TrackTest, NothingThatIsReadIsOverwritten) {
  const std::vector<std::uint8_t> clip = ReadBytes(Path("clip.avi"));
  const std::vector<std::uint8_t> reference = ReadBytes(Path("reference.png"));
  for (const auto& [input, flag, written] :
       {std::tuple{"clip.avi", "--out", "clip.avi"}, std::tuple{"frames", "--out", "frames"},
        std::tuple{"frames", "--out", "frames/../frames/"},
        std::tuple{"frames", "--sheet", "reference.png"}}) {
    const ProgramResult result = Track(input, {flag, Path(written)});
    EXPECT_EQ(result.status, 2) << written;
    EXPECT_THAT(result.err, HasSubstr(Path(written) + " is an input"));
    EXPECT_EQ(result.out, "");
  }
  EXPECT_EQ(ReadBytes(Path("clip.avi")), clip);
  EXPECT_EQ(ReadBytes(Path("reference.png")), reference);
  EXPECT_FALSE(std::filesystem::exists(Path("frames/frame_000000.jpg")));
}

// A real video: what its first frame shows is found in the later ones, and admitted to be lost in
// another film.
TEST(TrackRealVideo, RunsThroughAndAdmitsLosses) {
  ASSERT_TRUE(std::filesystem::exists(kVideos / "vtest.avi"))
      << "install Debian's package opencv-doc, as tests/run.sh does";
  const TemporaryFolder folder;
  VideoReader video(kVideos / "vtest.avi");
  const auto first = video.Next();
  ASSERT_TRUE(first);
  WriteBytes(folder / "first.png", EncodePng(*first));
  for (const auto& [film, frames, found] :
       {std::tuple{"vtest.avi", 4, true}, std::tuple{"Megamind.avi", 3, false}}) {
    const ProgramResult result =
        RunProgram({"track", (folder / "first.png").string(), (kVideos / film).string(),
                    "--descriptor", "rootsift", "--every", found ? "200" : "100", "--json"});
    ASSERT_EQ(result.status, 0) << result.err;
    const std::vector<Json> lines = Lines(result.out);
    ASSERT_EQ(lines.size(), frames + 1U) << film;
    for (int i = 0; i < frames; ++i) {
      const Json& line = lines[static_cast<std::size_t>(i)];
      EXPECT_EQ(line["found"], found) << film << ": " << line["inliers"];
      EXPECT_EQ(line["reason"].is_null(), found);
    }
  }
  // Black: there is nothing to follow, and that is said.
  const ProgramResult black = RunProgram({"track", (kVideos / "opencv-logo-white.png").string(),
                                          (kVideos / "vtest.avi").string(), "--region", "0,0,20,20",
                                          "--descriptor", "orb"});
  EXPECT_EQ(black.status, 1);
  EXPECT_THAT(black.err, HasSubstr("keypoints"));
}

}  // namespace
}  // namespace pliant::testing
