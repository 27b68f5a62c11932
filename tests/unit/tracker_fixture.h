// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A template and its tracker, for the parts of tracking_test.
#pragma once

#include "index/tracking/tracker.h"
#include "tests/unit/bent_images.h"
#include "tests/unit/expect_error.h"

namespace pliant::testing {

inline constexpr int kWidth = 400;
inline constexpr int kHeight = 300;

inline Image Template(std::uint64_t seed = 1) { return RichImage(seed, kWidth, kHeight); }

inline Tracker MakeTracker(TrackerOptions options = {}, const Image& reference = Template()) {
  options.threads = 1;
  return {MakeDescriptor("rootsift"), reference, options};
}

}  // namespace pliant::testing
