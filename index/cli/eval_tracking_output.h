// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The tracking benchmark's report as text, JSON and CSV.
#pragma once

#include <string>

#include "index/json/json.h"
#include "index/tracking/tracking_benchmark.h"

namespace pliant::cli {

// A table, then one per group.
std::string TrackingReportText(const TrackingReport& report);

// {"frames", "unseen", "sequences": [...], "results": [{"descriptor", "inlier_rate", "ssim",
// "error_px", "tracked_share", ...}], "groups": [...], "over_time": [...]}. "error_px" is
// null where nothing was found.
Json TrackingReportJson(const TrackingReport& report);

// One row per view and descriptor.
std::string TrackingReportCsv(const TrackingReport& report);

}  // namespace pliant::cli
