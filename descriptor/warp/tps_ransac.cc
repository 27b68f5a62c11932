// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/warp/tps_ransac.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <random>
#include <string>
#include <utility>

#include "descriptor/base/error.h"

namespace pliant {
namespace {

constexpr double kLeastWidthRatio = 1.0 / 12;
constexpr double kLeastWidthPx = 0.5;

constexpr std::size_t kSampleNeighbours = 8;    // the sample's other two are among these
constexpr std::size_t kSupportNeighbours = 20;  // who votes for a sample
constexpr std::size_t kKeptNeighbours = 40;     // looked through before all others are
constexpr std::size_t kGrowNeighbours = 8;      // whose map predicts a correspondence
constexpr std::size_t kGrownHypotheses = 6;
// A distance in the query counts as one in the reference that is shorter by this: keypoint sizes
// and local scales differ.
constexpr double kQueryReach = 4;
constexpr std::size_t kLeastSupport = 4;  // the sample's three and one more
// Bending moves a point off its neighbourhood's affine map by a share of its distance from there.
constexpr double kBending = 0.1;
constexpr int kRefits = 4;
constexpr int kUnfoldings = 4;

struct Hypothesis {
  std::uint32_t seed = 0;
  std::vector<std::uint32_t> support;
};

double Distance(Vec2 a, Vec2 b) { return std::sqrt(SquaredDistance(a, b)); }

// Squared, in the reference.
double NeighbourDistance(const Correspondence& from, const Correspondence& to) {
  const double in_reference = SquaredDistance(from.reference, to.reference);
  if (from.size_ratio <= 0) return in_reference;
  const double scale = from.size_ratio * kQueryReach;
  return std::max(in_reference, SquaredDistance(from.query, to.query) / (scale * scale));
}

class Ransac {
 public:
  Ransac(std::span<const Correspondence> input, const TpsRansacOptions& options)
      : input_(input), options_(options) {}

  TpsRansacResult Go() {
    const std::size_t n = input_.size();
    if (n < static_cast<std::size_t>(options_.min_inliers)) {
      return {TpsRansacFailure::kTooFew, {}, {}};
    }
    FindNeighbours();
    std::vector<std::uint32_t> best;
    std::vector<char> covered(n, 0);  // seeds that an earlier growth reached
    std::size_t grown = 0;
    for (const Hypothesis& hypothesis : Sample()) {
      if (covered[hypothesis.seed] != 0) continue;
      auto members = Grow(hypothesis.support);
      for (const std::uint32_t i : members) covered[i] = 1;
      if (members.size() > best.size()) best = std::move(members);
      if (++grown == kGrownHypotheses) break;
    }
    if (best.size() < static_cast<std::size_t>(options_.min_inliers)) {
      return {TpsRansacFailure::kNoAgreement, {}, {}};
    }
    return Refine(std::move(best));
  }

 private:
  // For each correspondence the others in order of distance, the nearest few. The distance is that
  // in the reference or, if it is larger, that in the query in the scale of the keypoints: of
  // several copies in the query, neighbours belong to one.
  void FindNeighbours() {
    const std::size_t n = input_.size();
    const std::size_t keep = std::min(kKeptNeighbours, n - 1);
    neighbours_.resize(n);
    std::vector<std::pair<float, std::uint32_t>> others;
    for (std::uint32_t i = 0; i < n; ++i) {
      others.clear();
      for (std::uint32_t j = 0; j < n; ++j) {
        if (j == i) continue;
        others.emplace_back(static_cast<float>(NeighbourDistance(input_[i], input_[j])), j);
      }
      const auto end = others.begin() + static_cast<std::ptrdiff_t>(keep);
      if (keep < others.size()) std::nth_element(others.begin(), end, others.end());
      std::sort(others.begin(), end);
      for (std::size_t k = 0; k < keep; ++k) neighbours_[i].push_back(others[k].second);
    }
  }

  // A map from the listed correspondences, if they are in general position and it is plausible.
  std::optional<LocalAffine> MapOf(std::span<const std::uint32_t> members) const {
    Vec2 reference[kGrowNeighbours];
    Vec2 query[kGrowNeighbours];
    for (std::size_t k = 0; k < members.size(); ++k) {
      reference[k] = input_[members[k]].reference;
      query[k] = input_[members[k]].query;
    }
    auto map = FitLocalAffine({reference, members.size()}, {query, members.size()});
    if (!map || !IsPlausible(map->a, map->b, map->c, map->d, options_.max_anisotropy)) return {};
    return map;
  }

  bool SizeAgrees(std::uint32_t i, double determinant) const {
    const double ratio = input_[i].size_ratio;
    if (ratio <= 0) return true;
    const double factor = ratio / std::sqrt(determinant);
    return factor <= options_.max_size_factor && factor * options_.max_size_factor >= 1;
  }

  bool Agrees(const LocalAffine& map, std::uint32_t i, Vec2 from) const {
    const double determinant = map.determinant();
    const double reach = std::sqrt(determinant) * Distance(input_[i].reference, from);
    const double tolerance = ToleranceAt(options_, determinant);
    const double bent = std::min(kBending * reach, 4 * tolerance);
    return Distance(map(input_[i].reference), input_[i].query) <= tolerance + bent &&
           SizeAgrees(i, determinant);
  }

  // Maps of random neighbouring triples, those with most support first. By Taylor's theorem a
  // smooth warp differs from its affine part by the square of the distance, so neighbours agree on
  // one map though the whole surface has none; and three neighbours are all right with the
  // probability w^3 of their own neighbourhood, however many are wrong elsewhere. Every
  // correspondence gets its turn as the first of three, so that no part is left to chance.
  std::vector<Hypothesis> Sample() const {
    std::vector<Hypothesis> found(input_.size());
    std::mt19937_64 generator(options_.seed);
    const std::size_t choices = std::min(kSampleNeighbours, input_.size() - 1);
    for (int iteration = 0; iteration < options_.iterations; ++iteration) {
      const auto i = static_cast<std::uint32_t>(iteration % input_.size());
      const std::size_t first = generator() % choices;
      const std::size_t second = (first + 1 + generator() % (choices - 1)) % choices;
      const std::uint32_t sample[] = {i, neighbours_[i][first], neighbours_[i][second]};
      const auto map = MapOf(sample);
      if (!map || !SizeAgrees(i, map->determinant())) continue;
      std::vector<std::uint32_t> support = {i};
      const std::span voters(neighbours_[i].data(),
                             std::min(kSupportNeighbours, neighbours_[i].size()));
      for (const std::uint32_t j : voters) {
        if (Agrees(*map, j, input_[i].reference)) support.push_back(j);
      }
      if (support.size() > found[i].support.size()) found[i] = {i, std::move(support)};
    }
    std::erase_if(found, [](const Hypothesis& h) { return h.support.size() < kLeastSupport; });
    std::stable_sort(found.begin(), found.end(), [](const Hypothesis& a, const Hypothesis& b) {
      return a.support.size() > b.support.size();
    });
    return found;
  }

  // Adds correspondences that their nearest members predict, until nothing changes; members that
  // the others do not predict go again. A wrong member is alone: the right ones around it do not
  // predict it, while right ones predict each other; so errors do not spread as they would if the
  // first map were stretched over the surface.
  std::vector<std::uint32_t> Grow(std::vector<std::uint32_t> members) const {
    std::vector<char> in(input_.size(), 0);
    for (const std::uint32_t i : members) in[i] = 1;
    for (int round = 0; round < 20; ++round) {
      std::vector<char> next(input_.size(), 0);
      for (std::uint32_t i = 0; i < input_.size(); ++i) {
        next[i] = static_cast<char>(IsPredicted(i, members, in));
      }
      if (next == in) break;
      // The first rounds only add: a small start has too few members to judge each other.
      for (std::size_t i = 0; i < in.size(); ++i) {
        in[i] = static_cast<char>(next[i] != 0 || (round < 2 && in[i] != 0));
      }
      members.clear();
      for (std::uint32_t i = 0; i < in.size(); ++i) {
        if (in[i] != 0) members.push_back(i);
      }
    }
    return members;
  }

  // Whether the map of the nearest members predicts correspondence i.
  bool IsPredicted(std::uint32_t i, const std::vector<std::uint32_t>& members,
                   const std::vector<char>& in) const {
    std::uint32_t rows[kGrowNeighbours];
    std::size_t count = 0;
    for (const std::uint32_t j : neighbours_[i]) {
      if (in[j] == 0) continue;
      rows[count++] = j;
      if (count == kGrowNeighbours) break;
    }
    if (count < kGrowNeighbours) count = NearestMembers(i, members, rows);
    if (count < 3) return in[i] != 0;
    const auto map = MapOf({rows, count});
    return map && Agrees(*map, i, input_[rows[0]].reference);
  }

  // The members nearest to i, nearest first, by looking at all.
  std::size_t NearestMembers(std::uint32_t i, const std::vector<std::uint32_t>& members,
                             std::uint32_t* rows) const {
    std::pair<double, std::uint32_t> nearest[kGrowNeighbours];
    std::size_t count = 0;
    for (const std::uint32_t m : members) {
      if (m == i) continue;
      const std::pair<double, std::uint32_t> entry(
          SquaredDistance(input_[i].reference, input_[m].reference), m);
      if (count == kGrowNeighbours && entry >= nearest[count - 1]) continue;
      if (count < kGrowNeighbours) ++count;
      std::size_t at = count - 1;
      for (; at > 0 && entry < nearest[at - 1]; --at) nearest[at] = nearest[at - 1];
      nearest[at] = entry;
    }
    for (std::size_t k = 0; k < count; ++k) rows[k] = nearest[k].second;
    return count;
  }

  // Fits the spline to the members, weighted by how well they fit, and asks it who belongs; folds
  // are smoothed away by more regularisation.
  TpsRansacResult Refine(std::vector<std::uint32_t> members) const {
    TpsOptions tps;
    tps.regularization = options_.regularization;
    for (int unfolding = 0; unfolding <= kUnfoldings; ++unfolding, tps.regularization *= 10) {
      auto current = members;
      std::optional<ThinPlateSpline> warp;
      try {
        for (int refit = 0; refit < kRefits; ++refit) {
          warp = FitRobustly(current, tps, warp);
          auto next = AgreeingWith(*warp);
          const bool same = next == current;
          current = std::move(next);
          if (same || current.size() < 3) break;
        }
      } catch (const Error& error) {
        if (error.code() != ErrorCode::kUnprocessable) throw;
        return {TpsRansacFailure::kDegenerate, {}, {}};
      }
      // Members that the warp lost are those it folds at, or a part bent too sharply for it.
      const bool holds = current.size() * 2 >= members.size();
      if (!holds) continue;
      if (current.size() < static_cast<std::size_t>(options_.min_inliers)) break;
      return {TpsRansacFailure::kNone, std::move(current), std::move(warp)};
    }
    return {TpsRansacFailure::kFolded, {}, {}};
  }

  ThinPlateSpline FitRobustly(const std::vector<std::uint32_t>& members, const TpsOptions& tps,
                              const std::optional<ThinPlateSpline>& before) const {
    std::vector<Vec2> from;
    std::vector<Vec2> to;
    std::vector<double> weights;
    for (const std::uint32_t i : members) {
      from.push_back(input_[i].reference);
      to.push_back(input_[i].query);
      double weight = 1;
      if (before) {  // reweighted least squares for Geman-McClure's r^2 / (1 + r^2)
        const auto [a, b, c, d] = before->Jacobian(from.back());
        const double r =
            Distance((*before)(from.back()), to.back()) / ToleranceAt(options_, a * d - b * c);
        weight = 1 / ((1 + r * r) * (1 + r * r));
      }
      weights.push_back(weight);
    }
    return ThinPlateSpline::Fit(from, to, tps, weights);
  }

  std::vector<std::uint32_t> AgreeingWith(const ThinPlateSpline& warp) const {
    std::vector<std::uint32_t> agreeing;
    for (std::uint32_t i = 0; i < input_.size(); ++i) {
      const Vec2 p = input_[i].reference;
      const auto [a, b, c, d] = warp.Jacobian(p);
      if (Distance(warp(p), input_[i].query) > ToleranceAt(options_, a * d - b * c)) continue;
      if (!IsPlausible(a, b, c, d, options_.max_anisotropy)) continue;
      if (SizeAgrees(i, a * d - b * c)) agreeing.push_back(i);
    }
    return agreeing;
  }

  std::span<const Correspondence> input_;
  const TpsRansacOptions& options_;
  std::vector<std::vector<std::uint32_t>> neighbours_;
};

}  // namespace

std::optional<LocalAffine> FitLocalAffine(std::span<const Vec2> reference,
                                          std::span<const Vec2> query) {
  const auto n = static_cast<double>(reference.size());
  if (reference.size() < 3 || query.size() != reference.size()) return std::nullopt;
  LocalAffine map;
  for (std::size_t i = 0; i < reference.size(); ++i) {
    map.reference.x += reference[i].x / n;
    map.reference.y += reference[i].y / n;
    map.query.x += query[i].x / n;
    map.query.y += query[i].y / n;
  }
  double xx = 0, xy = 0, yy = 0;          // of the reference
  double ux = 0, uy = 0, vx = 0, vy = 0;  // query (u, v) by reference (x, y)
  for (std::size_t i = 0; i < reference.size(); ++i) {
    const double x = reference[i].x - map.reference.x;
    const double y = reference[i].y - map.reference.y;
    const double u = query[i].x - map.query.x;
    const double v = query[i].y - map.query.y;
    xx += x * x, xy += x * y, yy += y * y;
    ux += u * x, uy += u * y, vx += v * x, vy += v * y;
  }
  // Eigenvalues of the scatter: squared length and width of the neighbourhood, times n.
  const double mean = (xx + yy) / 2;
  const double spread = std::hypot((xx - yy) / 2, xy);
  const double narrow = mean - spread;
  if (narrow < kLeastWidthRatio * kLeastWidthRatio * (mean + spread) ||
      narrow < kLeastWidthPx * kLeastWidthPx * n) {
    return std::nullopt;
  }
  const double determinant = xx * yy - xy * xy;
  // Least squares about the centroids, where the translation drops out:
  // [a b; c d] = [ux uy; vx vy] [xx xy; xy yy]^-1.
  map.a = (ux * yy - uy * xy) / determinant;
  map.b = (uy * xx - ux * xy) / determinant;
  map.c = (vx * yy - vy * xy) / determinant;
  map.d = (vy * xx - vx * xy) / determinant;
  return map;
}

bool IsPlausible(double a, double b, double c, double d, double max_anisotropy) {
  const double determinant = a * d - b * c;
  if (!(determinant > 0)) return false;
  // s1^2 + s2^2 = sum of squares, s1 s2 = determinant: s1 / s2 + s2 / s1 = sum / determinant.
  const double sum = a * a + b * b + c * c + d * d;
  return sum <= determinant * (max_anisotropy + 1 / max_anisotropy);
}

void Validate(std::span<const Correspondence> input, const TpsRansacOptions& options) {
  const auto require = [](bool holds, const char* field, const char* rule) {
    if (holds) return;
    throw Error(ErrorCode::kInvalidArgument, std::string("bad_") + field,
                std::string(field) + " must be " + rule + ".");
  };
  require(options.iterations >= 1, "iterations", "1 or more");
  require(options.tolerance_px > 0, "tolerance_px", "above 0");
  require(options.reference_tolerance_px >= 0, "reference_tolerance_px", "0 or more");
  require(options.least_tolerance_px >= 0, "least_tolerance_px", "0 or more");
  require(options.regularization >= 0, "regularization", "0 or more");
  require(options.max_anisotropy >= 1, "max_anisotropy", "1 or more");
  require(options.max_size_factor >= 1, "max_size_factor", "1 or more");
  require(options.min_inliers >= 4, "min_inliers", "4 or more: any three points make a map");
  for (const Correspondence& c : input) {
    require(std::isfinite(c.reference.x) && std::isfinite(c.reference.y) &&
                std::isfinite(c.query.x) && std::isfinite(c.query.y) && std::isfinite(c.size_ratio),
            "correspondences", "finite numbers");
  }
}

const char* ToString(TpsRansacFailure failure) {
  static constexpr std::array kNames = {"none", "too_few_matches", "no_agreement", "degenerate",
                                        "folded"};
  return kNames[static_cast<std::size_t>(failure)];
}

double ToleranceAt(const TpsRansacOptions& options, double determinant) {
  if (options.reference_tolerance_px == 0) return options.tolerance_px;
  const double shrunk = options.reference_tolerance_px * std::sqrt(std::max(0.0, determinant));
  return std::min(options.tolerance_px, std::max(options.least_tolerance_px, shrunk));
}

TpsRansacResult TpsRansac(std::span<const Correspondence> correspondences,
                          const TpsRansacOptions& options) {
  Validate(correspondences, options);
  return Ransac(correspondences, options).Go();
}

}  // namespace pliant
