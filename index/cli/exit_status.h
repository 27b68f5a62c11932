// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The one place where errors become exit statuses of `pliant`.
#pragma once

#include "descriptor/base/error.h"

namespace pliant::cli {

enum class ExitStatus {
  kDone = 0,
  kFailed = 1,
  kWrongUsage = 2,
  kSomeSkipped = 3,  // done, but some inputs were skipped; each was named with its reason
};

inline ExitStatus ToExitStatus(ErrorCode code) {
  return code == ErrorCode::kInvalidArgument ? ExitStatus::kWrongUsage : ExitStatus::kFailed;
}

}  // namespace pliant::cli
