// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "tests/integration/strange_values.h"

#include <cctype>

namespace pliant::testing {

std::string Repeated(const std::string& text, std::size_t times) {
  std::string all;
  for (std::size_t i = 0; i < times; ++i) all += text;
  return all;
}

std::string Encoded(const std::string& text) {
  constexpr const char* kHex = "0123456789ABCDEF";
  std::string encoded;
  for (const unsigned char c : text) {
    if (std::isalnum(c) != 0 || c == '-' || c == '.' || c == '_') {
      encoded += static_cast<char>(c);
    } else {
      encoded += {'%', kHex[c >> 4], kHex[c & 15]};
    }
  }
  return encoded;
}

const std::vector<std::string>& StrangeTexts() {
  static const std::vector<std::string> texts = {"",
                                                 " ",
                                                 "0",
                                                 "1",
                                                 "-1",
                                                 "1.5",
                                                 "nan",
                                                 "-inf",
                                                 "1e999",
                                                 "99999999999999999999",
                                                 "-99999999999999999999",
                                                 "true",
                                                 "null",
                                                 "[]",
                                                 "{}",
                                                 "{\"a\":{\"gt\":[]}}",
                                                 "x,y",
                                                 "1,2,3,4",
                                                 "-1,-1,1e300,nan",
                                                 ".",
                                                 "..",
                                                 "a/b",
                                                 std::string("\0", 1),
                                                 "\xff",
                                                 "\xed\xa0\x80",
                                                 "\xe2\x80\xae",
                                                 "\xe2\x98\x83",
                                                 "%",
                                                 "'; DROP TABLE",
                                                 std::string(700, 'a'),
                                                 std::string(9000, '9'),
                                                 Repeated("[", 2000),
                                                 Repeated("{\"a\":", 500)};
  return texts;
}

const std::vector<std::string>& StrangeJson() {
  static const std::vector<std::string> values = {
      "null",
      "true",
      "0",
      "-1",
      "1.5",
      "1e400",
      "-1e308",
      "NaN",
      "99999999999999999999",
      "\"\"",
      "\"x\"",
      "\"5\"",
      "\"\\u0000\"",
      "\"\\ud800\"",
      "\"\xff\"",
      "[]",
      "[null]",
      "[1,2,3,4]",
      "[-1,0,1e300,1]",
      "{}",
      "{\"\":null}",
      "{\"a\":1,\"a\":2}",
      "\"" + std::string(70'000, 'a') + "\"",
      Repeated("[", 20) + Repeated("]", 20),
      Repeated("[", 50'000) + Repeated("]", 50'000),
      Repeated("{\"a\":", 5'000) + "1" + Repeated("}", 5'000)};
  return values;
}

const std::vector<std::string>& StrangeBodies() {
  static const std::vector<std::string> bodies = {"",
                                                  "null",
                                                  "[]",
                                                  "{",
                                                  "{}",
                                                  "{}{}",
                                                  "\xef\xbb\xbf{}",
                                                  "\xff",
                                                  std::string("\0", 1),
                                                  "0",
                                                  "{\"\":1}",
                                                  "{\"image\":1}",
                                                  Repeated("[", 100'000),
                                                  Repeated("{\"a\":", 100'000),
                                                  std::string(1'000'000, ' '),
                                                  "{\"a\":\"" + std::string(500'000, 'x') + "\"}"};
  return bodies;
}

const std::vector<std::string>& StrangeHeaders() {
  static const std::vector<std::string> headers = {"",
                                                   "x",
                                                   "*",
                                                   "\"",
                                                   "\"x\"",
                                                   "W/\"x\"",
                                                   "\"x\", *",
                                                   ",,,",
                                                   "\xff",
                                                   "bytes=0-0",
                                                   "bytes=5-1",
                                                   "bytes=-0",
                                                   "bytes=99999999999999999999-",
                                                   "bytes=0-1,2-3",
                                                   "items=0-1",
                                                   "bytes=",
                                                   "gzip;q=nan",
                                                   "gzip;q=2, br;q=-1",
                                                   "*;q=0",
                                                   "0",
                                                   "-1",
                                                   "1e999",
                                                   "Sun, 06 Nov 1994 08:49:37 GMT",
                                                   std::string(7000, 'a'),
                                                   Repeated("\"a\",", 1500)};
  return headers;
}

}  // namespace pliant::testing
