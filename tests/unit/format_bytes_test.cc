// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/base/format_bytes.h"

#include <cstdint>

#include <gtest/gtest.h>

namespace pliant {
namespace {

TEST(FormatBytes, HasTheLargestUnitThatFits) {
  EXPECT_EQ(FormatBytes(0), "0 bytes");
  EXPECT_EQ(FormatBytes(1), "1 byte");
  EXPECT_EQ(FormatBytes(1023), "1023 bytes");
  EXPECT_EQ(FormatBytes(1024), "1 KiB");
  EXPECT_EQ(FormatBytes(1536), "1.5 KiB");
  EXPECT_EQ(FormatBytes((1 << 20) - 1), "1 MiB");
  EXPECT_EQ(FormatBytes(std::uint64_t{32} << 20), "32 MiB");
  EXPECT_EQ(FormatBytes(std::uint64_t{5} << 40), "5 TiB");
  EXPECT_EQ(FormatBytes(UINT64_MAX), "16777216 TiB");
}

}  // namespace
}  // namespace pliant
