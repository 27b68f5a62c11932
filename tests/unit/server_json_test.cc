// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// JSON that comes in, base64 and times.
#include <optional>
#include <random>
#include <string_view>
#include <vector>

#include <gtest/gtest.h>

#include "descriptor/base/base64.h"
#include "server/http/json.h"
#include "tests/unit/problem_of.h"

namespace pliant::server {
namespace {

TEST(Json, RefusesDepthAndNonObjects) {
  const auto nested = [](int depth) {
    return "{\"a\":" + std::string(depth - 1, '[') + std::string(depth - 1, ']') + "}";
  };
  EXPECT_EQ(ParseJson(nested(kMaxJsonDepth), "it").size(), 1U);
  EXPECT_EQ(ProblemOf([&] { ParseJson(nested(kMaxJsonDepth + 1), "it"); }).code, "invalid_json");
  EXPECT_EQ(ProblemOf([&] { ParseJson(nested(1'000'000), "it"); }).code, "invalid_json");
  for (const std::string text : {"", "1", "[]", "{", "{}x"}) {
    EXPECT_EQ(ProblemOf([&] { ParseJson(text, "it"); }).code, "invalid_json") << text;
  }
  EXPECT_EQ(ToText(Json("\xff")), "\"\xef\xbf\xbd\"");
}

TEST(Json, RefusesObjectsOfManyNames) {
  const auto with = [](std::size_t names) {
    std::string text = "{\"a\": [{";
    for (std::size_t i = 0; i < names; ++i) {
      text += (i == 0 ? "\"" : ", \"") + std::to_string(i) + "\": 1";
    }
    return text + "}]}";
  };
  EXPECT_EQ(ParseJson(with(kMaxJsonNames), "it")["a"][0].size(), kMaxJsonNames);
  const Problem problem = ProblemOf([&] { ParseJson(with(kMaxJsonNames + 1), "it"); });
  EXPECT_EQ(problem.code, "invalid_json");
  EXPECT_EQ(problem.detail, "it has more than 1000 keys in one object.");
  // More than a minute where each name is looked up among those before it.
  EXPECT_EQ(ProblemOf([&] { ParseJson(with(1'000'000), "it"); }).code, "invalid_json");
}

TEST(Json, Base64IsDecoded) {
  const auto decoded = [](std::string_view text) -> std::optional<std::string> {
    std::vector<std::uint8_t> bytes;
    if (!Base64Decode(text, &bytes)) return std::nullopt;
    return std::string(bytes.begin(), bytes.end());
  };
  EXPECT_EQ(decoded(""), "");
  for (const char* text : {"Zm9vYmFy", "Zm9vYg==", "Zm9vYg", "Zm8=", "Zm8"}) {
    EXPECT_EQ(decoded(text), std::string("foobar").substr(0, decoded(text).value_or("").size()));
    EXPECT_TRUE(decoded(text)) << text;
  }
  EXPECT_EQ(decoded("data:image/png;base64,Zm9v"), "foo");
  for (const char* text : {"Zm9v\n", " Zm9v", "Zm\r\n9v\r\n", "Z m 9\tv"})
    EXPECT_EQ(decoded(text), "foo");
  EXPECT_EQ(decoded("Zm8=\n"), "fo");
  EXPECT_EQ(decoded("Zm-_"), decoded("Zm+/")) << "RFC 4648, section 5";
  EXPECT_EQ(decoded("data:;base64,Zm9v"), "foo");
  for (const char* text : {"Z", "Zg=", "Zg===", "Zh==", "Zm9=", "Zm9v\v", "====", "===", "=",
                           "Zm9v=", "data:image/png,Zm9v", "data:Zm9v", "Zm9v\xff"}) {
    EXPECT_FALSE(decoded(text)) << text;
  }
  EXPECT_FALSE(decoded(std::string_view("Zm\0v", 4)));
}

TEST(Json, Base64) {
  // RFC 4648, section 10
  EXPECT_EQ(Base64("", 0), "");
  EXPECT_EQ(Base64("f", 1), "Zg==");
  EXPECT_EQ(Base64("fo", 2), "Zm8=");
  EXPECT_EQ(Base64("foo", 3), "Zm9v");
  EXPECT_EQ(Base64("foobar", 6), "Zm9vYmFy");
  std::mt19937 random(4);
  for (int i = 0; i < 200; ++i) {
    std::string bytes;
    for (std::size_t n = random() % 20; n > 0; --n) bytes += static_cast<char>(random());
    std::string decoded;
    EXPECT_TRUE(Base64UrlDecode(Base64UrlEncode(bytes), &decoded));
    EXPECT_EQ(decoded, bytes);
  }
  std::string ignored;
  for (const char* text : {"a", "ab=", "Zg=", "a+b/", "Zh", "\xff"}) {
    EXPECT_FALSE(Base64UrlDecode(text, &ignored)) << text;
  }
}

TEST(Json, Time) {
  EXPECT_EQ(IsoTime(0), "1970-01-01T00:00:00.000Z");
  EXPECT_EQ(IsoTime(1769860800123), "2026-01-31T12:00:00.123Z");
  EXPECT_EQ(IsoTime(-1), "1969-12-31T23:59:59.999Z");
}

}  // namespace
}  // namespace pliant::server
