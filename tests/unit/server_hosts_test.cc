// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Which Host headers are taken, without a socket.
#include <array>

#include <gtest/gtest.h>
#include <unistd.h>

#include "descriptor/base/error.h"
#include "server/app/options.h"
#include "server/http/origin_policy.h"

namespace pliant::server {
namespace {

TEST(AllowedHosts, TakesAddressesAndOwnNames) {
  std::array<char, 256> machine{};
  ASSERT_EQ(gethostname(machine.data(), machine.size() - 1), 0);
  for (const char* listen : {"127.0.0.1", "0.0.0.0", "::", "192.0.2.7"}) {
    const AllowedHosts hosts(listen, {});
    for (const std::string host :
         {"127.0.0.1", "127.0.0.1:8080", "192.0.2.7:80", "[::1]", "[::1]:8080", "[fe80::1]:80",
          "localhost", "localhost:8080", "LocalHost.:8080", "localhost:"}) {
      EXPECT_TRUE(hosts.Allows(host)) << host;
    }
    EXPECT_TRUE(hosts.Allows(machine.data()));
    EXPECT_TRUE(hosts.Allows(std::string(machine.data()) + ":8080"));
  }
  EXPECT_TRUE(AllowedHosts("images.lan", {}).Allows("images.lan:8080"));
}

TEST(AllowedHosts, RefusesOtherNamesAndWhatIsMalformed) {
  const AllowedHosts hosts("127.0.0.1", {});
  for (const std::string host : {"evil.example",
                                 "evil.example:8080",
                                 "localhost.evil.example",
                                 "127.0.0.1.evil.example",
                                 "xlocalhost",
                                 "localhost:8080:8080",
                                 "localhost:80x",
                                 "localhost:808080",
                                 "[::1",
                                 "[::1]x",
                                 "[evil.example]",
                                 "::1",
                                 "127.0.0.1@evil.example",
                                 "evil.example@127.0.0.1",
                                 "127.1",
                                 "1.2.3.4.5",
                                 "",
                                 ".",
                                 ":8080",
                                 "[]",
                                 " localhost"}) {
    EXPECT_FALSE(hosts.Allows(host)) << host;
  }
}

TEST(AllowedHosts, TakesWhatTheOperatorNames) {
  const AllowedHosts hosts("127.0.0.1", {"images.example", "Shop.Example"});
  EXPECT_TRUE(hosts.Allows("images.example"));
  EXPECT_TRUE(hosts.Allows("IMAGES.example.:443"));
  EXPECT_TRUE(hosts.Allows("shop.example"));
  EXPECT_FALSE(hosts.Allows("sub.images.example"));
  EXPECT_TRUE(AllowedHosts("127.0.0.1", {"*"}).Allows("evil.example"));
}

TEST(AllowedHosts, OptionsAreNamesWithoutPortOrScheme) {
  ServerOptions options;
  options.allowed_hosts = "images.example,shop_2.lan,*";
  EXPECT_NO_THROW(CheckOptions(options));
  EXPECT_EQ(MakeHttpOptions(options).allowed_hosts.size(), 3U);
  for (const char* hosts :
       {"https://a.example", "a.example:80", "a.example/", "*.example", "a b"}) {
    options.allowed_hosts = hosts;
    EXPECT_THROW(CheckOptions(options), Error) << hosts;
  }
}

}  // namespace
}  // namespace pliant::server
