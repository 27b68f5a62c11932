// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Options that `track` and `eval tracking` share.
#pragma once

#include <CLI/CLI.hpp>

#include "index/verify/locate.h"

namespace pliant::cli {

// --iterations, --max-ratio, --tolerance, --regularization, --min-inliers.
void AddTrackingFlags(CLI::App& app, LocateOptions& locate);

}  // namespace pliant::cli
