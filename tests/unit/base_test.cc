// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The small tools of descriptor/base.
#include <memory>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "descriptor/base/hex.h"
#include "descriptor/base/lru_cache.h"
#include "descriptor/base/stopwatch.h"
#include "descriptor/base/strings.h"
#include "descriptor/base/unix_time.h"

namespace pliant {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

TEST(Strings, OnlyLettersOfAsciiHaveACase) {
  EXPECT_EQ(Lower("Image/PNG \xC3\x84"), "image/png \xC3\x84");
  EXPECT_TRUE(EqualsIgnoringCase("Bearer", "bEARER"));
  EXPECT_FALSE(EqualsIgnoringCase("Bearer", "Bearer "));
  EXPECT_FALSE(EqualsIgnoringCase("[", "{")) << "as far apart as letters of both cases";
}

TEST(Strings, AreTrimmedOfBlanksAndTabs) {
  EXPECT_EQ(Trimmed(" \t a b\t"), "a b");
  EXPECT_EQ(Trimmed(" \t"), "");
  EXPECT_EQ(Trimmed(""), "");
}

TEST(Strings, AreSplitAndJoined) {
  EXPECT_THAT(Split("", ','), IsEmpty());
  EXPECT_THAT(Split("a", ','), ElementsAre("a"));
  EXPECT_THAT(Split(",a,,b,", ','), ElementsAre("", "a", "", "b"));
  EXPECT_EQ(Join({}, ", "), "");
  EXPECT_EQ(Join({"a"}, ", "), "a");
  EXPECT_EQ(Join({"", "a", ""}, ", "), ", a, ");
}

TEST(UnixTime, IsWrittenInUtc) {
  EXPECT_EQ(FormatUtc(0, "%Y-%m-%d %H:%M:%S"), "1970-01-01 00:00:00");
  EXPECT_EQ(FormatUtc(1'738'331'110'999, "%Y-%m-%dT%H:%M:%S"), "2025-01-31T13:45:10");
  EXPECT_EQ(FormatUtc(-1, "%Y-%m-%d %H:%M:%S"), "1969-12-31 23:59:59");
  EXPECT_GT(NowMs(), 1'700'000'000'000);
}

TEST(Hex, RandomNamesDiffer) {
  const std::string a = RandomHex(32);
  EXPECT_EQ(a.size(), 32U);
  EXPECT_TRUE(FromHex(a));
  EXPECT_NE(a, RandomHex(32));
}

TEST(LruCache, ForgetsTheLeastRecentlyUsed) {
  LruCache<std::string, std::string> cache(10);
  const auto four = std::make_shared<const std::string>("1234");
  cache.Add("a", four);
  cache.Add("b", four);
  EXPECT_EQ(cache.Find("a"), four);
  cache.Add("c", four);
  EXPECT_EQ(cache.Find("a"), four);
  EXPECT_EQ(cache.Find("b"), nullptr);
  EXPECT_EQ(cache.Find("c"), four);
  cache.Add("large", std::make_shared<const std::string>("12345678901"));
  EXPECT_EQ(cache.Find("large"), nullptr);
  cache.Add("a", four);
  EXPECT_EQ(cache.Find("a"), four);
}

TEST(Stopwatch, LapsAddUp) {
  const Stopwatch whole;
  Stopwatch laps;
  double sum_ms = 0;
  {
    const ScopedStopwatch scope(&sum_ms);
    EXPECT_GE(laps.LapMs(), 0);
  }
  EXPECT_GE(sum_ms, 0);
  const double seconds = whole.seconds();
  EXPECT_GE(seconds * 1000, sum_ms);
  EXPECT_GE(whole.ms(), seconds * 1000);
}

}  // namespace
}  // namespace pliant
