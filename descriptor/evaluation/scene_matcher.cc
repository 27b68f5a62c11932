// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/evaluation/scene_matcher.h"

#include <span>
#include <utility>

#include "descriptor/base/stopwatch.h"
#include "descriptor/features/enlarged_keypoints.h"
#include "descriptor/features/faint_keypoints.h"

namespace pliant::evaluation {

SceneMatcher::ViewFeatures& SceneMatcher::Features(int view, bool repeats) {
  const auto [place, is_new] = features_.try_emplace({view, repeats});
  ViewFeatures& features = place->second;
  if (!is_new) return features;
  const KeypointOptions options{options_.max_keypoints, repeats};
  const Image& image = scene_.ViewImage(view);
  const std::vector<Keypoint> found =
      options_.enlarge ? DetectFaintKeypoints(image, options) : DetectKeypoints(image, options);
  for (const Keypoint& k : found) {
    if (scene_.OnObject(view, {k.x, k.y})) features.keypoints.push_back(k);
  }
  if (!options_.enlarge) return features;
  EnlargedKeypoints more = DetectEnlarged(image, found, /*max_side_px=*/0, options);
  features.enlarged = std::move(more.image);
  for (std::size_t i = 0; i < more.placed.size(); ++i) {
    const Keypoint& k = more.placed[i];
    if (!scene_.OnObject(view, {k.x, k.y})) continue;
    features.keypoints.push_back(k);
    features.inside.push_back(more.inside[i]);
  }
  return features;
}

SceneMatcher::PairTruth SceneMatcher::FindTruth(int first, int second, bool repeats) {
  PairTruth truth;
  const std::array<int, 2> views = {first, second};
  for (std::size_t side = 0; side < 2; ++side) {
    const std::vector<Keypoint>& keypoints = Features(views[side], repeats).keypoints;
    for (std::uint32_t i = 0; i < keypoints.size(); ++i) {
      const Vec2 place{keypoints[i].x, keypoints[i].y};
      if (!scene_.Counts(views[side], place, views[1 - side])) continue;
      truth.rows[side].push_back(i);
      if (side == 0) {
        truth.positions.push_back(scene_.Map(first, place, second));
      } else {
        truth.second.push_back(keypoints[i]);
      }
    }
  }
  truth.true_pairs = FindTruePairs(truth.positions, truth.second, options_.tolerance_px);
  return truth;
}

const Descriptors& SceneMatcher::Describe(std::size_t contender, int view,
                                          PairMeasurement& measurement) {
  ViewFeatures& features = Features(view, contenders_[contender].repeats);
  const auto [place, is_new] = features.descriptors.try_emplace(contender);
  if (!is_new) return place->second;
  const Stopwatch watch;
  const Descriptor& descriptor = *contenders_[contender].descriptor;
  const std::span<const Keypoint> keypoints(features.keypoints);
  const std::size_t plain = keypoints.size() - features.inside.size();
  place->second =
      descriptor.Describe(scene_.ViewImage(view), keypoints.first(plain), /*threads=*/1);
  if (!features.inside.empty()) {
    place->second.Append(descriptor.Describe(features.enlarged, features.inside, /*threads=*/1));
  }
  measurement.describe_seconds[contender] += watch.seconds();
  measurement.described[contender] += static_cast<double>(features.keypoints.size());
  return place->second;
}

PairFigures SceneMatcher::Match(std::size_t contender, int first, int second,
                                const PairTruth& truth, PairMeasurement& measurement) {
  const Descriptors a = SelectRows(Describe(contender, first, measurement), truth.rows[0]);
  const Descriptors b = SelectRows(Describe(contender, second, measurement), truth.rows[1]);
  CheckDescriptors(a, contenders_[contender].descriptor->info().name.c_str());
  CheckDescriptors(b, contenders_[contender].descriptor->info().name.c_str());
  const std::vector<pliant::Match> matches = MatchDescriptors(PackedDescriptors(b), a);
  return CountMatches(matches, truth.positions, truth.true_pairs, truth.second,
                      options_.tolerance_px);
}

std::optional<PairMeasurement> SceneMatcher::Measure(int first, int second) {
  const PairTruth shared = FindTruth(first, second, /*repeats=*/false);
  if (static_cast<int>(shared.true_pairs.size()) < options_.min_true_pairs) return std::nullopt;
  std::optional<PairTruth> repeated;
  PairMeasurement measurement;
  measurement.describe_seconds.resize(contenders_.size());
  measurement.described.resize(contenders_.size());
  for (std::size_t c = 0; c < contenders_.size(); ++c) {
    if (contenders_[c].repeats && !repeated) repeated = FindTruth(first, second, true);
    measurement.figures.push_back(
        Match(c, first, second, contenders_[c].repeats ? *repeated : shared, measurement));
  }
  return measurement;
}

}  // namespace pliant::evaluation
