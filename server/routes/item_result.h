// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What became of one item of a request that brings several.
#pragma once

#include "server/http/problem.h"
#include "server/routes/common.h"

namespace pliant::server {

// The object that `work` returns; when it throws, "status" and "problem" of that, which then
// concerns no other item.
template <typename Work>
Json ItemResult(Work&& work) {
  try {
    return work();
  } catch (...) {
    const Problem problem = CurrentProblem();
    LogProblem(problem);
    return {{"status", problem.status}, {"problem", ProblemSummary(problem)}};
  }
}

}  // namespace pliant::server
