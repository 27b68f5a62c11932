// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/match/matching.h"

#include <optional>

#include "descriptor/base/error.h"
#include "descriptor/match/distance.h"
#include "descriptor/warp/tps_ransac.h"
#include "index/verify/verification.h"
#include "python/native/bindings.h"

namespace pliant::python {
namespace {

py::tuple MatchArrays(const py::array& first, const py::array& second, double ratio, bool mutual,
                      int threads) {
  const Descriptors a = ToDescriptors(first, "a");
  const Descriptors b = ToDescriptors(second, "b");
  const std::vector<Match> matches = WithoutGil([&] {
    return MatchDescriptors(
        PackedDescriptors(b), a,
        {.max_ratio = static_cast<float>(ratio), .mutual_only = mutual, .threads = threads});
  });
  const auto rows = static_cast<py::ssize_t>(matches.size());
  IndexArray pairs(Shape(matches.size(), 2));
  FloatArray distances(rows);
  auto pair = pairs.mutable_unchecked<2>();
  auto distance = distances.mutable_unchecked<1>();
  for (py::ssize_t i = 0; i < rows; ++i) {
    const Match& match = matches[static_cast<std::size_t>(i)];
    pair(i, 0) = match.reference;
    pair(i, 1) = match.query;
    distance(i) = match.distance;
  }
  return py::make_tuple(pairs, distances);
}

std::vector<MatchedPair> ToPairs(const IndexArray& rows, const Features& a, const Features& b) {
  if (rows.ndim() != 2 || rows.shape(1) != 2) {
    throw Error(ErrorCode::kInvalidArgument, "array_shape", "matches must be an array of M x 2");
  }
  const auto at = rows.unchecked<2>();
  std::vector<MatchedPair> pairs;
  for (py::ssize_t i = 0; i < rows.shape(0); ++i) {
    const auto inside = [&](py::ssize_t j, const Features& features) {
      return at(i, j) >= 0 && static_cast<std::uint64_t>(at(i, j)) < features.keypoints.size();
    };
    if (!inside(0, a) || !inside(1, b)) {
      throw Error(ErrorCode::kInvalidArgument, "index_out_of_range",
                  "matches: row " + std::to_string(i) + " names a keypoint that does not exist");
    }
    pairs.push_back({static_cast<std::uint32_t>(at(i, 1)), static_cast<std::uint32_t>(at(i, 0))});
  }
  return pairs;
}

// The settings of verification (index/verify/verification.h), on matches that the caller made.
TpsRansacResult AgreeOnWarp(const Features& a, const Features& b,
                            const std::vector<MatchedPair>& pairs,
                            const VerificationOptions& options) {
  std::vector<Correspondence> correspondences;
  for (const MatchedPair& pair : pairs) {
    const Keypoint& from = a.keypoints[pair.reference];
    const Keypoint& to = b.keypoints[pair.query];
    const bool sized = from.size > 0 && to.size > 0;
    correspondences.push_back(
        {{from.x, from.y}, {to.x, to.y}, sized ? static_cast<double>(to.size) / from.size : 0.0});
  }
  TpsRansacOptions ransac = options.ransac;
  ransac.tolerance_px = std::max(1.0, options.tolerance * std::max(b.width, b.height));
  return TpsRansac(correspondences, ransac);
}

py::tuple Answer(const std::vector<MatchedPair>& inliers,
                 const std::optional<ThinPlateSpline>& warp, TpsRansacFailure failure,
                 std::size_t matches) {
  IndexArray pairs(Shape(inliers.size(), 2));
  auto at = pairs.mutable_unchecked<2>();
  for (py::ssize_t i = 0; i < pairs.shape(0); ++i) {
    at(i, 0) = inliers[static_cast<std::size_t>(i)].reference;
    at(i, 1) = inliers[static_cast<std::size_t>(i)].query;
  }
  return py::make_tuple(pairs, warp, ToString(failure), matches);
}

py::tuple Verify(const py::object& first, const py::object& second,
                 const std::optional<IndexArray>& matches, double ratio, double tolerance,
                 std::uint64_t seed, int threads) {
  const Features a = ToFeatures(first, "a");
  const Features b = ToFeatures(second, "b");
  VerificationOptions options;
  options.max_ratio = static_cast<float>(ratio);
  options.tolerance = tolerance;
  options.ransac.seed = seed;
  options.threads = threads;
  if (!(tolerance > 0 && tolerance < 1)) {
    throw Error(ErrorCode::kInvalidArgument, "bad_tolerance",
                "tolerance must be above 0 and below 1.");
  }
  if (!matches) {
    const VerificationResult result = WithoutGil([&] { return Verifier(b, options).Verify(a); });
    return Answer(result.inliers, result.warp, result.failure,
                  static_cast<std::size_t>(result.matches));
  }
  const std::vector<MatchedPair> pairs = ToPairs(*matches, a, b);
  const TpsRansacResult result = WithoutGil([&] { return AgreeOnWarp(a, b, pairs, options); });
  std::vector<MatchedPair> inliers;
  for (const std::uint32_t i : result.inliers) inliers.push_back(pairs[i]);
  return Answer(inliers, result.warp, result.failure, pairs.size());
}

DoubleArray WarpPoints(const ThinPlateSpline& warp, const DoubleArray& points) {
  std::vector<Vec2> places = ToPoints(points, "points");
  WithoutGil(
      [&] { std::transform(places.begin(), places.end(), places.begin(), std::cref(warp)); });
  return FromPoints(places);
}

DoubleArray Jacobians(const ThinPlateSpline& warp, const DoubleArray& points) {
  const std::vector<Vec2> places = ToPoints(points, "points");
  DoubleArray result(std::vector<py::ssize_t>{points.shape(0), 2, 2});
  double* out = result.mutable_data();
  for (const Vec2 place : places) {
    for (const double value : warp.Jacobian(place)) *out++ = value;
  }
  return result;
}

ThinPlateSpline FitWarp(const DoubleArray& from, const DoubleArray& to, double regularization) {
  const std::vector<Vec2> a = ToPoints(from, "source");
  const std::vector<Vec2> b = ToPoints(to, "target");
  const py::gil_scoped_release release;
  return ThinPlateSpline::Fit(a, b, {.regularization = regularization});
}

}  // namespace

void BindMatching(py::module_& module) {
  py::class_<ThinPlateSpline>(module, "Warp")
      .def_static("_fit", &FitWarp, py::arg().noconvert(), py::arg().noconvert(), py::arg())
      .def("_map", &WarpPoints, py::arg().noconvert())
      .def("_jacobians", &Jacobians, py::arg().noconvert())
      .def_property_readonly("bending_energy", &ThinPlateSpline::bending_energy);
  module.def("match", &MatchArrays);
  module.def("verify", &Verify, py::arg(), py::arg(), py::arg().noconvert(), py::arg(), py::arg(),
             py::arg(), py::arg());
}

}  // namespace pliant::python
