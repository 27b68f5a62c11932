// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/base/utf8.h"

#include <gtest/gtest.h>

namespace pliant {
namespace {

TEST(Utf8, CodePointsOfEveryLength) {
  EXPECT_EQ(DecodeUtf8(""), U"");
  EXPECT_EQ(DecodeUtf8("M\xC3\xBCtze"), U"M\u00FCtze");
  EXPECT_EQ(DecodeUtf8("\xE5\xB8\xBD\xF0\x9F\xA7\xA2"), U"\u5E3D\U0001F9E2");
  EXPECT_EQ(DecodeUtf8("\xF4\x8F\xBF\xBF"), U"\U0010FFFF");
}

TEST(Utf8, BytesThatAreNoneAreReplacedOneByOne) {
  EXPECT_EQ(DecodeUtf8("a\xFFz"), U"a\uFFFDz");
  EXPECT_EQ(DecodeUtf8("\xC3"), U"\uFFFD");
  EXPECT_EQ(DecodeUtf8("\xC3z"), U"\uFFFDz");
  EXPECT_EQ(DecodeUtf8("\xE5\xB8"), U"\uFFFD\uFFFD");
  EXPECT_EQ(DecodeUtf8("\xC0\xAF"), U"\uFFFD\uFFFD") << "longer than it need be";
  EXPECT_EQ(DecodeUtf8("\xE0\x80\xAF"), U"\uFFFD\uFFFD\uFFFD");
  EXPECT_EQ(DecodeUtf8("\xED\xA0\x80"), U"\uFFFD\uFFFD\uFFFD") << "half of a pair";
  EXPECT_EQ(DecodeUtf8("\xF4\x90\x80\x80"), U"\uFFFD\uFFFD\uFFFD\uFFFD") << "beyond the last";
}

}  // namespace
}  // namespace pliant
