// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Which Host headers are taken, and what proxies tell, without a socket.
#include <array>

#include <gtest/gtest.h>
#include <unistd.h>

#include "descriptor/base/error.h"
#include "server/app/options.h"
#include "server/http/forwarded.h"
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
  options.http.allowed_hosts = {"images.example", "shop_2.lan", "*"};
  EXPECT_NO_THROW(CheckOptions(options));
  for (const char* hosts :
       {"https://a.example", "a.example:80", "a.example/", "*.example", "a b"}) {
    options.http.allowed_hosts = {hosts};
    EXPECT_THROW(CheckOptions(options), Error) << hosts;
  }
}

// The request after a hop from `peer`.
Request Arrived(const std::string& peer, const HeaderFields& headers) {
  const TrustedProxies proxies({"127.0.0.1", "10.0.0.0/8", "2001:db8::/32"});
  Request request;
  request.remote_address = peer;
  request.headers = headers;
  request.headers.emplace("Host", "127.0.0.1:8080");
  proxies.Apply(request);
  return request;
}

TEST(TrustedProxies, TellTheClient) {
  const auto client = [](const std::string& peer, const std::string& name,
                         const std::string& value) {
    return Arrived(peer, {{name, value}}).remote_address;
  };
  const std::string list = "X-Forwarded-For";
  EXPECT_EQ(client("192.0.2.1", list, "198.51.100.7"), "192.0.2.1") << "not trusted";
  EXPECT_EQ(client("127.0.0.1", list, "198.51.100.7"), "198.51.100.7");
  EXPECT_EQ(client("::ffff:127.0.0.1", list, "198.51.100.7:4711"), "198.51.100.7");
  EXPECT_EQ(client("2001:db8::1", list, "2001:DB9:0::7"), "2001:db9::7");
  EXPECT_EQ(client("127.0.0.1", list, "1.1.1.1, 198.51.100.7, 10.1.2.3"), "198.51.100.7")
      << "what the client itself sends does not count";
  EXPECT_EQ(client("127.0.0.1", list, "10.1.2.3"), "10.1.2.3");
  for (const char* strange : {"", "unknown", ",", "1.2.3", "_hidden", "[::1"}) {
    EXPECT_EQ(client("127.0.0.1", list, strange), "127.0.0.1") << strange;
  }
  EXPECT_EQ(client("127.0.0.1", "Forwarded",
                   "for=1.1.1.1, For=\"[2001:db9::7]:80\";proto=http, for=10.0.0.1"),
            "2001:db9::7");
  EXPECT_EQ(client("127.0.0.1", "Forwarded", "for=\"1.1.1.1, for=198.51.100.7"), "198.51.100.7")
      << "a quote of the client cannot swallow what the proxy adds";
  EXPECT_EQ(client("127.0.0.1", "Forwarded", "for=_hidden;proto=https"), "127.0.0.1");
  const HeaderFields both = {{list, "198.51.100.7"}, {"Forwarded", "for=1.1.1.1"}};
  EXPECT_EQ(Arrived("127.0.0.1", both).remote_address, "198.51.100.7");
  const HeaderFields two = {{list, "1.1.1.1"}, {list, "198.51.100.7"}};
  EXPECT_EQ(Arrived("127.0.0.1", two).remote_address, "198.51.100.7");
}

TEST(TrustedProxies, TellSchemeHostAndPrefix) {
  const HeaderFields all = {{"X-Forwarded-For", "198.51.100.7"},
                            {"X-Forwarded-Proto", "https"},
                            {"X-Forwarded-Host", "shop.example:8443"},
                            {"X-Forwarded-Prefix", "/pliant/"}};
  const Request request = Arrived("127.0.0.1", all);
  EXPECT_TRUE(request.is_https);
  EXPECT_EQ(request.header("Host"), "shop.example:8443");
  EXPECT_EQ(request.headers.count("Host"), 1U);
  EXPECT_EQ(request.base_path, "/pliant");
  const Request other = Arrived("192.0.2.1", all);
  EXPECT_FALSE(other.is_https);
  EXPECT_EQ(other.header("Host"), "127.0.0.1:8080");
  EXPECT_EQ(other.base_path, "");
  const Request standard = Arrived(
      "127.0.0.1", {{"Forwarded", "for=198.51.100.7;proto=https;host=\"shop.example:8443\""}});
  EXPECT_TRUE(standard.is_https);
  EXPECT_EQ(standard.header("Host"), "shop.example:8443");
  for (const char* strange : {"pliant", "//evil.example", "/a\"b", "/", "/a b"}) {
    EXPECT_EQ(Arrived("127.0.0.1", {{"X-Forwarded-Prefix", strange}}).base_path, "") << strange;
  }
}

TEST(TrustedProxies, AreAddressesOrNetworks) {
  for (const char* good : {"::1", "10.0.0.0/8", "0.0.0.0/0", "::/0", "fe80::/10", "192.0.2.1/32"}) {
    EXPECT_NO_THROW(TrustedProxies({good})) << good;
  }
  for (const char* bad : {"", "proxy", "10.0.0.0/33", "10.0.0.0/-1", "10.0.0.0/", "::/129", "1.2.3",
                          "10.0.0.0/8/8"}) {
    EXPECT_THROW(TrustedProxies({bad}), Error) << bad;
  }
  EXPECT_FALSE(TrustedProxies({"10.0.0.0/9"}).Contain("10.128.0.1"));
  EXPECT_TRUE(TrustedProxies({"10.0.0.0/9"}).Contain("10.127.0.1"));
  EXPECT_FALSE(TrustedProxies({"0.0.0.0/0"}).Contain("2001:db8::1"));
  ServerOptions options;
  options.http.trusted_proxies = {"10.0.0.0/99"};
  EXPECT_THROW(CheckOptions(options), Error);
  options.http.trusted_proxies.clear();
  for (const char* path : {"pliant", "/", "/a/", "//a", "/a?b"}) {
    options.http.base_path = path;
    EXPECT_THROW(CheckOptions(options), Error) << path;
  }
}

}  // namespace
}  // namespace pliant::server
