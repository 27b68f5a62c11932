// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "server/http/problem.h"

namespace pliant::server {

// The problem that `work` ends in; status 0 = none.
template <typename Work>
Problem ProblemOf(Work work) {
  try {
    work();
  } catch (const ProblemError& error) {
    return error.problem();
  }
  return {.status = 0};
}

}  // namespace pliant::server
