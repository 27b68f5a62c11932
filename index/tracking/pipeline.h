// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Runs frames through a tracker, one thread per stage: decode | detect and describe | verify. Each
// stage is at most one frame ahead of the next.
#pragma once

#include <cstdint>
#include <functional>

#include "index/tracking/frame_source.h"
#include "index/tracking/tracker.h"

namespace pliant {

struct TrackedFrame {
  Frame frame;
  Location location;
  double describe_ms = 0;  // for this frame; the stages overlap
  double verify_ms = 0;
};

struct TrackSummary {
  std::int64_t frames = 0;  // processed
  std::int64_t found = 0;
  double inlier_rate = 0;  // mean over all frames, including lost ones
  double seconds = 0;
  double frames_per_second = 0;
};

// Calls `each` for every frame, in order, on the caller's thread; if it returns false, the
// remaining frames are skipped. Exceptions of a stage are rethrown here, after the preceding
// frames.
TrackSummary TrackFrames(FrameSource& source, const Tracker& tracker,
                         const std::function<bool(const TrackedFrame&)>& each);

}  // namespace pliant
