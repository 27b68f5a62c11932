// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Whole sets on disk: reproducibility, resuming, layouts, refusals.
#include "descriptor/simulation/simulate.h"

#include <atomic>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <map>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <unistd.h>

#include "descriptor/base/error.h"
#include "descriptor/simulation/photo.h"
#include "descriptor/simulation/procedural.h"
#include "descriptor/simulation/scene.h"

namespace pliant {
namespace {

namespace fs = std::filesystem;

class SimulateTest : public testing::Test {
 protected:
  SimulateTest()
      : root_(fs::temp_directory_path() / ("pliant_simulate_test_" + std::to_string(::getpid()))) {
    fs::remove_all(root_);
    fs::create_directories(root_ / "textures");
    for (int i = 0; i < 3; ++i) {
      const Image image =
          simulation::PaintProcedural(static_cast<simulation::ProceduralKind>(i), 40, 96);
      const std::vector<std::uint8_t> bytes = EncodeJpeg(image);
      Write(root_ / "textures" / ("t" + std::to_string(i) + ".jpg"),
            std::string(bytes.begin(), bytes.end()));
    }
  }
  ~SimulateTest() override {
    std::error_code ignored;
    fs::remove_all(root_, ignored);
  }
  static void Write(const fs::path& path, const std::string& content) {
    std::ofstream(path, std::ios::binary) << content;
  }
  SimulateOptions Options(const std::string& out) const {
    SimulateOptions options;
    options.textures = (root_ / "textures").string();
    options.out = (root_ / out).string();
    options.scenes = 3;
    options.views = 2;
    options.width = 96;
    options.height = 72;
    options.jobs = 1;
    return options;
  }
  // All files below the folder with their bytes.
  std::map<std::string, std::string> Contents(const std::string& out) const {
    std::map<std::string, std::string> contents;
    for (const auto& entry : fs::recursive_directory_iterator(root_ / out)) {
      if (!entry.is_regular_file()) continue;
      std::ifstream in(entry.path(), std::ios::binary);
      contents[entry.path().lexically_relative(root_ / out).string()].assign(
          std::istreambuf_iterator<char>(in), {});
    }
    return contents;
  }
  fs::path root_;
};

TEST_F(SimulateTest, SameBytesWhateverTheNumberOfJobs) {
  for (const std::string preset : {"pairs", "objects", "sequence", "rotation", "scale", "planar"}) {
    SCOPED_TRACE(preset);
    SimulateOptions options = Options(preset + "1");
    options.preset = preset;
    options.views = 3;
    const SimulateReport report = Simulate(options);
    EXPECT_EQ(report.scenes, 3);
    EXPECT_EQ(report.images, 9);
    EXPECT_LT(report.worst_stretch, 0.01);
    options.out = (root_ / (preset + "3")).string();
    options.jobs = 3;
    Simulate(options);
    EXPECT_EQ(Contents(preset + "1"), Contents(preset + "3"));
  }
}

TEST_F(SimulateTest, ResumesWithTheSameBytes) {
  const SimulateOptions options = Options("set");
  Simulate(options);
  const auto before = Contents("set");
  fs::remove(root_ / "set" / "scene_000001.safetensors");
  const SimulateReport again = Simulate(options);
  EXPECT_EQ(again.scenes, 1);
  EXPECT_EQ(again.unchanged, 2);
  EXPECT_EQ(Contents("set"), before);
  // A set made in parts is the same set.
  SimulateOptions part = Options("part");
  part.scenes = 1;
  part.first = 2;
  Simulate(part);
  EXPECT_EQ(Contents("part").at("scene_000002.safetensors"), before.at("scene_000002.safetensors"));
}

TEST_F(SimulateTest, AFolderWithScenesOfOtherSettingsIsRefused) {
  Simulate(Options("set"));
  const auto before = Contents("set");
  SimulateOptions larger = Options("set");
  larger.width = 128;
  try {
    Simulate(larger);
    ADD_FAILURE() << "was accepted";
  } catch (const Error& error) {
    EXPECT_EQ(error.reason(), "other_settings");
    EXPECT_THAT(error.what(), testing::HasSubstr("width 96, not width 128"));
  }
  EXPECT_EQ(Contents("set"), before);
  SimulateOptions more = Options("set");
  more.scenes = 4;
  EXPECT_EQ(Simulate(more).scenes, 1);
  // Distractors are numbered after the objects.
  SimulateOptions objects = Options("objects");
  objects.preset = "objects";
  objects.scenes = 1;
  objects.distractors = 1;
  Simulate(objects);
  objects.scenes = 2;
  EXPECT_THROW(Simulate(objects), Error);
}

TEST_F(SimulateTest, StoppingLeavesOnlyCompleteScenes) {
  SimulateOptions options = Options("stopped");
  options.format = "folders";
  options.scenes = 50;
  options.progress = [](std::int64_t done, std::int64_t total) {
    EXPECT_EQ(total, 50);
    return done < 2;
  };
  try {
    Simulate(options);
    ADD_FAILURE() << "did not stop";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kCancelled);
  }
  EXPECT_EQ(Contents("stopped").size(),
            2U * 5U + 1U);  // two images, two truths, scene.json each; settings.txt
}

TEST_F(SimulateTest, BrokenTexturesAreNamedAndSkipped) {
  Write(root_ / "textures" / "broken.jpg", "\xFF\xD8 this is no image");
  Write(root_ / "textures" / "notes.txt", "words");
  Write(root_ / "textures" / "empty.png", "");
  SimulateOptions options = Options("skipping");
  options.scenes = 1;
  const SimulateReport report = Simulate(options);
  EXPECT_EQ(report.textures, 3);
  ASSERT_EQ(report.skipped.size(), 3U);
  EXPECT_THAT(report.skipped[0].file, testing::HasSubstr("broken.jpg"));
  EXPECT_THAT(report.skipped[1].file, testing::HasSubstr("empty.png"));
  EXPECT_FALSE(report.skipped[2].reason.empty());
}

TEST_F(SimulateTest, FolderTruthIsSixteenBitWithChartPlusOne) {
  SimulateOptions options = Options("folders");
  options.format = "folders";
  options.scenes = 1;
  Simulate(options);
  const fs::path scene = root_ / "folders" / "scene_000000";
  const cv::Mat truth = cv::imread((scene / "view_00.uv.png").string(), cv::IMREAD_UNCHANGED);
  const cv::Mat image = cv::imread((scene / "view_00.png").string(), cv::IMREAD_UNCHANGED);
  ASSERT_EQ(truth.type(), CV_16UC3);
  ASSERT_EQ(image.type(), CV_8UC1);
  ASSERT_EQ(truth.size(), image.size());
  double on = 0.0;
  cv::Vec2d mean(0.0, 0.0);
  for (int y = 0; y < truth.rows; ++y) {
    for (int x = 0; x < truth.cols; ++x) {
      const auto& bgr = truth.at<cv::Vec3w>(y, x);
      if (bgr[0] == 0) {
        ASSERT_EQ(bgr[1] + bgr[2], 0);
        continue;
      }
      ASSERT_LE(bgr[0], 2);
      on += 1.0;
      mean += cv::Vec2d(bgr[2], bgr[1]);
    }
  }
  EXPECT_GT(on, 0.1 * truth.total());
  EXPECT_NEAR(mean[0] / on, 32768.0, 6000.0);
  EXPECT_NEAR(mean[1] / on, 32768.0, 6000.0);
  EXPECT_TRUE(fs::exists(scene / "scene.json"));
}

TEST_F(SimulateTest, ObjectsHaveAReferenceAndDistractorsNone) {
  SimulateOptions options = Options("objects");
  options.preset = "objects";
  options.scenes = 2;
  options.distractors = 1;
  options.views = 3;
  Simulate(options);
  std::vector<std::string> names;
  for (const auto& [name, bytes] : Contents("objects")) names.push_back(name);
  EXPECT_THAT(names, testing::ElementsAre("distractor_0003/view_01.jpg",
                                          "distractor_0003/view_02.jpg", "object_0001/ref.jpg",
                                          "object_0001/view_01.jpg", "object_0001/view_02.jpg",
                                          "object_0002/ref.jpg", "object_0002/view_01.jpg",
                                          "object_0002/view_02.jpg", "settings.txt"));
  EXPECT_EQ(
      cv::imread((root_ / "objects/object_0001/ref.jpg").string(), cv::IMREAD_UNCHANGED).channels(),
      3);
}

TEST_F(SimulateTest, BadOptionsAreRefusedByName) {
  using Change = std::function<void(SimulateOptions&)>;
  const fs::path file = root_ / "file";
  Write(file, "x");
  fs::create_directories(root_ / "nothing");
  const std::vector<std::tuple<std::string, ErrorCode, Change>> cases = {
      {"scenes", ErrorCode::kInvalidArgument, [](auto& o) { o.scenes = 0; }},
      {"width", ErrorCode::kInvalidArgument, [](auto& o) { o.width = -1; }},
      {"strength", ErrorCode::kInvalidArgument, [](auto& o) { o.strength = std::nan(""); }},
      {"occluders", ErrorCode::kInvalidArgument,
       [](auto& o) { o.occluders = std::numeric_limits<double>::infinity(); }},
      {"jobs", ErrorCode::kInvalidArgument, [](auto& o) { o.jobs = -2; }},
      {"first", ErrorCode::kInvalidArgument, [](auto& o) { o.first = -1; }},
      {"distractors", ErrorCode::kInvalidArgument, [](auto& o) { o.distractors = 4; }},
      {"preset", ErrorCode::kInvalidArgument, [](auto& o) { o.preset = "cats"; }},
      {"format", ErrorCode::kInvalidArgument, [](auto& o) { o.format = "gif"; }},
      {"textures", ErrorCode::kInvalidArgument, [](auto& o) { o.textures = ""; }},
      {"no usable image", ErrorCode::kInvalidArgument,
       [&](auto& o) { o.textures = (root_ / "nothing").string(); }},
      {"no such texture", ErrorCode::kNotFound,
       [&](auto& o) { o.textures = (root_ / "missing").string(); }},
      {"output folder", ErrorCode::kNoSpace, [&](auto& o) { o.out = (file / "below").string(); }},
  };
  for (const auto& [word, code, change] : cases) {
    SCOPED_TRACE(word);
    SimulateOptions options = Options("refused");
    change(options);
    try {
      Simulate(options);
      ADD_FAILURE() << "accepted";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), code) << error.what();
      EXPECT_THAT(error.what(), testing::HasSubstr(word));
    }
  }
}

// The library's own JPEG is the oracle of the core's imitation.
TEST(SimulationPhoto, JpegArtefactsAreThoseOfJpeg) {
  const Image original =
      simulation::PaintProcedural(simulation::ProceduralKind::kPackaging, 6, 203);
  for (const int quality : {30, 60, 90}) {
    cv::Mat rgb(original.height, original.width, CV_8UC3,
                const_cast<std::uint8_t*>(original.pixels.data()));
    cv::Mat grey;
    cv::cvtColor(rgb, grey, cv::COLOR_RGB2GRAY);
    std::vector<std::uint8_t> bytes;
    cv::imencode(".jpg", grey, bytes, {cv::IMWRITE_JPEG_QUALITY, quality});
    const cv::Mat stored = cv::imdecode(bytes, cv::IMREAD_GRAYSCALE);
    Image image{grey.cols, grey.rows, 1,
                std::vector<std::uint8_t>(grey.data, grey.data + grey.total())};
    simulation::AddJpegArtefacts(image, quality);
    const cv::Mat ours(grey.rows, grey.cols, CV_8UC1, image.pixels.data());
    // Only the last incomplete blocks are padded differently.
    const cv::Rect whole(0, 0, grey.cols / 8 * 8, grey.rows / 8 * 8);
    // A coefficient half way between two steps may be rounded to either.
    cv::Mat difference;
    cv::absdiff(stored(whole), ours(whole), difference);
    EXPECT_LT(cv::countNonZero(difference > 2), 0.04 * whole.area()) << quality;
    EXPECT_LT(cv::norm(stored(whole), ours(whole), cv::NORM_L1) / whole.area(), 0.3) << quality;
    EXPECT_GT(cv::norm(grey(whole), ours(whole), cv::NORM_L1) / whole.area(), 0.5) << quality;
  }
}

}  // namespace
}  // namespace pliant
