// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/verify/verification.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <string>
#include <utility>

#include "descriptor/base/error.h"
#include "descriptor/match/distance.h"
#include "index/verify/colour_difference.h"
#include "index/verify/independence.h"
#include "index/verify/outline.h"

namespace pliant {
namespace {

constexpr int kOutlinePointsASide = 8;
constexpr double kMaxFrameScaleFactor = 4;
// Inliers nearer than this are in one place: in the query as a multiple of the warp's tolerance, in
// the reference as a share of its longer side.
constexpr double kPlaceInTolerances = 1.5;
constexpr double kPlaceInReference = 0.02;

void Check(const Features& features, const char* what) {
  CheckDescriptors(features.descriptors, what);
  if (features.descriptors.rows != features.keypoints.size()) {
    throw Error(ErrorCode::kInvalidArgument, "features_malformed",
                std::string(what) + ": as many descriptors as keypoints are needed.");
  }
}

const Features& Checked(const Features& query) {
  // An image without keypoints has descriptors without rows, whose dim may be 0.
  if (!query.keypoints.empty() || query.descriptors.rows != 0) Check(query, "query");
  return query;
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
  for (const Vec2 p : points) {
    const auto [a, b, c, d] = warp.Jacobian(p);
    scales.push_back(std::sqrt(std::max(0.0, a * d - b * c)));
  }
  const auto middle = scales.begin() + static_cast<std::ptrdiff_t>(scales.size() / 2);
  std::nth_element(scales.begin(), middle, scales.end());
  return *middle;
}

std::vector<Vec2> PointsOf(const std::vector<Keypoint>& keypoints,
                           const std::vector<MatchedPair>& pairs,
                           std::uint32_t MatchedPair::* which) {
  std::vector<Vec2> points;
  points.reserve(pairs.size());
  for (const MatchedPair& pair : pairs) {
    const Keypoint& k = keypoints[pair.*which];
    points.push_back({k.x, k.y});
  }
  return points;
}

std::vector<Vec2> Outline(const Features& query, const Features& reference,
                          const std::vector<MatchedPair>& inliers, const ThinPlateSpline& warp) {
  const auto in_reference = PointsOf(reference.keypoints, inliers, &MatchedPair::reference);
  if (MapsFrameSanely(warp, reference.width, reference.height, MedianScale(warp, in_reference),
                      kMaxFrameScaleFactor)) {
    auto frame = WarpFrame(warp, reference.width, reference.height, kOutlinePointsASide);
    if (!CrossesItself(frame)) return frame;
  }
  return ConvexHull(PointsOf(query.keypoints, inliers, &MatchedPair::query));
}

// In a Match of this file `reference` is the query's keypoint and `query` the reference's: the
// reference is the side that is packed.
std::vector<MatchedPair> PairsOf(const std::vector<Match>& matches,
                                 const std::vector<std::uint32_t>& inliers) {
  std::vector<MatchedPair> pairs;
  pairs.reserve(inliers.size());
  for (const std::uint32_t i : inliers) pairs.push_back({matches[i].reference, matches[i].query});
  return pairs;
}

std::vector<float> DistancesOf(const std::vector<Match>& matches,
                               const std::vector<std::uint32_t>& inliers) {
  std::vector<float> distances;
  distances.reserve(inliers.size());
  for (const std::uint32_t i : inliers) distances.push_back(matches[i].distance);
  return distances;
}

// What is known of the instances found so far.
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
    return used_[query_keypoint] ||
           std::any_of(outlines_.begin(), outlines_.end(),
                       [&](const auto& outline) { return IsInside({k.x, k.y}, outline); });
  }
  // Whether half of the pairs or more show what some instance has shown.
  bool ShowsAgain(const std::vector<MatchedPair>& pairs) const {
    return std::any_of(seen_.begin(), seen_.end(), [&](const auto& hull) {
      const auto points = PointsOf(reference_.keypoints, pairs, &MatchedPair::reference);
      const auto inside =
          std::count_if(points.begin(), points.end(), [&](Vec2 p) { return IsInside(p, hull); });
      return 2 * static_cast<std::size_t>(inside) >= points.size();
    });
  }

 private:
  const Features& query_;
  const Features& reference_;
  std::vector<bool> used_;
  std::vector<std::vector<Vec2>> outlines_;  // in the query
  std::vector<std::vector<Vec2>> seen_;      // in the reference
};

}  // namespace

Verifier::Verifier(const Features& query, const VerificationOptions& options)
    : query_(Checked(query)),
      query_steps_(SteppedDescriptors::Of(query.descriptors)),
      options_(options) {
  if (!(options.tolerance > 0 && options.tolerance < 1)) {
    throw Error(ErrorCode::kInvalidArgument, "bad_tolerance",
                "tolerance must be above 0 and below 1.");
  }
  if (!(options.reference_tolerance >= 0 && options.least_tolerance >= 0)) {
    throw Error(ErrorCode::kInvalidArgument, "bad_tolerance",
                "reference_tolerance and least_tolerance must be 0 or more.");
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
  const MatchOptions options{.max_ratio = options_.max_ratio, .threads = options_.threads};
  if (query_steps_) {
    const auto steps = SteppedDescriptors::Of(reference.descriptors);
    if (steps) return MatchDescriptors(*steps, *query_steps_, options);
  }
  return MatchDescriptors(PackedDescriptors(reference.descriptors), query_.descriptors, options);
}

TpsRansacOptions Verifier::RansacFor(const Features& reference) const {
  TpsRansacOptions ransac = options_.ransac;
  ransac.reference_tolerance_px =
      options_.reference_tolerance * std::max(reference.width, reference.height);
  return ransac;
}

double Verifier::Independent(const Features& reference, const std::vector<MatchedPair>& inliers,
                             const ThinPlateSpline& warp, const TpsRansacOptions& ransac) const {
  const double scale =
      MedianScale(warp, PointsOf(reference.keypoints, inliers, &MatchedPair::reference));
  return IndependentInliers(query_, reference, inliers,
                            kPlaceInTolerances * ToleranceAt(ransac, scale * scale),
                            kPlaceInReference * std::max(reference.width, reference.height));
}

std::optional<double> Verifier::Colours(const Features& reference,
                                        const std::vector<MatchedPair>& inliers,
                                        const ThinPlateSpline& warp) const {
  const auto seen = PointsOf(reference.keypoints, inliers, &MatchedPair::reference);
  return ColourDifference(query_, reference, warp, ConvexHull(seen), MedianScale(warp, seen));
}

VerificationResult Verifier::Verify(const Features& reference) const {
  if (reference.model_id != query_.model_id) {
    throw Error(ErrorCode::kConflict, "model_mismatch",
                "Features of model " + query_.model_id +
                    " cannot be verified against features of "
                    "model " +
                    reference.model_id + ".");
  }
  VerificationResult result;
  if (query_.keypoints.empty() || reference.keypoints.empty()) return result;
  Check(reference, "reference");
  const std::vector<Match> matches = MatchesWith(reference);
  std::vector<Match> mutual;
  std::copy_if(matches.begin(), matches.end(), std::back_inserter(mutual),
               [](const Match& match) { return match.mutual; });
  result.matches = static_cast<int>(mutual.size());
  const TpsRansacOptions ransac = RansacFor(reference);
  TpsRansacResult agreed = TpsRansac(Correspondences(reference, mutual), ransac);
  result.failure = agreed.failure;
  result.warp = std::move(agreed.warp);
  if (!result.warp) return result;
  result.inliers = PairsOf(mutual, agreed.inliers);
  result.distances = DistancesOf(mutual, agreed.inliers);
  result.inlier_fraction = static_cast<double>(result.inliers.size()) / result.matches;
  result.independent = Independent(reference, result.inliers, *result.warp, ransac);
  result.outline = Outline(query_, reference, result.inliers, *result.warp);
  result.colour_difference = Colours(reference, result.inliers, *result.warp);
  if (options_.max_instances > 1) FindFurther(reference, matches, &result);
  return result;
}

void Verifier::FindFurther(const Features& reference, const std::vector<Match>& matches,
                           VerificationResult* result) const {
  TpsRansacOptions ransac = RansacFor(reference);
  ransac.min_inliers *= 2;
  Found found(query_, reference);
  found.Add(result->inliers, result->outline);
  // A part of an instance bent too sharply costs a round and is no instance.
  for (int round = 1; round < 2 * options_.max_instances; ++round) {
    if (static_cast<int>(result->others.size()) + 1 >= options_.max_instances) break;
    std::vector<Match> left;
    std::copy_if(matches.begin(), matches.end(), std::back_inserter(left),
                 [&](const Match& match) { return !found.Explains(match.reference); });
    TpsRansacResult agreed = TpsRansac(Correspondences(reference, left), ransac);
    if (!agreed.warp) break;
    const auto inliers = PairsOf(left, agreed.inliers);
    const auto outline = Outline(query_, reference, inliers, *agreed.warp);
    if (found.ShowsAgain(inliers)) {
      result->others.push_back({inliers, DistancesOf(left, agreed.inliers),
                                Independent(reference, inliers, *agreed.warp, ransac),
                                Colours(reference, inliers, *agreed.warp), *agreed.warp, outline});
      found.Add(inliers, outline);
    } else {
      found.Add(inliers, ConvexHull(PointsOf(query_.keypoints, inliers, &MatchedPair::query)));
    }
  }
  std::stable_sort(result->others.begin(), result->others.end(),
                   [](const FurtherInstance& a, const FurtherInstance& b) {
                     return a.inliers.size() > b.inliers.size();
                   });
}

double InliersByChance(std::size_t query_keypoints) {
  constexpr double kUsual = 4.5;
  constexpr double kAnOctave = 1.5;  // more for twice the keypoints, and no more than that
  constexpr double kUsualKeypoints = 2048;
  const double octaves = std::log2(static_cast<double>(query_keypoints) / kUsualKeypoints);
  return kUsual + kAnOctave * std::clamp(octaves, 0.0, 1.0);
}

double Evidence(double independent, double by_chance) {
  constexpr double kOfAnyWarp = 0.25;
  return independent <= 0 ? 0 : std::max(kOfAnyWarp, independent - by_chance);
}

double LiftScore(double ranking_score, double evidence) {
  constexpr double kLeast = 1e-6;  // nothing is too unlike to be lifted by its inliers
  if (evidence <= 0) return ranking_score;
  const double lifted = std::max(kLeast, ranking_score) * std::pow(1 + evidence, 4);
  return lifted / (lifted + 1 - std::min(1 - kLeast, ranking_score));
}

double Probability(double score) {
  constexpr double kOdds = 30;
  return kOdds * score / (kOdds * score + 1 - score);
}

}  // namespace pliant
