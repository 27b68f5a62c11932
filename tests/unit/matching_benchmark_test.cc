// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/evaluation/matching_benchmark.h"

#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "descriptor/simulation/procedural.h"
#include "descriptor/simulation/scene_folder.h"
#include "tests/unit/expect_error.h"
#include "tests/unit/image_files.h"
#include "tests/unit/index_test_images.h"

namespace pliant::evaluation {
namespace {

using pliant::testing::ExpectError;

// Images of one flat thing, each turned by 20 degrees more and darker.
class MatchingBenchmark : public ::testing::Test {
 protected:
  MatchingBenchmark() {
    const cv::Mat flat = pliant::testing::NoiseImage(240, 200, 4);
    for (int k = 1; k <= 3; ++k) {
      const cv::Mat turn = cv::getRotationMatrix2D({119.5F, 99.5F}, 20.0 * (k - 1), 1.0);
      cv::Mat turned;
      cv::warpAffine(flat, turned, turn, flat.size(), cv::INTER_CUBIC, cv::BORDER_REFLECT);
      turned.convertTo(turned, CV_8U, 1.0 - 0.1 * k);
      Write("i_thing/" + std::to_string(k) + ".png", turned);
      if (k > 1) WriteHomography("i_thing/H_1_" + std::to_string(k), turn);
    }
    // The same image twice: nothing can go wrong.
    Write("v_same/1.png", flat);
    Write("v_same/2.png", flat);
    pliant::testing::WriteText(folder_ / "v_same/H_1_2", "1 0 0 0 1 0 0 0 1");
  }
  void Write(const std::string& name, const cv::Mat& image) {
    pliant::testing::WriteBytes(folder_ / name, pliant::testing::EncodeAs(image, ".png"));
  }
  void WriteHomography(const std::string& name, const cv::Mat& affine) {
    std::string text;
    for (int i = 0; i < 6; ++i) text += std::to_string(affine.at<double>(i / 3, i % 3)) + " ";
    pliant::testing::WriteText(folder_ / name, text + "0 0 1");
  }
  static MatchingOptions Options(const std::vector<std::string>& descriptors) {
    MatchingOptions options;
    for (const std::string& text : descriptors)
      options.descriptors.push_back(ParseDescriptorChoice(text));
    options.max_keypoints = 150;
    options.jobs = 1;
    return options;
  }
  static const DescriptorResult& Row(const std::vector<DescriptorResult>& results,
                                     const char* label) {
    for (const DescriptorResult& r : results) {
      if (r.label == label) return r;
    }
    throw std::out_of_range(label);
  }
  pliant::testing::TemporaryFolder folder_;
};

TEST_F(MatchingBenchmark, FiguresOfImagesWhoseTruthIsKnown) {
  const MatchingReport report = RunMatchingBenchmark(
      OpenDataset(folder_.path()), Options({"sift", "rootsift", "orb", "sift+repeats"}));
  EXPECT_EQ(report.layout, Layout::kHomography);
  EXPECT_EQ(report.pairs, 3);
  EXPECT_EQ(report.left_out, 0);
  ASSERT_EQ(report.results.size(), 4U);
  EXPECT_DOUBLE_EQ(report.results[0].ms_ratio_to_sift, 1);
  EXPECT_GT(report.results[0].mma, 0.9);
  EXPECT_GT(report.results[0].mutual_precision, 0.8);
  EXPECT_GT(report.results[0].correct_matches, 0.5 * report.results[0].true_pairs);
  EXPECT_LE(report.results[0].correct_matches, report.results[0].keypoints);
  ASSERT_EQ(report.groups.size(), 2U);
  EXPECT_EQ(report.groups[0].name, "illumination");
  EXPECT_EQ(report.groups[1].name, "viewpoint");
  for (const DescriptorResult& same : report.groups[1].results) {
    // One of SIFT's repeats may be nearest to another of the same place, which is right, too.
    EXPECT_EQ(same.pairs, 1);
    EXPECT_DOUBLE_EQ(same.ms, 1) << same.label;
    EXPECT_DOUBLE_EQ(same.mma, 1) << same.label;
    EXPECT_DOUBLE_EQ(same.mutual_precision, 1) << same.label;
  }
  const DescriptorResult& repeats = Row(report.results, "sift+repeats");
  EXPECT_EQ(repeats.model_id, "sift:1");
  EXPECT_NE(repeats.ms, report.results[0].ms);
  // The mean of all is the mean of the groups' pairs.
  EXPECT_NEAR(report.results[0].ms,
              (2 * report.groups[0].results[0].ms + report.groups[1].results[0].ms) / 3, 1e-12);
}

// Keypoints of the enlarged image are described there and placed in the image's own pixels:
// described or placed elsewhere, they would match wrongly.
TEST_F(MatchingBenchmark, EnlargedImagesGiveMoreRightMatches) {
  const Dataset dataset = OpenDataset(folder_.path());
  MatchingOptions options = Options({"sift", "rootsift"});
  const MatchingReport plain = RunMatchingBenchmark(dataset, options);
  options.enlarge = true;
  const MatchingReport enlarged = RunMatchingBenchmark(dataset, options);
  ASSERT_EQ(enlarged.pairs, plain.pairs);
  for (std::size_t row = 0; row < plain.results.size(); ++row) {
    const DescriptorResult& before = plain.results[row];
    const DescriptorResult& after = enlarged.results[row];
    EXPECT_GT(after.keypoints, before.keypoints) << after.label;
    EXPECT_GT(after.correct_matches, before.correct_matches) << after.label;
    EXPECT_GT(after.mma, 0.85) << after.label;
  }
  EXPECT_DOUBLE_EQ(enlarged.groups[1].results[0].ms, 1) << "an image and itself";
}

TEST_F(MatchingBenchmark, TheRatioToSiftNeedsNoSiftInTheTable) {
  const Dataset dataset = OpenDataset(folder_.path());
  const MatchingReport with = RunMatchingBenchmark(dataset, Options({"orb", "sift"}));
  const MatchingReport without = RunMatchingBenchmark(dataset, Options({"orb"}));
  ASSERT_EQ(without.results.size(), 1U);
  EXPECT_GT(without.results[0].ms_ratio_to_sift, 0);
  EXPECT_DOUBLE_EQ(without.results[0].ms_ratio_to_sift, with.results[0].ms_ratio_to_sift);
  EXPECT_NEAR(with.results[0].ms_ratio_to_sift, with.results[0].ms / with.results[1].ms, 1e-12);
}

TEST_F(MatchingBenchmark, WeightsAreNamedByLabelOrFile) {
  EXPECT_EQ(ParseDescriptorChoice("deal").label, "deal");
  EXPECT_EQ(ParseDescriptorChoice("deal=runs/planar.safetensors").label, "deal=planar");
  const DescriptorChoice choice = ParseDescriptorChoice("Cartesian:deal-fixed=w.safetensors");
  EXPECT_EQ(choice.label, "Cartesian");
  EXPECT_EQ(choice.name, "deal-fixed");
  EXPECT_EQ(choice.model, "w.safetensors");
  EXPECT_TRUE(ParseDescriptorChoice("sift+repeats").repeats);
  ExpectError(ErrorCode::kInvalidArgument, "unknown_descriptor",
              [] { ParseDescriptorChoice("surf"); });
  ExpectError(ErrorCode::kInvalidArgument, "descriptor_invalid",
              [] { ParseDescriptorChoice("sift=w.safetensors"); });
  ExpectError(ErrorCode::kInvalidArgument, "descriptor_twice", [this] {
    RunMatchingBenchmark(OpenDataset(folder_.path()), Options({"sift", "sift"}));
  });
}

TEST_F(MatchingBenchmark, OptionsOutOfRangeAreRefused) {
  const Dataset dataset = OpenDataset(folder_.path());
  MatchingOptions options = Options({"sift"});
  options.max_keypoints = 0;
  ExpectError(ErrorCode::kInvalidArgument, "option_out_of_range",
              [&] { RunMatchingBenchmark(dataset, options); });
  options = Options({"sift"});
  options.tolerance_px = 0;
  ExpectError(ErrorCode::kInvalidArgument, "option_out_of_range",
              [&] { RunMatchingBenchmark(dataset, options); });
  options = Options({"sift"});
  options.min_true_pairs = 100000;
  ExpectError(ErrorCode::kUnprocessable, "no_pairs",
              [&] { RunMatchingBenchmark(dataset, options); });
  options = Options({"sift"});
  options.progress = [](std::uint64_t, std::uint64_t) { return false; };
  ExpectError(ErrorCode::kCancelled, "evaluation_stopped",
              [&] { RunMatchingBenchmark(dataset, options); });
}

class SimulatedBenchmark : public ::testing::Test {
 protected:
  Dataset Make(const std::string& preset, int scenes, int views) {
    static const simulation::TextureSource textures = simulation::ProceduralTextures(6, 5, 200);
    simulation::SceneOptions options;
    options.preset = simulation::ParsePreset(preset);
    options.views = views;
    options.width = 240;
    options.height = 180;
    options.strength = 0.5F;
    for (int i = 0; i < scenes; ++i) {
      simulation::WriteSceneFolder(folder_ / preset / ("scene_" + std::to_string(i)),
                                   simulation::MakeScene(textures, options, 3, i));
    }
    return OpenDataset(folder_ / preset);
  }
  static MatchingOptions Options(int jobs) {
    MatchingOptions options;
    options.descriptors = {ParseDescriptorChoice("sift"), ParseDescriptorChoice("orb")};
    options.max_keypoints = 300;
    options.min_true_pairs = 4;
    options.jobs = jobs;
    return options;
  }
  pliant::testing::TemporaryFolder folder_;
};

TEST_F(SimulatedBenchmark, DoesNotDependOnJobsOrOnProgress) {
  const Dataset dataset = Make("pairs", 3, 3);
  MatchingOptions alone = Options(1);
  MatchingOptions many = Options(3);
  std::uint64_t last = 0;
  many.progress = [&](std::uint64_t done, std::uint64_t total) {
    EXPECT_EQ(total, 9U);
    last = done;
    return true;
  };
  const MatchingReport a = RunMatchingBenchmark(dataset, alone);
  const MatchingReport b = RunMatchingBenchmark(dataset, many);
  EXPECT_EQ(last, 9U);
  EXPECT_EQ(a.pairs + a.left_out, 9);
  EXPECT_EQ(a.pairs, b.pairs);
  for (std::size_t row = 0; row < 2; ++row) {
    EXPECT_EQ(a.results[row].ms, b.results[row].ms);
    EXPECT_EQ(a.results[row].mma, b.results[row].mma);
    EXPECT_EQ(a.results[row].mutual_precision, b.results[row].mutual_precision);
  }
  // A choice of pairs: so many that can be measured, the same for a seed.
  alone.pairs = many.pairs = 3;
  many.progress = nullptr;
  const MatchingReport c = RunMatchingBenchmark(dataset, alone);
  const MatchingReport d = RunMatchingBenchmark(dataset, many);
  EXPECT_EQ(c.pairs, 3);
  EXPECT_EQ(c.results[0].ms, d.results[0].ms);
  EXPECT_EQ(c.left_out, d.left_out);
}

TEST_F(SimulatedBenchmark, SweepsMakeCurves) {
  const Dataset dataset = Make("rotation", 2, 4);
  const MatchingReport report = RunMatchingBenchmark(dataset, Options(0));
  EXPECT_EQ(report.sweep, "rotation_deg");
  ASSERT_EQ(report.curve.size(), 3U);
  double sum = 0;
  int pairs = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_DOUBLE_EQ(report.curve[i].value, 90.0 * static_cast<double>(i));
    sum += report.curve[i].results[0].ms * report.curve[i].results[0].pairs;
    pairs += report.curve[i].results[0].pairs;
  }
  EXPECT_EQ(pairs, report.pairs);
  EXPECT_NEAR(sum / pairs, report.results[0].ms, 1e-12);
  EXPECT_GT(CurveFlatness(report, 0), 0);
  EXPECT_LE(CurveFlatness(report, 0), 1);
}

TEST_F(SimulatedBenchmark, PairsAreDrawnFromAsManyScenesAsThereAre) {
  const Dataset dataset = Make("pairs", 3, 3);
  const std::vector<PairCandidate> order = ShufflePairs(dataset, 5);
  ASSERT_EQ(order.size(), 9U);
  for (std::size_t round = 0; round < 3; ++round) {
    std::vector<bool> seen(3);
    for (std::size_t i = 0; i < 3; ++i) seen[order[3 * round + i].scene] = true;
    EXPECT_EQ(seen, std::vector<bool>(3, true));
  }
  const std::vector<PairCandidate> again = ShufflePairs(dataset, 5);
  for (std::size_t i = 0; i < order.size(); ++i) {
    EXPECT_EQ(order[i].scene, again[i].scene);
    EXPECT_EQ(order[i].pair.first, again[i].pair.first);
    EXPECT_EQ(order[i].pair.second, again[i].pair.second);
  }
}

}  // namespace
}  // namespace pliant::evaluation
