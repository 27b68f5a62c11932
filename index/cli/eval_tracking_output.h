// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The tracking benchmark's report as text, JSON, CSV and curves.
#pragma once

#include <string>

#include "descriptor/image/image.h"
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

// Inlier rate, tracked share, error and SSIM over the time of the sequences, in ten steps.
Image PlotTrackingReport(const TrackingReport& report);

}  // namespace pliant::cli
