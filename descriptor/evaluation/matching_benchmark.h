// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The matching benchmark of `pliant eval matching`: descriptors compared at the same keypoints of
// image pairs with ground-truth correspondence. metrics.h defines the metrics.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "descriptor/evaluation/dataset.h"
#include "descriptor/evaluation/metrics.h"
#include "descriptor/features/foreign_features.h"

namespace pliant::evaluation {

// A row of the table.
struct DescriptorChoice {
  std::string label;            // name of the row
  std::string name;             // for MakeDescriptor
  std::filesystem::path model;  // weights; empty = the default ones
  // Use SIFT's own keypoints, including the duplicates for a second orientation, instead of the
  // shared ones.
  bool repeats = false;
};

// "[LABEL:]NAME[=FILE]": NAME of MakeDescriptor, or sift+repeats; FILE with weights for deal and
// its variants. Without LABEL the row is named after NAME and the file. Throws kInvalidArgument.
DescriptorChoice ParseDescriptorChoice(const std::string& text);
// Every descriptor that MakeDescriptor knows, and sift+repeats.
std::vector<DescriptorChoice> AllDescriptorChoices();

struct MatchingOptions {
  std::vector<DescriptorChoice> descriptors;  // empty = AllDescriptorChoices()
  std::vector<FeatureSource> features;        // further rows, at keypoints of their own
  std::filesystem::path model;                // weights; empty = ModelPath(name)
  int max_keypoints = 2048;                   // per image, strongest first; 1..4096
  // Also use low-contrast keypoints, and at most max_keypoints more of the enlarged image
  // (enlarged_keypoints.h), as the service does with every query.
  bool enlarge = false;
  double tolerance_px = 3;
  // Selects this many measurable pairs, from as many scenes as possible; 0 = all pairs.
  int pairs = 0;
  // Pairs with fewer true keypoint pairs overlap too little to be measured.
  int min_true_pairs = 12;
  std::uint64_t seed = 1;  // of the choice of pairs
  int jobs = 0;            // threads, one scene each; 0 = one per core
  // Called after each pair, from any thread, never concurrently. Returning false stops.
  std::function<bool(std::uint64_t done, std::uint64_t total)> progress;
};

// Means over pairs.
struct DescriptorResult {
  std::string label;
  std::string model_id;
  int pairs = 0;
  double ms = 0;
  double ms_error = 0;  // standard error of the mean
  double mma = 0;
  double mutual_precision = 0;
  double correct_matches = 0;   // per image pair: correct mutual nearest neighbours
  double ms_ratio_to_sift = 0;  // mean MS / SIFT's on the same pairs; 0 where SIFT's is 0
  double keypoints = 0;         // per image, on the object
  double true_pairs = 0;        // per image pair
  double describe_us = 0;       // microseconds per keypoint, on one of `jobs` busy threads
};

// Results of the pairs with one value of the sweep, or of one group.
struct Subset {
  std::string name;                       // of the group
  double value = 0;                       // of the sweep
  std::vector<DescriptorResult> results;  // in the order of the whole table
};

struct MatchingReport {
  Layout layout = Layout::kAuto;
  int pairs = 0;
  int left_out = 0;  // with fewer than min_true_pairs
  std::vector<DescriptorResult> results;
  std::string sweep;           // "", "rotation_deg", "scale"
  std::vector<Subset> curve;   // ascending values; empty without a sweep
  std::vector<Subset> groups;  // by name; empty when there is only one
};

// The order in which pairs are measured. Internal.
struct PairCandidate {
  std::size_t scene = 0;
  ViewPair pair;
};

// In the set's own order.
std::vector<PairCandidate> AllPairs(const Dataset& dataset);

// One random pair per scene, scenes in random order; then again with the remaining pairs. If the
// set does not define which image comes first (neither sweep nor group), that is random too.
std::vector<PairCandidate> ShufflePairs(const Dataset& dataset, std::uint64_t seed);

// Deterministic except for the times, independently of `jobs`. Throws kInvalidArgument for options
// out of range, what MakeDescriptor, the set's readers and FeatureSource::read throw,
// kUnprocessable "no_pairs" when no pair can be measured, or "no_image_files" when features of
// image files are compared on a set without them, kCancelled "evaluation_stopped".
MatchingReport RunMatchingBenchmark(const Dataset& dataset, const MatchingOptions& options);

// Lowest over highest MS along the curve of result row `row`: 1 = flat; 0 without a curve.
double CurveFlatness(const MatchingReport& report, std::size_t row);

}  // namespace pliant::evaluation
