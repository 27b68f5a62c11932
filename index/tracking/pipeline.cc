// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/tracking/pipeline.h"

#include <thread>
#include <utility>

#include "descriptor/base/stopwatch.h"

namespace pliant {
namespace {

constexpr std::size_t kFramesAhead = 3;  // that wait between two stages; each holds an image

struct Described {
  Frame frame;
  Features features;
  double describe_ms = 0;
};

// Runs `work` and tells the channel how it ended.
template <typename Value, typename Work>
void Produce(Channel<Value>& channel, Work&& work) {
  try {
    work();
    channel.Finish();
  } catch (...) {  // thrown again by Pop, in the consumer's thread
    channel.Finish(std::current_exception());
  }
}

// Lets go of a channel's producer however the consumer ends.
template <typename Value>
class AbandonAtEnd {
 public:
  explicit AbandonAtEnd(Channel<Value>& channel) : channel_(channel) {}
  ~AbandonAtEnd() { channel_.Abandon(); }
  AbandonAtEnd(const AbandonAtEnd&) = delete;
  AbandonAtEnd& operator=(const AbandonAtEnd&) = delete;

 private:
  Channel<Value>& channel_;
};

}  // namespace

TrackSummary TrackFrames(FrameSource& source, const Tracker& tracker,
                         const std::function<bool(const TrackedFrame&)>& each) {
  const Stopwatch watch;
  Channel<Frame> decoded(kFramesAhead);
  Channel<Described> described(kFramesAhead);
  // The threads are declared after the channels and before the guards, so that at the end the
  // guards free the threads, the threads are joined, and the channels go last.
  std::jthread decode([&] {
    Produce(decoded, [&] {
      while (auto frame = source.Next()) {
        if (!decoded.Push(std::move(*frame))) return;
      }
    });
  });
  std::jthread describe([&] {
    const AbandonAtEnd guard(decoded);
    Produce(described, [&] {
      while (auto frame = decoded.Pop()) {
        const Stopwatch stage;
        Features features = tracker.Describe(frame->image);
        if (!described.Push({std::move(*frame), std::move(features), stage.ms()})) return;
      }
    });
  });
  const AbandonAtEnd guard(described);

  TrackSummary summary;
  while (auto next = described.Pop()) {
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
