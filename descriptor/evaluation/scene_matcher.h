// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Measures pairs of one scene: every view is detected and described once. Internal to this folder.
#pragma once

#include <array>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "descriptor/evaluation/metrics.h"
#include "descriptor/evaluation/truth_scene.h"
#include "descriptor/features/descriptor.h"

namespace pliant::evaluation {

struct Contender {
  std::shared_ptr<const Descriptor> descriptor;
  bool repeats = false;  // at SIFT's keypoints, duplicates included
  std::string label = {};
};

struct MatcherOptions {
  int max_keypoints = 2048;
  bool enlarge = false;
  double tolerance_px = 3;
  int min_true_pairs = 12;
};

// One value per contender.
struct PairMeasurement {
  std::vector<PairFigures> figures;
  std::vector<double> describe_seconds;  // for this pair; 0 if the views were described before
  std::vector<double> described;         // keypoints described in that time
};

// Not thread-safe. `scene` and `contenders` must outlive it.
class SceneMatcher {
 public:
  SceneMatcher(TruthScene& scene, const std::vector<Contender>& contenders,
               const MatcherOptions& options)
      : scene_(scene), contenders_(contenders), options_(options) {}

  // nullopt when the shared keypoints give fewer than min_true_pairs true pairs. One thread.
  std::optional<PairMeasurement> Measure(int first, int second);

 private:
  // A view's keypoints on the object, and their descriptors.
  struct ViewFeatures {
    std::vector<Keypoint> keypoints;
    // Enlarged, and where the last inside.size() of `keypoints` are in it.
    Image enlarged;
    std::vector<Keypoint> inside;
    std::map<std::size_t, Descriptors> descriptors;  // by contender
  };
  // The keypoints of both views that count in this pair, and the truth between them.
  struct PairTruth {
    std::array<std::vector<std::uint32_t>, 2> rows;  // of ViewFeatures
    std::vector<Keypoint> second;
    std::vector<std::optional<Vec2>> positions;
    std::vector<TruePair> true_pairs;
  };
  ViewFeatures& Features(int view, bool repeats);
  PairTruth FindTruth(int first, int second, bool repeats);
  const Descriptors& Describe(std::size_t contender, int view, PairMeasurement& measurement);
  PairFigures Match(std::size_t contender, int first, int second, const PairTruth& truth,
                    PairMeasurement& measurement);

  TruthScene& scene_;
  const std::vector<Contender>& contenders_;
  MatcherOptions options_;
  std::map<std::pair<int, bool>, ViewFeatures> features_;
};

}  // namespace pliant::evaluation
