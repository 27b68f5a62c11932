// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The layouts that the matching benchmark reads.
#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "descriptor/evaluation/dataset.h"
#include "descriptor/image/cv_image.h"
#include "descriptor/simulation/procedural.h"
#include "descriptor/simulation/scene_file.h"
#include "descriptor/simulation/scene_folder.h"
#include "tests/unit/expect_error.h"
#include "tests/unit/index_test_images.h"

namespace pliant::evaluation {
namespace {

namespace fs = std::filesystem;
using pliant::testing::ExpectError;

class MatchingDataset : public ::testing::Test {
 protected:
  static simulation::Scene MakeScene(simulation::Preset preset, int views, int channels = 1) {
    static const simulation::TextureSource textures = simulation::ProceduralTextures(8, 5, 160);
    simulation::SceneOptions options;
    options.preset = preset;
    options.views = views;
    options.width = 200;
    options.height = 150;
    options.channels = channels;
    return simulation::MakeScene(textures, options, 7, 1);
  }
  void WriteTextFile(const std::string& name, const std::string& text) {
    pliant::testing::WriteText(folder_ / name, text);
  }
  void WriteImage(const std::string& name, const cv::Mat& image) {
    fs::create_directories((folder_ / name).parent_path());
    ASSERT_TRUE(cv::imwrite((folder_ / name).string(), image));
  }
  pliant::testing::TemporaryFolder folder_;
};

// Where the simulator itself says that the surface point under pixel (x, y) of view 0 is in view 1.
std::optional<Vec2> Projected(const simulation::Scene& scene, int x, int y) {
  const simulation::View& from = scene.views[0];
  const std::size_t pixel = static_cast<std::size_t>(y * from.image.width + x);
  const std::size_t chart = from.chart[pixel];
  if (chart == 255) return std::nullopt;
  const double column = from.uv[2 * pixel] / 65535.0 * (scene.grid_columns - 1);
  const double row = from.uv[2 * pixel + 1] / 65535.0 * (scene.grid_rows - 1);
  const int c = std::min(static_cast<int>(column), scene.grid_columns - 2);
  const int r = std::min(static_cast<int>(row), scene.grid_rows - 2);
  const auto at = [&](int rr, int cc) {
    const std::size_t vertices = static_cast<std::size_t>(scene.grid_rows * scene.grid_columns);
    return scene.views[1]
        .grid[chart * vertices + static_cast<std::size_t>(rr * scene.grid_columns + cc)];
  };
  const auto fc = static_cast<float>(column - c);
  const auto fr = static_cast<float>(row - r);
  const Eigen::Array2f top = at(r, c) * (1 - fc) + at(r, c + 1) * fc;
  const Eigen::Array2f bottom = at(r + 1, c) * (1 - fc) + at(r + 1, c + 1) * fc;
  const Eigen::Array2f place = top * (1 - fr) + bottom * fr;
  if (!place.isFinite().all()) return std::nullopt;
  return Vec2{place.x(), place.y()};
}

// The truth read from disk agrees with the grid of vertices, which it does not use.
void ExpectTruthOf(const simulation::Scene& scene, TruthScene& truth) {
  ASSERT_EQ(truth.views(), static_cast<int>(scene.views.size()));
  const Image& image = truth.ViewImage(0);
  int seen = 0, near = 0;
  for (int y = 0; y < image.height; y += 2) {
    for (int x = 0; x < image.width; x += 2) {
      const Vec2 place{static_cast<double>(x), static_cast<double>(y)};
      const bool on = scene.views[0].chart[static_cast<std::size_t>(y * image.width + x)] != 255;
      EXPECT_EQ(truth.OnObject(0, place), on);
      const std::optional<Vec2> mapped = truth.Map(0, place, 1);
      EXPECT_TRUE(on || !mapped);
      if (!mapped) continue;
      const std::optional<Vec2> expected = Projected(scene, x, y);
      if (!expected) continue;  // at the border of a T-shirt
      ++seen;
      near += std::hypot(mapped->x - expected->x, mapped->y - expected->y) < 1.0 ? 1 : 0;
    }
  }
  EXPECT_GT(seen, 300);
  EXPECT_GT(near, 0.98 * seen);  // the rest lies at folds
}

TEST_F(MatchingDataset, TensorScenesHaveTheSimulatorsTruth) {
  const simulation::Scene scene = MakeScene(simulation::Preset::kPairs, 3);
  simulation::WriteSceneFile(folder_ / "scene_000001.safetensors", scene);
  const Dataset dataset = OpenDataset(folder_.path());
  EXPECT_EQ(dataset.layout, Layout::kTensors);
  EXPECT_EQ(dataset.sweep, "");
  ASSERT_EQ(dataset.scenes.size(), 1U);
  EXPECT_EQ(dataset.scenes[0].pairs.size(), 3U);  // 0-1, 0-2, 1-2
  const auto truth = dataset.scenes[0].load();
  EXPECT_EQ(truth->ViewImage(2).pixels, scene.views[2].image.pixels);
  ExpectTruthOf(scene, *truth);
}

TEST_F(MatchingDataset, FoldersHaveTheSimulatorsTruth) {
  const simulation::Scene scene = MakeScene(simulation::Preset::kPairs, 2, 3);
  simulation::WriteSceneFolder(folder_ / "scene_000001", scene);
  const Dataset dataset = OpenDataset(folder_.path());
  EXPECT_EQ(dataset.layout, Layout::kFolders);
  ASSERT_EQ(dataset.scenes.size(), 1U);
  const auto truth = dataset.scenes[0].load();
  EXPECT_EQ(truth->ViewImage(0).channels, 1);
  ExpectTruthOf(scene, *truth);
  // Two images alone are enough to know it.
  const fs::path inside = folder_ / "scene_000001";
  const auto pair = FindTruth(inside / "view_00.png", inside / "view_01.png");
  ASSERT_TRUE(pair);
  ExpectTruthOf(scene, *pair);
}

TEST_F(MatchingDataset, SweepsStartFromTheReferenceAndKnowTheirValues) {
  const simulation::Scene rotation = MakeScene(simulation::Preset::kRotation, 4);
  simulation::WriteSceneFolder(folder_ / "rotation" / "scene_000001", rotation);
  const Dataset turned = OpenDataset(folder_ / "rotation");
  EXPECT_EQ(turned.sweep, "rotation_deg");
  ASSERT_EQ(turned.scenes[0].pairs.size(), 3U);
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(turned.scenes[0].pairs[i].first, 0);
    EXPECT_EQ(turned.scenes[0].pairs[i].second, i + 1);
    EXPECT_DOUBLE_EQ(turned.scenes[0].pairs[i].sweep.value(), 90.0 * i);
  }
  const simulation::Scene scale = MakeScene(simulation::Preset::kScale, 3);
  fs::create_directories(folder_ / "scale");
  simulation::WriteSceneFile(folder_ / "scale" / "scene_000001.safetensors", scale);
  const Dataset shrunk = OpenDataset(folder_ / "scale");
  EXPECT_EQ(shrunk.sweep, "scale");
  EXPECT_DOUBLE_EQ(shrunk.scenes[0].pairs[1].sweep.value(), 0.25);
  // Both at once: a curve over a mixture would mean nothing.
  simulation::WriteSceneFolder(folder_ / "rotation" / "scene_000002",
                               MakeScene(simulation::Preset::kPairs, 2));
  ExpectError(ErrorCode::kCorrupt, "dataset_corrupt", [&] { OpenDataset(folder_ / "rotation"); });
}

TEST_F(MatchingDataset, HomographiesOfHPatches) {
  for (int k = 1; k <= 3; ++k)
    WriteImage("v_wall/" + std::to_string(k) + ".ppm", cv::Mat(80, 100, CV_8UC3, {9, 9, 9}));
  WriteTextFile("v_wall/H_1_2", "1 0 10\n0 1 5\n0 0 1\n");
  WriteTextFile("v_wall/H_1_3", "0.5 0 0\n0 0.5 0\n0 0 1\n");
  const Dataset dataset = OpenDataset(folder_.path());
  EXPECT_EQ(dataset.layout, Layout::kHomography);
  ASSERT_EQ(dataset.scenes.size(), 1U);
  ASSERT_EQ(dataset.scenes[0].pairs.size(), 2U);
  EXPECT_EQ(dataset.scenes[0].pairs[0].group, "viewpoint");
  const auto truth = dataset.scenes[0].load();
  EXPECT_EQ(truth->Map(0, {20, 30}, 1), (Vec2{30, 35}));
  EXPECT_EQ(truth->Map(1, {30, 35}, 2), (Vec2{10, 15}));  // through the first image
  EXPECT_FALSE(truth->Map(0, {95, 30}, 1));               // leaves the frame
  EXPECT_TRUE(truth->Counts(0, {20, 30}, 1));
  EXPECT_FALSE(truth->Counts(0, {95, 30}, 1));
  EXPECT_FALSE(truth->Counts(1, {5, 30}, 0));
}

TEST_F(MatchingDataset, OxfordNamesAreReadToo) {
  for (const char* name : {"img1.png", "img2.png"})
    WriteImage(std::string("graf/") + name, cv::Mat(80, 100, CV_8UC1, {9}));
  WriteTextFile("graf/H1to2p", "1 0 10 0 1 5 0 0 1");
  const Dataset dataset = OpenDataset(folder_ / "graf");
  ASSERT_EQ(dataset.scenes.size(), 1U);
  EXPECT_EQ(dataset.scenes[0].name, "graf");
  EXPECT_EQ(dataset.scenes[0].load()->Map(0, {20, 30}, 1), (Vec2{30, 35}));
}

// The object is the whole left part of each image; in the second it is shifted by (7, -4).
TEST_F(MatchingDataset, NonRigidBenchmark) {
  for (int view = 0; view < 2; ++view) {
    const std::string stem = "sequence_000/scenario_00" + std::to_string(view) + "/";
    cv::Mat uv(90, 120, CV_16UC3, cv::Scalar::all(0));
    cv::Mat mask(90, 120, CV_8UC1, cv::Scalar(0));
    for (int y = 0; y < 90; ++y) {
      for (int x = 0; x < 80; ++x) {
        const int a = 200 * (x - 7 * view) + 5000;
        const int b = 200 * (y + 4 * view) + 5000;
        uv.at<cv::Vec3w>(y, x) =
            cv::Vec3w(static_cast<std::uint16_t>(a), static_cast<std::uint16_t>(b), 30000);
        mask.at<std::uint8_t>(y, x) = 255;
      }
    }
    WriteImage(stem + "rgba_00000.png", cv::Mat(90, 120, CV_8UC4, {1, 2, 3, 255}));
    WriteImage(stem + "uv_00000.png", uv);
    WriteImage(stem + "bgmask_00000.png", mask);
    WriteImage(stem + "segmentation_00000.png", cv::Mat(90, 120, CV_8UC1, {5}));
  }
  WriteTextFile("selected_pairs.json",
                R"({"deformation_1": [["/sequence_000/scenario_000/rgba_00000.png",
                                       "sequence_000/scenario_001/rgba_00000.png"]]})");
  const Dataset dataset = OpenDataset(folder_.path());
  EXPECT_EQ(dataset.layout, Layout::kNonRigid);
  ASSERT_EQ(dataset.scenes.size(), 1U);
  EXPECT_EQ(dataset.scenes[0].pairs[0].group, "deformation_1");
  const auto truth = dataset.scenes[0].load();
  const std::optional<Vec2> mapped = truth->Map(0, {20.25, 30.5}, 1);
  ASSERT_TRUE(mapped);
  EXPECT_NEAR(mapped->x, 27.25, 1e-3);
  EXPECT_NEAR(mapped->y, 26.5, 1e-3);
  EXPECT_FALSE(truth->Map(0, {76, 30}, 1));  // beyond the edge there
  EXPECT_FALSE(truth->OnObject(0, {100, 30}));
  const fs::path sequence = folder_ / "sequence_000";
  EXPECT_TRUE(FindTruth(sequence / "scenario_000/rgba_00000.png",
                        sequence / "scenario_001/rgba_00000.png"));
}

TEST_F(MatchingDataset, FaultsAreNamed) {
  const auto open = [this] { OpenDataset(folder_.path()); };
  ExpectError(ErrorCode::kNotFound, "dataset_not_found", open);
  ExpectError(ErrorCode::kNotFound, "dataset_not_found",
              [this] { OpenDataset(folder_ / "nowhere"); });
  ExpectError(ErrorCode::kInvalidArgument, "layout_unknown", [] { ParseLayout("coco"); });
  WriteTextFile("scene_000000.safetensors", "nothing of the kind");
  ExpectError(ErrorCode::kCorrupt, "dataset_corrupt", open);
  fs::remove(folder_ / "scene_000000.safetensors");
  WriteTextFile("a/scene.json", R"({"format": "another"})");
  ExpectError(ErrorCode::kCorrupt, "dataset_corrupt", open);
  fs::remove_all(folder_ / "a");
  WriteTextFile("b/H_1_2", "1 0 0 0 1 0 0 0 1");
  ExpectError(ErrorCode::kCorrupt, "dataset_corrupt", open);  // no images
  WriteImage("b/1.png", cv::Mat(40, 40, CV_8UC1, {1}));
  WriteImage("b/2.png", cv::Mat(40, 40, CV_8UC1, {1}));
  const auto load = [this] { OpenDataset(folder_.path()).scenes[0].load(); };
  load();
  for (const char* wrong : {"1 0 0 0 1 0", "1 0 0 0 1 0 0 0 1 7", "1 0 0 0 1 0 0 0 1 x"}) {
    WriteTextFile("b/H_1_2", wrong);
    ExpectError(ErrorCode::kCorrupt, "homography_unreadable", load);
  }
  WriteTextFile("b/H_1_2", "1 0 0 1 0 0 0 0 1");
  ExpectError(ErrorCode::kInvalidArgument, "homography_singular", load);
  fs::remove_all(folder_ / "b");
  WriteTextFile("selected_pairs.json", R"({"split": [["one.png"]]})");
  ExpectError(ErrorCode::kCorrupt, "dataset_corrupt", open);
}

TEST_F(MatchingDataset, NoTruthIsKnownOfAnyTwoImages) {
  WriteImage("a.png", cv::Mat(40, 40, CV_8UC1, {1}));
  EXPECT_EQ(FindTruth(folder_ / "a.png", folder_ / "a.png"), nullptr);
}

}  // namespace
}  // namespace pliant::evaluation
