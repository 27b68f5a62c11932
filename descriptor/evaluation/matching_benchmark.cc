// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/evaluation/matching_benchmark.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <mutex>
#include <numeric>
#include <span>
#include <utility>

#include "descriptor/base/error.h"
#include "descriptor/base/parallel.h"
#include "descriptor/base/stopwatch.h"
#include "descriptor/evaluation/truth_scene.h"
#include "descriptor/features/descriptor.h"
#include "descriptor/features/enlarged_keypoints.h"
#include "descriptor/simulation/random.h"

namespace pliant::evaluation {
namespace {

// Keypoints that contenders have in common, or of one's own: kOwn + its number in
// MatchingOptions::features.
using KeypointSet = std::size_t;
constexpr KeypointSet kShared = 0;
constexpr KeypointSet kRepeated = 1;  // SIFT's, duplicates included
constexpr KeypointSet kOwn = 2;

struct Contender {
  std::shared_ptr<const Descriptor> descriptor;  // null: the features are from elsewhere
  KeypointSet keypoints = kShared;
  std::string label = {};
};

// A measured pair: one value per contender.
struct PairMeasurement {
  ViewPair pair;
  std::vector<PairFigures> figures;
  std::vector<double> describe_seconds;  // for this pair; 0 if the views were described before
  std::vector<double> described;         // keypoints described in that time
};

// The choices, made; SIFT is always among them, because ratios are to it.
struct Contenders {
  std::vector<Contender> all;
  std::size_t shown = 0;  // number of requested ones, which come first
  std::size_t sift = 0;
};

void CheckOptions(const MatchingOptions& options) {
  const auto require = [](bool good, const char* message) {
    if (!good) throw Error(ErrorCode::kInvalidArgument, "option_out_of_range", message);
  };
  require(options.max_keypoints >= 1 && options.max_keypoints <= 4096,
          "the number of keypoints must be 1 to 4096");
  require(options.tolerance_px > 0 && options.tolerance_px <= 100,
          "the tolerance must be above 0 and at most 100 pixels");
  require(options.pairs >= 0, "the number of pairs must not be negative (0 = all)");
  require(options.min_true_pairs >= 1, "a pair needs at least 1 true keypoint pair");
}

Contenders MakeContenders(const MatchingOptions& options) {
  Contenders contenders;
  const auto add = [&](Contender contender) {
    for (const Contender& other : contenders.all) {
      if (other.label != contender.label) continue;
      throw Error(ErrorCode::kInvalidArgument, "descriptor_twice",
                  "two rows would be named '" + contender.label +
                      "'; give one a name of its own, such as NAME:" + contender.label);
    }
    contenders.all.push_back(std::move(contender));
  };
  std::optional<std::size_t> sift;
  for (const DescriptorChoice& choice :
       options.descriptors.empty() ? AllDescriptorChoices() : options.descriptors) {
    if (choice.name == "sift" && !choice.repeats) sift = contenders.all.size();
    add({MakeDescriptor(choice.name, {choice.model.empty() ? options.model : choice.model}),
         choice.repeats ? kRepeated : kShared, choice.label});
  }
  for (std::size_t i = 0; i < options.features.size(); ++i) {
    add({nullptr, kOwn + i, options.features[i].label});
  }
  contenders.shown = contenders.all.size();
  if (!sift) contenders.all.push_back({MakeDescriptor("sift", {options.model})});
  contenders.sift = sift.value_or(contenders.shown);
  return contenders;
}

// Counts and reports what is done.
class Counter {
 public:
  Counter(const MatchingOptions& options, std::uint64_t total) : options_(options), total_(total) {}

  void Count(std::uint64_t more) {
    const std::lock_guard lock(mutex_);
    done_ = std::min(done_ + more, total_);
    if (options_.progress && !options_.progress(done_, total_)) {
      throw Error(ErrorCode::kCancelled, "evaluation_stopped", "stopped on request");
    }
  }

 private:
  const MatchingOptions& options_;
  const std::uint64_t total_;
  std::mutex mutex_;  // guards done_
  std::uint64_t done_ = 0;
};

// Measures pairs of one scene: every view is detected and described once. Not thread-safe. All
// arguments must outlive it.
class SceneMatcher {
 public:
  SceneMatcher(const SceneEntry& entry, TruthScene& scene, const std::vector<Contender>& contenders,
               const MatchingOptions& options)
      : entry_(entry), scene_(scene), contenders_(contenders), options_(options) {}

  // nullopt when the shared keypoints give fewer than min_true_pairs true pairs. One thread.
  std::optional<PairMeasurement> Measure(const ViewPair& pair);

 private:
  // A view's keypoints on the object, and their descriptors.
  struct ViewFeatures {
    std::vector<Keypoint> keypoints;
    EnlargedKeypoints finer;                         // the last ones
    std::map<std::size_t, Descriptors> descriptors;  // by contender
  };
  // The keypoints of both views that count in this pair, and the truth between them.
  struct PairTruth {
    std::array<std::vector<std::uint32_t>, 2> rows;  // of ViewFeatures
    std::vector<Keypoint> second;
    std::vector<std::optional<Vec2>> positions;
    std::vector<TruePair> true_pairs;
  };
  ViewFeatures& Features(int view, KeypointSet set);
  void ReadOwn(int view, KeypointSet set, ViewFeatures& features) const;
  PairTruth FindTruth(int first, int second, KeypointSet set);
  const Descriptors& Describe(std::size_t contender, int view, PairMeasurement& measurement);
  PairFigures Match(std::size_t contender, int first, int second, const PairTruth& truth,
                    PairMeasurement& measurement);

  const SceneEntry& entry_;
  TruthScene& scene_;
  const std::vector<Contender>& contenders_;
  const MatchingOptions& options_;
  std::map<std::pair<int, KeypointSet>, ViewFeatures> features_;
};

// The strongest keypoints on the object, as DetectKeypoints chooses them, with their descriptors.
void SceneMatcher::ReadOwn(int view, KeypointSet set, ViewFeatures& features) const {
  if (entry_.images.empty()) {
    throw Error(ErrorCode::kUnprocessable, "no_image_files",
                entry_.name +
                    " has no image files that another program could describe. Simulate "
                    "folders instead of tensors.");
  }
  const pliant::Features read =
      options_.features[set - kOwn].read(entry_.images[static_cast<std::size_t>(view)]);
  std::vector<std::uint32_t> rows(read.keypoints.size());
  std::iota(rows.begin(), rows.end(), 0U);
  std::ranges::stable_sort(rows, std::greater(),
                           [&](std::uint32_t row) { return read.keypoints[row].response; });
  rows.resize(std::min(rows.size(), static_cast<std::size_t>(options_.max_keypoints)));
  std::erase_if(rows, [&](std::uint32_t row) {
    return !scene_.OnObject(view, {read.keypoints[row].x, read.keypoints[row].y});
  });
  for (const std::uint32_t row : rows) features.keypoints.push_back(read.keypoints[row]);
  const auto of_set = std::ranges::find(contenders_, set, &Contender::keypoints);
  features.descriptors.emplace(static_cast<std::size_t>(of_set - contenders_.begin()),
                               SelectRows(read.descriptors, rows));
}

SceneMatcher::ViewFeatures& SceneMatcher::Features(int view, KeypointSet set) {
  const auto [place, is_new] = features_.try_emplace({view, set});
  ViewFeatures& features = place->second;
  if (!is_new) return features;
  if (set >= kOwn) {
    ReadOwn(view, set, features);
    return features;
  }
  const KeypointOptions options{options_.max_keypoints, set == kRepeated};
  const Image& image = scene_.ViewImage(view);
  const std::vector<Keypoint> found = options_.enlarge ? DetectLowContrastKeypoints(image, options)
                                                       : DetectKeypoints(image, options);
  for (const Keypoint& k : found) {
    if (scene_.OnObject(view, {k.x, k.y})) features.keypoints.push_back(k);
  }
  if (!options_.enlarge) return features;
  EnlargedKeypoints more = DetectEnlarged(image, found, /*max_side_px=*/0, options);
  features.finer.image = std::move(more.image);
  for (std::size_t i = 0; i < more.placed.size(); ++i) {
    const Keypoint& k = more.placed[i];
    if (!scene_.OnObject(view, {k.x, k.y})) continue;
    features.keypoints.push_back(k);
    features.finer.placed.push_back(k);
    features.finer.inside.push_back(more.inside[i]);
  }
  return features;
}

SceneMatcher::PairTruth SceneMatcher::FindTruth(int first, int second, KeypointSet set) {
  PairTruth truth;
  const std::array<int, 2> views = {first, second};
  for (std::size_t side = 0; side < 2; ++side) {
    const std::vector<Keypoint>& keypoints = Features(views[side], set).keypoints;
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
  ViewFeatures& features = Features(view, contenders_[contender].keypoints);
  const auto [place, is_new] = features.descriptors.try_emplace(contender);
  if (!is_new) return place->second;
  const Stopwatch watch;
  const Descriptor& descriptor = *contenders_[contender].descriptor;
  const std::span<const Keypoint> keypoints(features.keypoints);
  const std::size_t plain = keypoints.size() - features.finer.inside.size();
  place->second = descriptor.DescribeFine(scene_.ViewImage(view), keypoints.first(plain),
                                          {&features.finer, 1}, /*threads=*/1);
  measurement.describe_seconds[contender] += watch.seconds();
  measurement.described[contender] += static_cast<double>(features.keypoints.size());
  return place->second;
}

PairFigures SceneMatcher::Match(std::size_t contender, int first, int second,
                                const PairTruth& truth, PairMeasurement& measurement) {
  const Descriptors a = SelectRows(Describe(contender, first, measurement), truth.rows[0]);
  const Descriptors b = SelectRows(Describe(contender, second, measurement), truth.rows[1]);
  CheckDescriptors(a, contenders_[contender].label.c_str());
  CheckDescriptors(b, contenders_[contender].label.c_str());
  const std::vector<pliant::Match> matches = MatchDescriptors(PackedDescriptors(b), a);
  return CountMatches(matches, truth.positions, truth.true_pairs, truth.second,
                      options_.tolerance_px);
}

std::optional<PairMeasurement> SceneMatcher::Measure(const ViewPair& pair) {
  const auto [first, second] = std::pair(pair.first, pair.second);
  std::map<KeypointSet, PairTruth> truths;
  const PairTruth& shared = truths[kShared] = FindTruth(first, second, kShared);
  if (static_cast<int>(shared.true_pairs.size()) < options_.min_true_pairs) return std::nullopt;
  PairMeasurement measurement;
  measurement.pair = pair;
  measurement.describe_seconds.resize(contenders_.size());
  measurement.described.resize(contenders_.size());
  for (std::size_t c = 0; c < contenders_.size(); ++c) {
    const KeypointSet set = contenders_[c].keypoints;
    const auto [truth, is_new] = truths.try_emplace(set);
    if (is_new) truth->second = FindTruth(first, second, set);
    measurement.figures.push_back(Match(c, first, second, truth->second, measurement));
  }
  return measurement;
}

// Measures the candidates, one task a scene; those that cannot be measured stay empty.
std::vector<std::optional<PairMeasurement>> MeasureAll(const Dataset& dataset,
                                                       const std::vector<PairCandidate>& candidates,
                                                       const Contenders& contenders,
                                                       const MatchingOptions& options,
                                                       Counter& counter) {
  std::map<std::size_t, std::vector<std::size_t>> by_scene;
  for (std::size_t i = 0; i < candidates.size(); ++i) by_scene[candidates[i].scene].push_back(i);
  const std::vector<std::pair<std::size_t, std::vector<std::size_t>>> tasks(by_scene.begin(),
                                                                            by_scene.end());
  std::vector<std::optional<PairMeasurement>> measured(candidates.size());
  ParallelFor(tasks.size(), options.jobs, [&](std::size_t t) {
    const SceneEntry& entry = dataset.scenes[tasks[t].first];
    const std::unique_ptr<TruthScene> scene = entry.load();
    SceneMatcher matcher(entry, *scene, contenders.all, options);
    for (const std::size_t i : tasks[t].second) {
      measured[i] = matcher.Measure(candidates[i].pair);
      counter.Count(measured[i] || options.pairs == 0 ? 1 : 0);
    }
  });
  return measured;
}

// Means of one contender over the pairs that `in` lets through.
template <typename In>
DescriptorResult Average(const std::vector<PairMeasurement>& measured, const Contenders& contenders,
                         std::size_t row, const In& in) {
  DescriptorResult result;
  result.label = contenders.all[row].label;
  if (contenders.all[row].descriptor) {
    result.model_id = contenders.all[row].descriptor->info().model_id;
  }
  double squares = 0, sift = 0, seconds = 0, described = 0;
  for (const PairMeasurement& m : measured) {
    if (!in(m)) continue;
    const PairFigures& figures = m.figures[row];
    ++result.pairs;
    result.ms += figures.ms();
    squares += figures.ms() * figures.ms();
    sift += m.figures[contenders.sift].ms();
    result.mma += figures.mma();
    result.mutual_precision += figures.mutual_precision();
    result.correct_matches += figures.correct_mutual;
    result.keypoints += 0.5 * (figures.first + figures.second);
    result.true_pairs += figures.true_pairs;
    seconds += m.describe_seconds[row];
    described += m.described[row];
  }
  if (result.pairs == 0) return result;
  const double n = result.pairs;
  result.ms_ratio_to_sift = sift > 0 ? result.ms / sift : 0;
  for (double* mean : {&result.ms, &result.mma, &result.mutual_precision, &result.correct_matches,
                       &result.keypoints, &result.true_pairs}) {
    *mean /= n;
  }
  const double variance = std::max(0.0, squares / n - result.ms * result.ms);
  result.ms_error = n > 1 ? std::sqrt(variance / (n - 1)) : 0;
  result.describe_us = described > 0 ? 1e6 * seconds / described : 0;
  return result;
}

template <typename In>
std::vector<DescriptorResult> AverageAll(const std::vector<PairMeasurement>& measured,
                                         const Contenders& contenders, const In& in) {
  std::vector<DescriptorResult> results;
  for (std::size_t row = 0; row < contenders.shown; ++row)
    results.push_back(Average(measured, contenders, row, in));
  return results;
}

void AddSubsets(const std::vector<PairMeasurement>& measured, const Contenders& contenders,
                MatchingReport& report) {
  std::vector<double> values;
  std::vector<std::string> groups;
  for (const PairMeasurement& m : measured) {
    if (m.pair.sweep) values.push_back(*m.pair.sweep);
    groups.push_back(m.pair.group);
  }
  std::sort(values.begin(), values.end());
  std::sort(groups.begin(), groups.end());
  groups.erase(std::unique(groups.begin(), groups.end()), groups.end());
  // Written with six digits: what differs by less is the same step of the sweep.
  const auto same = [](double a, double b) { return std::abs(a - b) <= 1e-4 * (1 + std::abs(a)); };
  values.erase(std::unique(values.begin(), values.end(), same), values.end());
  for (const double value : values) {
    report.curve.push_back(
        {"", value, AverageAll(measured, contenders, [&](const PairMeasurement& m) {
           return m.pair.sweep && same(value, *m.pair.sweep);
         })});
  }
  if (groups.size() < 2) return;
  for (const std::string& group : groups) {
    report.groups.push_back(
        {group, 0, AverageAll(measured, contenders, [&](const PairMeasurement& m) {
           return m.pair.group == group;
         })});
  }
}

template <typename Value>
void Shuffle(std::vector<Value>& values, simulation::Random& random) {
  for (std::size_t left = values.size(); left > 1; --left)
    std::swap(values[left - 1],
              values[static_cast<std::size_t>(random.Integer(0, static_cast<int>(left) - 1))]);
}

}  // namespace

std::vector<PairCandidate> AllPairs(const Dataset& dataset) {
  std::vector<PairCandidate> candidates;
  for (std::size_t s = 0; s < dataset.scenes.size(); ++s) {
    for (const ViewPair& pair : dataset.scenes[s].pairs) candidates.push_back({s, pair});
  }
  return candidates;
}

std::vector<PairCandidate> ShufflePairs(const Dataset& dataset, std::uint64_t seed) {
  simulation::Random random(seed);
  std::vector<std::vector<PairCandidate>> scenes(dataset.scenes.size());
  for (const PairCandidate& candidate : AllPairs(dataset))
    scenes[candidate.scene].push_back(candidate);
  for (std::vector<PairCandidate>& scene : scenes) {
    Shuffle(scene, random);
    for (PairCandidate& candidate : scene) {
      const bool symmetric = !candidate.pair.sweep && candidate.pair.group.empty();
      if (symmetric && random.Chance(0.5F)) std::swap(candidate.pair.first, candidate.pair.second);
    }
  }
  Shuffle(scenes, random);
  std::vector<PairCandidate> order;
  for (std::size_t round = 0;; ++round) {
    const std::size_t before = order.size();
    for (const std::vector<PairCandidate>& scene : scenes) {
      if (round < scene.size()) order.push_back(scene[round]);
    }
    if (order.size() == before) return order;
  }
}

DescriptorChoice ParseDescriptorChoice(const std::string& text) {
  DescriptorChoice choice;
  const std::size_t equals = text.find('=');
  std::string name = text.substr(0, equals);
  if (equals != std::string::npos) choice.model = text.substr(equals + 1);
  const std::size_t colon = name.find(':');
  if (colon != std::string::npos) {
    choice.label = name.substr(0, colon);
    name = name.substr(colon + 1);
  }
  const bool weights = name == "deal" || name.starts_with("deal-");
  if (equals != std::string::npos && (choice.model.empty() || !weights)) {
    throw Error(ErrorCode::kInvalidArgument, "descriptor_invalid",
                "'" + text + "': only deal and its variants take a weight file, as in deal=FILE");
  }
  choice.repeats = name == "sift+repeats";
  choice.name = choice.repeats ? "sift" : name;
  if (choice.label.empty())
    choice.label = choice.model.empty() ? name : name + "=" + choice.model.stem().string();
  const std::vector<std::string> known = DescriptorNames();
  if (std::find(known.begin(), known.end(), choice.name) == known.end())
    MakeDescriptor(choice.name);  // throws, naming the known ones
  return choice;
}

std::vector<DescriptorChoice> AllDescriptorChoices() {
  std::vector<DescriptorChoice> choices;
  for (const std::string& name : DescriptorNames()) {
    choices.push_back({name, name, {}, false});
    if (name == "sift") choices.push_back({"sift+repeats", "sift", {}, true});
  }
  return choices;
}

MatchingReport RunMatchingBenchmark(const Dataset& dataset, const MatchingOptions& options) {
  CheckOptions(options);
  const Contenders contenders = MakeContenders(options);
  const std::vector<PairCandidate> candidates =
      options.pairs > 0 ? ShufflePairs(dataset, options.seed) : AllPairs(dataset);
  Counter counter(
      options, options.pairs > 0 ? static_cast<std::uint64_t>(options.pairs) : candidates.size());
  MatchingReport report;
  report.layout = dataset.layout;
  report.sweep = dataset.sweep;
  std::vector<PairMeasurement> measured;
  std::size_t next = 0;
  // In rounds, because only measuring tells which pairs can be measured: the next round takes as
  // many candidates as are missing still, so the result does not depend on the number of jobs.
  while (next < candidates.size()) {
    const std::size_t wanted = options.pairs > 0
                                   ? static_cast<std::size_t>(options.pairs) - measured.size()
                                   : candidates.size();
    if (wanted == 0) break;
    const std::size_t end = std::min(candidates.size(), next + wanted);
    const std::vector<PairCandidate> round(candidates.begin() + static_cast<std::ptrdiff_t>(next),
                                           candidates.begin() + static_cast<std::ptrdiff_t>(end));
    for (auto& one : MeasureAll(dataset, round, contenders, options, counter)) {
      if (one) {
        measured.push_back(std::move(*one));
      } else {
        ++report.left_out;
      }
    }
    next = end;
  }
  if (measured.empty()) {
    throw Error(ErrorCode::kUnprocessable, "no_pairs",
                "none of " + std::to_string(candidates.size()) + " pairs has " +
                    std::to_string(options.min_true_pairs) +
                    " true keypoint pairs; nothing can be measured");
  }
  report.pairs = static_cast<int>(measured.size());
  report.results = AverageAll(measured, contenders, [](const PairMeasurement&) { return true; });
  AddSubsets(measured, contenders, report);
  return report;
}

double CurveFlatness(const MatchingReport& report, std::size_t row) {
  double lowest = std::numeric_limits<double>::infinity();
  double highest = 0;
  for (const Subset& point : report.curve) {
    lowest = std::min(lowest, point.results[row].ms);
    highest = std::max(highest, point.results[row].ms);
  }
  return highest > 0 ? lowest / highest : 0;
}

}  // namespace pliant::evaluation
