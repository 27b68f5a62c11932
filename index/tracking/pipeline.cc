// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/tracking/pipeline.h"

#include <future>
#include <optional>
#include <utility>

#include "descriptor/base/stopwatch.h"

namespace pliant {
namespace {

// What `make` gives until it gives nothing, each value made in another thread while the one before
// it is used. The destructor waits for the value that is being made.
template <typename Make>
class Ahead {
 public:
  explicit Ahead(Make make) : make_(std::move(make)) { Start(); }
  Ahead(const Ahead&) = delete;
  Ahead& operator=(const Ahead&) = delete;

  // Throws what `make` throws. Not to be called after nothing came.
  auto Take() {
    auto value = next_.get();
    if (value) Start();
    return value;
  }

 private:
  void Start() { next_ = std::async(std::launch::async, std::ref(make_)); }

  Make make_;
  std::future<std::invoke_result_t<Make>> next_;
};

struct Described {
  Frame frame;
  Features features;
  double describe_ms = 0;
};

}  // namespace

TrackSummary TrackFrames(FrameSource& source, const Tracker& tracker,
                         const std::function<bool(const TrackedFrame&)>& each) {
  const Stopwatch watch;
  Ahead decoded([&] { return source.Next(); });
  Ahead described([&]() -> std::optional<Described> {
    auto frame = decoded.Take();
    if (!frame) return std::nullopt;
    const Stopwatch stage;
    Features features = tracker.Describe(frame->image);
    return Described{*std::move(frame), std::move(features), stage.ms()};
  });
  TrackSummary summary;
  while (auto next = described.Take()) {
    const Stopwatch stage;
    TrackedFrame tracked{std::move(next->frame), tracker.Find(next->features), next->describe_ms,
                         0};
    tracked.verify_ms = stage.ms();
    ++summary.frames;
    summary.found += tracked.location.found ? 1 : 0;
    summary.inlier_rate += tracked.location.inlier_rate();
    if (!each(tracked)) break;
  }
  summary.seconds = watch.seconds();
  if (summary.frames > 0) {
    const auto frames = static_cast<double>(summary.frames);
    summary.inlier_rate /= frames;
    if (summary.seconds > 0) summary.frames_per_second = frames / summary.seconds;
  }
  return summary;
}

}  // namespace pliant
