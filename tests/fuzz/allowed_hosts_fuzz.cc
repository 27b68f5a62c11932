// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Host headers.
#include <algorithm>
#include <cctype>

#include "server/http/origin_policy.h"
#include "tests/fuzz/fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using pliant::fuzz::Require;
  static const pliant::server::AllowedHosts kHosts("shop.example", {"more.example", "x"});
  const std::string host(pliant::fuzz::TextOf({data, size}));
  if (!kHosts.Allows(host)) return 0;
  Require(host.size() < 512 &&
              std::all_of(host.begin(), host.end(),
                          [](unsigned char c) {
                            return std::isalnum(c) != 0 ||
                                   std::string_view(".-_:[]").find(static_cast<char>(c)) !=
                                       std::string_view::npos;
                          }),
          "a name that is allowed has no other characters");
  std::string upper = host;
  std::transform(upper.begin(), upper.end(), upper.begin(),
                 [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
  Require(kHosts.Allows(upper), "names have no case");
  Require(host.find_last_not_of("0123456789") == std::string::npos ||
              host.find(':') != std::string::npos || kHosts.Allows(host + ":80"),
          "a port does not matter");
  return 0;
}
