// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/tracking/tracking_benchmark.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <memory>
#include <mutex>
#include <set>
#include <utility>

#include "descriptor/base/error.h"
#include "descriptor/base/parallel.h"
#include "descriptor/features/descriptor.h"
#include "descriptor/warp/unwarp.h"
#include "index/tracking/tracker.h"

namespace pliant {
namespace {

constexpr int kSampleStep = 8;  // pixels of the template

namespace fs = std::filesystem;
using evaluation::TruthScene;

constexpr std::size_t kLeastSeen = 20;  // of the sampled points
constexpr int kMaxDetected = 4096;      // in the template, on the object and beside it

bool HoldsScenes(const fs::path& folder) {
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    if (entry.path().extension() == ".safetensors") return true;
    if (fs::exists(entry.path() / "scene.json")) return true;
  }
  return fs::exists(folder / "scene.json");
}

// The template is described as Tracker does.
Features DescribeAt(const Descriptor& descriptor, const Image& image,
                    const std::vector<Keypoint>& keypoints, ImageRole role) {
  return {image.width, image.height, keypoints,
          role == ImageRole::kReference ? descriptor.DescribeReference(image, keypoints, 1)
                                        : descriptor.Describe(image, keypoints, 1),
          descriptor.info().model_id};
}

// What of the template (view 0) is the object.
struct TemplateTruth {
  PixelBox box;
  Image mask;                 // of view 0's size
  Image image;                // the box of view 0
  std::vector<Vec2> samples;  // every 8 pixels of view 0, on the object; none if it is not seen
};

TemplateTruth FindTemplate(const TruthScene& scene) {
  const Image& view = scene.ViewImage(0);
  TemplateTruth found;
  found.mask = {view.width, view.height, 1, std::vector<std::uint8_t>(view.pixels.size(), 0)};
  for (int y = 0; y < view.height; ++y) {
    for (int x = 0; x < view.width; ++x) {
      const Vec2 p{static_cast<double>(x), static_cast<double>(y)};
      if (!scene.OnObject(0, p)) continue;
      found.mask.pixels[static_cast<std::size_t>(y) * view.width + x] = 255;
      if (x % kSampleStep == 0 && y % kSampleStep == 0) found.samples.push_back(p);
    }
  }
  if (const auto box = BoxOfMask(found.mask)) {
    found.box = *box;
    found.image = CutOut(view, *box);
  }
  return found;
}

// The sampled points that a view shows.
struct ViewTruth {
  std::vector<Vec2> samples;  // pixels of the template's box
  std::vector<Vec2> seen;     // where they are in the view
  double size_px = 0;
};

ViewTruth FindSeen(TruthScene& scene, const TemplateTruth& reference, int view) {
  ViewTruth truth;
  Vec2 low{1e9, 1e9};
  Vec2 high{-1e9, -1e9};
  for (const Vec2 p : reference.samples) {
    const auto q = scene.Map(0, p, view);
    if (!q) continue;
    truth.samples.push_back({p.x - reference.box.x, p.y - reference.box.y});
    truth.seen.push_back(*q);
    low = {std::min(low.x, q->x), std::min(low.y, q->y)};
    high = {std::max(high.x, q->x), std::max(high.y, q->y)};
  }
  if (!truth.seen.empty()) truth.size_px = std::max(high.x - low.x, high.y - low.y);
  return truth;
}

class Benchmark {
 public:
  Benchmark(const std::vector<TrackingSequence>& sequences, const TrackingBenchmarkOptions& options)
      : sequences_(sequences), options_(options), parts_(sequences.size()) {
    for (const std::string& name : options.descriptors) {
      descriptors_.push_back(MakeDescriptor(name, {options.model}));
    }
  }

  TrackingReport Go() {
    ParallelFor(sequences_.size(), options_.jobs, [this](std::size_t i) { Follow(i); });
    TrackingReport report;
    std::set<std::string> groups;
    for (std::size_t i = 0; i < sequences_.size(); ++i) {
      const TrackingSequence& sequence = sequences_[i];
      report.sequences.push_back((sequence.group.empty() ? "" : sequence.group + "/") +
                                 sequence.scene.name);
      report.unseen += parts_[i].unseen;
      report.views.insert(report.views.end(), parts_[i].views.begin(), parts_[i].views.end());
      groups.insert(sequence.group);
    }
    if (report.views.empty()) {
      throw Error(ErrorCode::kUnprocessable, "no_frames",
                  "no view of any sequence shows enough of its template");
    }
    report.frames = static_cast<int>(report.views.size() / descriptors_.size());
    for (const auto& descriptor : descriptors_) {
      TrackingResult result;
      result.descriptor = descriptor->info().name;
      result.model_id = descriptor->info().model_id;
      report.results.push_back(result);
    }
    const auto like = report.results;
    report.results = SummarizeViews(report.views, like, [](const TrackedView&) { return true; });
    if (groups.size() > 1) AddGroups(groups, report);
    return report;
  }

 private:
  struct Part {  // of the report, a sequence
    std::vector<TrackedView> views;
    int unseen = 0;
  };

  void AddGroups(const std::set<std::string>& names, TrackingReport& report) const {
    for (const std::string& name : names) {
      TrackingReport::Subset group{name, 0, 0, {}};
      for (const TrackingSequence& s : sequences_) group.sequences += s.group == name ? 1 : 0;
      group.results = SummarizeViews(report.views, report.results, [&](const TrackedView& view) {
        return sequences_[view.sequence].group == name;
      });
      group.frames = group.results.front().frames;
      report.groups.push_back(std::move(group));
    }
  }

  void Follow(std::size_t sequence) {
    const auto scene = sequences_[sequence].scene.load();
    const TemplateTruth reference = FindTemplate(*scene);
    std::vector<Features> templates;
    if (!reference.samples.empty()) {
      const auto keypoints = DetectKeypoints(scene->ViewImage(0), {.max_keypoints = kMaxDetected});
      std::vector<Keypoint> on_object;  // only these count, and are described
      for (const Keypoint& k : keypoints) {
        if (!scene->OnObject(0, {k.x, k.y})) continue;
        on_object.push_back(k);
        if (on_object.size() == static_cast<std::size_t>(options_.max_keypoints)) break;
      }
      for (const auto& descriptor : descriptors_) {
        templates.push_back(FeaturesInside(
            DescribeAt(*descriptor, scene->ViewImage(0), on_object, ImageRole::kReference),
            reference.box, reference.mask, on_object.size()));
      }
    }
    for (int view = 1; view < scene->views(); view += options_.every) {
      const ViewTruth truth = FindSeen(*scene, reference, view);
      if (truth.seen.size() < kLeastSeen) {
        ++parts_[sequence].unseen;
      } else {
        Measure(sequence, *scene, view, reference, templates, truth);
      }
      Count(scene->views());
    }
  }

  void Measure(std::size_t sequence, const TruthScene& scene, int view,
               const TemplateTruth& reference, const std::vector<Features>& templates,
               const ViewTruth& truth) {
    const Image& image = scene.ViewImage(view);
    const auto keypoints = DetectKeypoints(image, {.max_keypoints = options_.max_keypoints});
    for (std::size_t d = 0; d < descriptors_.size(); ++d) {
      const Features features = DescribeAt(*descriptors_[d], image, keypoints, ImageRole::kQuery);
      const Location location = Locate(Verifier(features, options_.locate.verification), features,
                                       templates[d], options_.locate);
      TrackedView tracked;
      tracked.sequence = sequence;
      tracked.descriptor = d;
      tracked.view = view;
      tracked.time = static_cast<double>(view) / (scene.views() - 1);
      tracked.found = location.found;
      tracked.reason = location.reason;
      tracked.matches = location.matches;
      tracked.inliers = static_cast<int>(location.inliers.size());
      tracked.inlier_rate = location.inlier_rate();
      tracked.size_px = truth.size_px;
      if (location.found) Compare(image, *location.warp, reference, truth, tracked);
      parts_[sequence].views.push_back(tracked);
    }
  }

  void Compare(const Image& image, const ThinPlateSpline& warp, const TemplateTruth& reference,
               const ViewTruth& truth, TrackedView& tracked) {
    const PixelBox& box = reference.box;
    const UnwarpedImage flat = Unwarp(image, warp, box.width, box.height);
    const std::vector<float> ssim = SsimMap(flat.image, reference.image);
    const auto count = static_cast<double>(truth.seen.size());
    for (std::size_t i = 0; i < truth.seen.size(); ++i) {
      const Vec2 p = truth.samples[i];
      const Vec2 q = warp(p);
      tracked.error_px += std::hypot(q.x - truth.seen[i].x, q.y - truth.seen[i].y) / count;
      const auto at = static_cast<std::size_t>(p.y) * static_cast<std::size_t>(box.width) +
                      static_cast<std::size_t>(p.x);
      tracked.ssim += static_cast<double>(ssim[at]) / count;
    }
    tracked.tracked = tracked.error_px <= options_.tracked_error * truth.size_px;
  }

  void Count(int views) {
    if (!options_.progress) return;
    const std::lock_guard lock(progress_mutex_);
    const auto a_sequence =
        static_cast<std::uint64_t>((views - 1 + options_.every - 1) / options_.every);
    if (!options_.progress(++done_, sequences_.size() * a_sequence)) {
      throw Error(ErrorCode::kCancelled, "evaluation_stopped", "stopped on request");
    }
  }

  const std::vector<TrackingSequence>& sequences_;
  const TrackingBenchmarkOptions& options_;
  std::vector<std::shared_ptr<const Descriptor>> descriptors_;
  std::vector<Part> parts_;    // each written by one thread
  std::mutex progress_mutex_;  // guards done_ and the caller's progress
  std::uint64_t done_ = 0;
};

}  // namespace

std::vector<TrackingSequence> OpenTrackingSequences(const fs::path& folder) {
  std::vector<std::pair<std::string, fs::path>> places;
  std::error_code error;
  if (fs::is_directory(folder, error) && !HoldsScenes(folder)) {
    for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
      if (entry.is_directory() && HoldsScenes(entry.path())) {
        places.emplace_back(entry.path().filename().string(), entry.path());
      }
    }
    std::sort(places.begin(), places.end());
  }
  if (places.empty()) places.emplace_back("", folder);
  std::vector<TrackingSequence> sequences;
  for (const auto& [group, place] : places) {
    const evaluation::Dataset dataset = evaluation::OpenDataset(place);
    if (dataset.layout != evaluation::Layout::kFolders &&
        dataset.layout != evaluation::Layout::kTensors) {
      throw Error(ErrorCode::kInvalidArgument, "not_simulated",
                  place.string() + " is not a set of simulated sequences");
    }
    for (const evaluation::SceneEntry& scene : dataset.scenes) sequences.push_back({group, scene});
  }
  return sequences;
}

std::vector<TrackingResult> SummarizeViews(const std::vector<TrackedView>& views,
                                           const std::vector<TrackingResult>& like,
                                           const std::function<bool(const TrackedView&)>& take) {
  std::vector<TrackingResult> results;
  std::vector<int> found(like.size(), 0);
  for (const TrackingResult& result : like) {
    results.push_back({});
    results.back().descriptor = result.descriptor;
    results.back().model_id = result.model_id;
  }
  for (const TrackedView& view : views) {
    if (!take(view)) continue;
    TrackingResult& result = results[view.descriptor];
    ++result.frames;
    result.inlier_rate += view.inlier_rate;
    result.ssim += view.ssim;
    result.tracked_share += view.tracked ? 1 : 0;
    if (view.found) {
      ++found[view.descriptor];
      result.error_px += view.error_px;
    }
  }
  for (std::size_t d = 0; d < results.size(); ++d) {
    TrackingResult& result = results[d];
    if (result.frames == 0) continue;
    result.inlier_rate /= result.frames;
    result.ssim /= result.frames;
    result.tracked_share /= result.frames;
    result.found_share = static_cast<double>(found[d]) / result.frames;
    if (found[d] > 0) result.error_px /= found[d];
  }
  return results;
}

TrackingReport RunTrackingBenchmark(const std::vector<TrackingSequence>& sequences,
                                    const TrackingBenchmarkOptions& options) {
  Validate(options.locate);
  return Benchmark(sequences, options).Go();
}

}  // namespace pliant
