// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <gtest/gtest.h>

#include "descriptor/base/error.h"

namespace pliant::testing {

// Runs `work`, which must throw Error with this code and, unless empty, this reason.
template <typename Work>
void ExpectError(ErrorCode code, const std::string& reason, Work&& work) {
  try {
    work();
    ADD_FAILURE() << "nothing was thrown; expected \"" << reason << "\"";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), code) << error.what();
    if (!reason.empty()) {
      EXPECT_EQ(error.reason(), reason) << error.what();
    }
    EXPECT_FALSE(std::string(error.what()).empty());
  }
}

}  // namespace pliant::testing
