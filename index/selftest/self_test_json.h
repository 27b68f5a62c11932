// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The JSON form of a self-test's report, for the command line and the HTTP server.
#pragma once

#include "index/json/json.h"
#include "index/selftest/self_test.h"

namespace pliant {

// {"images", "photos", "outcomes": {"found", "perhaps", "missed", "wrong", "false_alarms": each
// {"count", "share", "low", "high"}}, "by_strength": [{"strength", "photos", "found": as above}],
// "by_size": [{"from", "to", "photos", "found"}], "false_alarm_rate", "found_from", "reaches_rate",
// "similar": [{"object", "image_id", "other", "other_image", "confused"}], "plain": [{"object",
// "image_id", "keypoints"}], "missed": [{"object", "image_id", "photos", "missed"}], "examples":
// [{"object", "image_id", "verdict", "probability", "strength", "size", "photo": base64 of a
// JPEG}], "seconds"}. Shares have a 95 % interval (Wilson 1927). Sizes are the square roots of the
// shares of the photos' areas. Of each list the first `most`; no `examples` for the command line.
Json SelfTestJson(const SelfTestReport& report, const SelfTestOptions& options, bool examples);

}  // namespace pliant
