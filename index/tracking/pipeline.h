// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Frames through a tracker, one thread a stage: decode | detect and describe | verify.
#pragma once

#include <cstdint>
#include <functional>

#include "index/tracking/frame_source.h"
#include "index/tracking/tracker.h"

namespace pliant {

struct TrackedFrame {
  Frame frame;
  Location location;
  double describe_ms = 0;  // spent on this frame; the stages overlap
  double verify_ms = 0;
};

struct TrackSummary {
  std::int64_t frames = 0;  // looked at
  std::int64_t found = 0;
  double inlier_rate = 0;  // mean over all frames, lost ones as they are
  double seconds = 0;
  double frames_per_second = 0;
};

// Calls `each` for every frame, in order, on the caller's thread; when it returns false the rest is
// left out. What a stage throws is thrown here, after the frames before it.
TrackSummary TrackFrames(FrameSource& source, const Tracker& tracker,
                         const std::function<bool(const TrackedFrame&)>& each);

}  // namespace pliant
