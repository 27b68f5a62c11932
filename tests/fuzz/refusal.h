// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What the server answers to what it does not take.
#pragma once

#include "index/files/text.h"
#include "server/http/problem.h"
#include "tests/fuzz/fuzz.h"

namespace pliant::fuzz {

// Whether `work` returns. It may throw a ProblemError that blames the request; anything else ends
// the program.
template <typename Work>
bool Answers(Work&& work) {
  try {
    work();
    return true;
  } catch (const server::ProblemError& error) {
    const server::Problem& problem = error.problem();
    Require(problem.status >= 400 && problem.status < 500, "the request is to blame");
    Require(server::ProblemCodeOf(problem.code).status == problem.status, "the code is known");
    Require(IsValidUtf8(server::ProblemResponse(problem, "id").body), "an answer is UTF-8");
    return false;
  }
}

}  // namespace pliant::fuzz
