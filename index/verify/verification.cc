// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/verify/verification.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <map>
#include <numeric>
#include <string>
#include <utility>

#include "descriptor/base/error.h"
#include "descriptor/match/distance.h"
#include "index/verify/colour_difference.h"
#include "index/verify/constants.h"
#include "index/verify/warp_geometry.h"

namespace pliant {
namespace {

void Check(const Features& features, const char* what) {
  CheckDescriptors(features.descriptors, what);
  if (features.descriptors.rows != features.keypoints.size()) {
    throw Error(ErrorCode::kInvalidArgument, "features_malformed",
                std::string(what) + " must have as many descriptors as keypoints.");
  }
}

const Features& Checked(const Features& query) {
  // An image without keypoints has descriptors without rows, whose dim may be 0.
  if (!query.keypoints.empty() || query.descriptors.rows != 0) Check(query, "query");
  return query;
}

DescriptorSpread SpreadOf(const Descriptors& descriptors) {
  const bool is_binary = descriptors.kind == DescriptorKind::kBinary;
  const auto dim = static_cast<std::size_t>(descriptors.dim) * (is_binary ? 8 : 1);
  DescriptorSpread spread{std::vector<double>(dim, 0.0), 0};
  for (std::size_t row = 0; row < descriptors.rows; ++row) {
    for (std::size_t i = 0; i < dim; ++i) {
      const double x = is_binary ? (descriptors.binary_row(row)[i / 8] >> (i % 8)) & 1
                                 : descriptors.float_row(row)[i];
      spread.mean[i] += x;
      spread.squared_length += x * x;
    }
  }
  const double rows = std::max(1.0, static_cast<double>(descriptors.rows));
  for (double& mean : spread.mean) mean /= rows;
  spread.squared_length /= rows;
  return spread;
}

double UsualDistance(const std::string& model_id) {
  return model_id.starts_with("deal") ? kVerify.usual_distance_of_deal : kVerify.usual_distance;
}

// The mean squared distance of a descriptor of one side to a descriptor of the other.
double MeanSquaredDistance(const DescriptorSpread& a, const DescriptorSpread& b) {
  return a.squared_length + b.squared_length -
         2 * std::inner_product(a.mean.begin(), a.mean.end(), b.mean.begin(), 0.0);
}

// The longer side of the box around the keypoints: that of the part the query was limited to.
double Extent(const std::vector<Keypoint>& keypoints) {
  if (keypoints.empty()) return 0;
  const auto [left, right] = std::ranges::minmax(keypoints, {}, &Keypoint::x);
  const auto [top, bottom] = std::ranges::minmax(keypoints, {}, &Keypoint::y);
  return std::max(right.x - left.x, bottom.y - top.y);
}

double MedianScale(const ThinPlateSpline& warp, const std::vector<Vec2>& points) {
  std::vector<double> scales;
  for (const Vec2 p : points) scales.push_back(std::max(0.0, LocalScale(warp, p)));
  return Median(std::move(scales));
}

// The instances found so far.
class Found {
 public:
  Found(const Features& query, const Features& reference)
      : query_(query), reference_(reference), used_(query.keypoints.size(), false) {}

  void Add(const std::vector<MatchedPair>& inliers, const std::vector<Vec2>& outline) {
    for (const MatchedPair& pair : inliers) used_[pair.query] = true;
    outlines_.push_back(outline);
    seen_.push_back(ConvexHull(PointsOf(reference_.keypoints, inliers, &MatchedPair::reference)));
  }
  bool Explains(std::uint32_t query_keypoint) const {
    const Keypoint& k = query_.keypoints[query_keypoint];
    return used_[query_keypoint] || std::ranges::any_of(outlines_, [&](const auto& outline) {
             return IsInside({k.x, k.y}, outline);
           });
  }
  // Whether at least half of the pairs show a part that another instance shows.
  bool ShowsAgain(const std::vector<MatchedPair>& pairs) const {
    const auto points = PointsOf(reference_.keypoints, pairs, &MatchedPair::reference);
    return std::ranges::any_of(seen_, [&](const auto& hull) { return HalfInside(points, hull); });
  }

 private:
  const Features& query_;
  const Features& reference_;
  std::vector<bool> used_;
  std::vector<std::vector<Vec2>> outlines_;  // in the query
  std::vector<std::vector<Vec2>> seen_;      // in the reference
};

bool AreNear(const Keypoint& a, const Keypoint& b, float radius) {
  const float x = a.x - b.x;
  const float y = a.y - b.y;
  return x * x + y * y <= radius * radius;
}

std::string FailureInWords(const VerificationResult& result) {
  const std::string matches = std::to_string(result.matches);
  switch (result.failure) {
    case TpsRansacFailure::kNone:
      break;
    case TpsRansacFailure::kTooFew:
      return "Too few keypoints match: " + matches + ".";
    case TpsRansacFailure::kNoAgreement:
      return "The " + matches + " matches do not fit one smooth warp.";
    case TpsRansacFailure::kDegenerate:
      return "The inliers lie on one line, so they do not show how the object bends.";
    case TpsRansacFailure::kFolded:
      return "The inliers would fold the object over itself.";
  }
  return "";
}

}  // namespace

Verifier::Verifier(const Features& query, const VerificationOptions& options)
    : query_(Checked(query)), options_(options), spread_(SpreadOf(query.descriptors)) {
  if (!(options.tolerance > 0 && options.tolerance < 1)) {
    throw Error(ErrorCode::kInvalidArgument, "bad_tolerance",
                "tolerance must be above 0 and below 1.");
  }
  if (!(options.reference_tolerance >= 0 && options.least_tolerance >= 0)) {
    throw Error(ErrorCode::kInvalidArgument, "bad_tolerance",
                "reference_tolerance and least_tolerance must be 0 or more.");
  }
  if (!(options.max_ratio > 0 && options.max_ratio <= 1)) {
    throw Error(ErrorCode::kInvalidArgument, "bad_max_ratio",
                "max_ratio must be above 0 and at most 1.");
  }
  if (options.max_instances < 1) {
    throw Error(ErrorCode::kInvalidArgument, "bad_max_instances",
                "max_instances must be 1 or more.");
  }
  options_.ransac.tolerance_px =
      std::max(1.0, options.tolerance * std::max(query.width, query.height));
  options_.ransac.least_tolerance_px =
      std::max(1.0, options.least_tolerance * Extent(query.keypoints));
}

std::vector<Correspondence> Verifier::Correspondences(const Features& reference,
                                                      const std::vector<Match>& matches) const {
  std::vector<Correspondence> correspondences;
  correspondences.reserve(matches.size());
  for (const Match& match : matches) {
    const Keypoint& q = query_.keypoints[match.reference];
    const Keypoint& r = reference.keypoints[match.query];
    const bool sized = q.size > 0 && r.size > 0;
    correspondences.push_back(
        {{r.x, r.y}, {q.x, q.y}, sized ? static_cast<double>(q.size) / r.size : 0.0});
  }
  return correspondences;
}

std::vector<Match> Verifier::MatchesWith(const Features& reference) const {
  return MatchDescriptors(PackedDescriptors(reference.descriptors), query_.descriptors,
                          {.threads = options_.threads});
}

void Verifier::MeasureChance(const Features& reference, const std::vector<Match>& all,
                             const std::vector<Match>& mutual, VerificationResult* result) const {
  std::vector<bool> is_inlier(query_.keypoints.size(), false);
  const auto mark = [&](const FoundInstance& found) {
    for (const MatchedPair& pair : found.inliers) is_inlier[pair.query] = true;
  };
  mark(*result);
  std::ranges::for_each(result->others, mark);
  std::vector<double> distances;
  const std::size_t usual =
      options_.usual_keypoints > 0 ? options_.usual_keypoints : query_.keypoints.size();
  for (const Match& match : all) {
    if (match.reference < usual && !is_inlier[match.reference]) distances.push_back(match.distance);
  }
  const double any = MeanSquaredDistance(spread_, SpreadOf(reference.descriptors));
  if (!distances.empty() && any > 0) {
    const double nearest = Median(std::move(distances));
    const bool is_squared = query_.descriptors.kind == DescriptorKind::kBinary;
    result->distinctness = std::sqrt((is_squared ? nearest : nearest * nearest) / any) /
                           UsualDistance(query_.model_id);
  }
  const auto hull = ConvexHull(PointsOf(query_.keypoints, result->inliers, &MatchedPair::query));
  const auto contradicting = std::ranges::count_if(mutual, [&](const Match& match) {
    const Keypoint& q = query_.keypoints[match.reference];
    return !is_inlier[match.reference] && IsInside({q.x, q.y}, hull);
  });
  const auto inliers = static_cast<double>(result->inliers.size());
  result->agreeing = inliers / (inliers + static_cast<double>(contradicting));
}

TpsRansacOptions Verifier::RansacFor(const Features& reference) const {
  TpsRansacOptions ransac = options_.ransac;
  ransac.reference_tolerance_px =
      options_.reference_tolerance * std::max(reference.width, reference.height);
  return ransac;
}

// In a Match of this file `reference` is the query's keypoint and `query` the reference's: the
// reference is the side that is packed.
FoundInstance Verifier::InstanceOf(const Features& reference, const std::vector<Match>& matches,
                                   TpsRansacResult agreed, const TpsRansacOptions& ransac) const {
  FoundInstance found;
  for (const std::uint32_t i : agreed.inliers) {
    found.inliers.push_back({matches[i].reference, matches[i].query});
    found.distances.push_back(matches[i].distance);
  }
  const ThinPlateSpline& warp = *agreed.warp;
  const int width = reference.width;
  const int height = reference.height;
  const auto seen = PointsOf(reference.keypoints, found.inliers, &MatchedPair::reference);
  const double scale = MedianScale(warp, seen);
  found.effective_inliers =
      EffectiveInliers(query_, reference, found.inliers,
                       kVerify.place_in_tolerances * ToleranceAt(ransac, scale * scale),
                       kVerify.place_in_reference * std::max(width, height));
  if (width > 1 && height > 1) {
    const Mesh mesh = WarpMesh(warp, width, height);
    found.colour_difference = ColourDifference(query_, reference, mesh, ConvexHull(seen), scale);
    const bool is_sane = std::ranges::count(mesh.trusted, false) == 0;
    if (is_sane) found.outline = WarpFrame(warp, width, height);
  }
  if (found.outline.empty() || CrossesItself(found.outline)) {
    found.outline = ConvexHull(PointsOf(query_.keypoints, found.inliers, &MatchedPair::query));
  }
  found.warp = std::move(agreed.warp);
  return found;
}

VerificationResult Verifier::Verify(const Features& reference) const {
  if (reference.model_id != query_.model_id) {
    throw Error(ErrorCode::kConflict, "model_mismatch",
                "Features of model " + query_.model_id +
                    " cannot be verified against features of model " + reference.model_id + ".");
  }
  VerificationResult result;
  if (query_.keypoints.empty() || reference.keypoints.empty()) return result;
  Check(reference, "reference");
  const std::vector<Match> all = MatchesWith(reference);
  std::vector<Match> matches;
  std::copy_if(all.begin(), all.end(), std::back_inserter(matches),
               [&](const Match& match) { return match.ratio <= options_.max_ratio; });
  std::vector<Match> mutual;
  std::copy_if(matches.begin(), matches.end(), std::back_inserter(mutual),
               [](const Match& match) { return match.mutual; });
  result.matches = static_cast<int>(mutual.size());
  const TpsRansacOptions ransac = RansacFor(reference);
  TpsRansacResult agreed = TpsRansac(Correspondences(reference, mutual), ransac);
  result.failure = agreed.failure;
  if (!agreed.warp) return result;
  static_cast<FoundInstance&>(result) = InstanceOf(reference, mutual, std::move(agreed), ransac);
  if (options_.max_instances > 1) FindFurther(reference, matches, &result);
  result.inlier_fraction =
      std::min(1.0, static_cast<double>(result.inliers.size()) / result.matches);
  MeasureChance(reference, all, mutual, &result);
  return result;
}

void Verifier::FindFurther(const Features& reference, const std::vector<Match>& matches,
                           VerificationResult* result) const {
  TpsRansacOptions ransac = RansacFor(reference);
  ransac.min_inliers *= 2;
  Found found(query_, reference);
  found.Add(result->inliers, result->outline);
  std::multimap<std::size_t, FoundInstance, std::greater<>> others;  // by their inliers
  // A sharply bent part of an instance costs a round, but is not an instance of its own.
  for (int round = 1; round < 2 * options_.max_instances; ++round) {
    if (static_cast<int>(others.size()) + 1 >= options_.max_instances) break;
    std::vector<Match> left;
    std::copy_if(matches.begin(), matches.end(), std::back_inserter(left),
                 [&](const Match& match) { return !found.Explains(match.reference); });
    TpsRansacResult agreed = TpsRansac(Correspondences(reference, left), ransac);
    if (!agreed.warp) break;
    FoundInstance other = InstanceOf(reference, left, std::move(agreed), ransac);
    if (found.ShowsAgain(other.inliers)) {
      found.Add(other.inliers, other.outline);
      others.emplace(other.inliers.size(), std::move(other));
    } else {
      found.Add(other.inliers,
                ConvexHull(PointsOf(query_.keypoints, other.inliers, &MatchedPair::query)));
    }
  }
  for (auto& [inliers, other] : others) result->others.push_back(std::move(other));
  // The mutual matches of the first one are shared among the copies.
  const auto best = std::ranges::max_element(result->others, {}, &FoundInstance::effective_inliers);
  FoundInstance& first = *result;
  if (best != result->others.end() && best->effective_inliers > first.effective_inliers) {
    std::swap(first, *best);
    std::ranges::stable_sort(result->others, std::greater<>(),
                             [](const FoundInstance& other) { return other.inliers.size(); });
  }
}

Features Subset(const Features& features, const std::function<bool(const Keypoint&)>& keep) {
  Features kept{features.width,   features.height, {}, {}, features.model_id,
                features.colours, features.preview};
  std::vector<std::uint32_t> rows;
  for (std::uint32_t i = 0; i < features.keypoints.size(); ++i) {
    if (!keep(features.keypoints[i])) continue;
    kept.keypoints.push_back(features.keypoints[i]);
    rows.push_back(i);
  }
  kept.descriptors = SelectRows(features.descriptors, rows);
  return kept;
}

double EffectiveInliers(const Features& query, const Features& reference,
                        const std::vector<MatchedPair>& inliers, double query_radius,
                        double reference_radius) {
  const auto in_query = static_cast<float>(query_radius);
  const auto in_reference = static_cast<float>(reference_radius);
  std::vector<int> near(inliers.size(), 1);
  for (std::size_t i = 0; i < inliers.size(); ++i) {
    const Keypoint& q = query.keypoints[inliers[i].query];
    const Keypoint& r = reference.keypoints[inliers[i].reference];
    for (std::size_t j = 0; j < i; ++j) {
      if (AreNear(q, query.keypoints[inliers[j].query], in_query) ||
          AreNear(r, reference.keypoints[inliers[j].reference], in_reference)) {
        ++near[i];
        ++near[j];
      }
    }
  }
  return std::accumulate(near.begin(), near.end(), 0.0,
                         [](double sum, int n) { return sum + 1.0 / n; });
}

std::vector<Explanation> ExplainInstances(const Features& query, const Features& reference,
                                          const VerificationResult& result) {
  Explanation common;
  common.verified = result.verified();
  common.failure = FailureInWords(result);
  common.matches = result.matches;
  common.reference_width = reference.width;
  common.reference_height = reference.height;
  std::vector<Explanation> explanations;
  const auto add = [&](const FoundInstance& found) {
    Explanation& explanation = explanations.emplace_back(common);
    explanation.inlier_fraction =
        std::min(1.0, static_cast<double>(found.inliers.size()) / std::max(1, result.matches));
    explanation.independent_inliers = found.effective_inliers;
    explanation.colour_difference = found.colour_difference;
    for (const MatchedPair& pair : found.inliers) {
      const Keypoint& q = query.keypoints[pair.query];
      const Keypoint& r = reference.keypoints[pair.reference];
      explanation.inliers.push_back({{q.x, q.y}, {r.x, r.y}});
    }
    if (found.warp) explanation.mesh = WarpMesh(*found.warp, reference.width, reference.height);
  };
  add(result);
  std::ranges::for_each(result.others, add);
  return explanations;
}

}  // namespace pliant
