// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What images may be fetched from: kinds of network addresses, the operator's list, and which
// addresses on the web are taken at all. No network.
#include <map>
#include <string>
#include <vector>

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>

#include "descriptor/base/error.h"
#include "server/app/options.h"
#include "server/fetch/fetcher.h"
#include "server/fetch/web_address.h"

namespace pliant::server {
namespace {

AddressKind KindOfText(const std::string& text) {
  sockaddr_storage storage{};
  if (text.find(':') != std::string::npos) {
    auto* v6 = reinterpret_cast<sockaddr_in6*>(&storage);
    v6->sin6_family = AF_INET6;
    EXPECT_EQ(inet_pton(AF_INET6, text.c_str(), &v6->sin6_addr), 1) << text;
  } else {
    auto* v4 = reinterpret_cast<sockaddr_in*>(&storage);
    v4->sin_family = AF_INET;
    EXPECT_EQ(inet_pton(AF_INET, text.c_str(), &v4->sin_addr), 1) << text;
  }
  return KindOf(reinterpret_cast<const sockaddr*>(&storage));
}

TEST(AddressKind, OfEveryRegisteredNetworkAtItsEdges) {
  const std::map<AddressKind, std::vector<std::string>> expected = {
      {AddressKind::kPublic, {"1.0.0.0",
                              "8.8.8.8",
                              "9.255.255.255",
                              "11.0.0.0",
                              "100.63.255.255",
                              "100.128.0.0",
                              "126.255.255.255",
                              "128.0.0.0",
                              "169.253.255.255",
                              "169.255.0.0",
                              "172.15.255.255",
                              "172.32.0.0",
                              "191.255.255.255",
                              "192.0.1.0",
                              "192.0.3.0",
                              "192.167.255.255",
                              "192.169.0.0",
                              "198.17.255.255",
                              "198.20.0.0",
                              "203.0.112.255",
                              "203.0.114.0",
                              "223.255.255.255",
                              "2606:4700::1111",
                              "2001:200::1",
                              "2001:4860:4860::8888",
                              "2a00::1",
                              "3ffe::1",
                              "::ffff:8.8.8.8",
                              "64:ff9b::8.8.8.8"}},
      {AddressKind::kPrivate,
       {"10.0.0.0", "10.255.255.255", "100.64.0.0", "100.127.255.255", "127.0.0.0", "127.0.0.1",
        "127.255.255.255", "172.16.0.0", "172.31.255.255", "192.168.0.0", "192.168.255.255", "::1",
        "fc00::", "fd00:ec2::254", "fdff:ffff::1", "::ffff:127.0.0.1", "::ffff:10.1.2.3"}},
      {AddressKind::kNever,
       {"0.0.0.0",
        "0.255.255.255",
        "169.254.0.0",
        "169.254.169.254",
        "169.254.255.255",
        "192.0.0.0",
        "192.0.0.170",
        "192.0.2.1",
        "192.88.99.1",
        "198.18.0.0",
        "198.19.255.255",
        "198.51.100.1",
        "203.0.113.255",
        "224.0.0.0",
        "239.255.255.255",
        "240.0.0.0",
        "255.255.255.255",
        "::",
        "::2",
        "::127.0.0.1",
        "100::1",
        "64:ff9b:1::1",
        "64:ff9b::127.0.0.1",
        "64:ff9b::169.254.169.254",
        "64:ff9b::10.0.0.1",
        "::ffff:169.254.169.254",
        "::ffff:0.0.0.0",
        "2001::1",
        "2001:0:4136:e378::1",
        "2001:20::1",
        "2001:1ff:ffff::1",
        "2001:db8::1",
        "2002:7f00:1::",
        "2002:808:808::1",
        "3fff::1",
        "3fff:fff::1",
        "fe80::1",
        "febf::1",
        "fec0::1",
        "ff02::1",
        "4000::1",
        "1fff::1"}}};
  for (const auto& [kind, addresses] : expected) {
    for (const std::string& address : addresses) {
      EXPECT_EQ(KindOfText(address), kind) << address;
    }
  }
  sockaddr other{};
  other.sa_family = AF_UNIX;
  EXPECT_EQ(KindOf(&other), AddressKind::kNever);
}

TEST(FetchHosts, AreNamesSuffixesAndPorts) {
  const FetchHosts hosts({"Images.Example.org", "*.shop.example", "cdn.example:8443",
                          "*.lab.example:81", "192.0.2.7", "[2001:db8::1]:8080"});
  EXPECT_FALSE(hosts.empty());
  EXPECT_FALSE(hosts.AllowsAny());
  EXPECT_TRUE(hosts.Allows("http", "images.example.org", 80));
  EXPECT_TRUE(hosts.Allows("https", "images.example.org", 443));
  EXPECT_TRUE(hosts.Allows("https", "a.shop.example", 443));
  EXPECT_TRUE(hosts.Allows("https", "a.b.shop.example", 443));
  EXPECT_TRUE(hosts.Allows("https", "cdn.example", 8443));
  EXPECT_TRUE(hosts.Allows("http", "cdn.example", 8443));
  EXPECT_TRUE(hosts.Allows("http", "x.lab.example", 81));
  EXPECT_TRUE(hosts.Allows("http", "192.0.2.7", 80));
  EXPECT_TRUE(hosts.Allows("http", "[2001:db8::1]", 8080));
  EXPECT_TRUE(FetchHosts({"[2001:DB8:0::1]"}).Allows("http", "[2001:db8::1]", 80));
  struct Refused {
    const char *scheme, *host;
    int port;
  };
  for (const Refused& refused : std::vector<Refused>{{"http", "images.example.org", 443},
                                                     {"https", "images.example.org", 80},
                                                     {"https", "images.example.org", 8443},
                                                     {"https", "images.example.org.", 443},
                                                     {"https", "ximages.example.org", 443},
                                                     {"https", "images.example.org.evil", 443},
                                                     {"https", "x.images.example.org", 443},
                                                     {"https", "shop.example", 443},
                                                     {"https", ".shop.example", 443},
                                                     {"https", "xshop.example", 443},
                                                     {"https", "a.shop.example.evil", 443},
                                                     {"https", "cdn.example", 443},
                                                     {"http", "x.lab.example", 80},
                                                     {"http", "[2001:db8::1]", 80},
                                                     {"http", "", 80}}) {
    EXPECT_FALSE(hosts.Allows(refused.scheme, refused.host, refused.port)) << refused.host;
  }
  const FetchHosts any({"*"});
  EXPECT_TRUE(any.AllowsAny());
  EXPECT_TRUE(any.Allows("https", "whatever.example", 443));
  EXPECT_FALSE(any.Allows("https", "whatever.example", 22)) << "of other ports only those named";
  EXPECT_TRUE(FetchHosts({}).empty());
  EXPECT_FALSE(FetchHosts({}).Allows("http", "a", 80));
}

TEST(FetchHosts, RefusesWhatCannotBeMeant) {
  for (const std::string entry :
       {"", " ", "https://a.example", "a.example/", "a.example:", "a.example:0", "a.example:65536",
        "a.example:99999", "a.example:8x", "*a.example", "a.*.example", "*.", ".a.example", "a b",
        "user@a.example", "::1", "[::1", "a.example.", "m\xc3\xbctze.example"}) {
    EXPECT_THROW(FetchHosts({entry}), Error) << entry;
  }
}

TEST(FetchOptions, AreCheckedAtTheStart) {
  ServerOptions options;
  options.service.fetch.hosts = {"images.example.org", "*.shop.example"};
  options.service.fetch.allow_private = true;
  EXPECT_NO_THROW(CheckOptions(options));
  const ServiceOptions service = MakeServiceOptions(options);
  EXPECT_EQ(service.fetch.max_bytes, 32U << 20);
  EXPECT_EQ(service.fetch.most_at_once, options.http.threads / 4);
  options.service.fetch.hosts = {"*"};
  EXPECT_THROW(CheckOptions(options), Error) << "any host, and private addresses";
  options.service.fetch.allow_private = false;
  EXPECT_NO_THROW(CheckOptions(options));
  options.service.fetch.hosts = {"https://images.example.org"};
  EXPECT_THROW(CheckOptions(options), Error);
}

TEST(WebAddress, IsTakenApart) {
  const WebAddress plain("https://Images.Example.org/a/b.jpg?token=secret#part");
  EXPECT_EQ(plain.scheme(), "https");
  EXPECT_EQ(plain.host(), "images.example.org");
  EXPECT_EQ(plain.port(), 443);
  EXPECT_EQ(plain.Display(), "https://images.example.org/a/b.jpg");
  const WebAddress port("HTTP://a.example:8080");
  EXPECT_EQ(port.scheme(), "http");
  EXPECT_EQ(port.port(), 8080);
  EXPECT_EQ(port.Display(), "http://a.example:8080/");
  EXPECT_EQ(WebAddress("http://[2001:DB8::1]/").host(), "[2001:db8::1]");
  EXPECT_EQ(WebAddress("http://[2001:db8:0:0::0001]/").host(), "[2001:db8::1]");
  EXPECT_THAT(WebAddress("http://a.example/m\xc3\xbctze 1.jpg").Display(),
              testing::StrCaseEq("http://a.example/m%c3%bctze%201.jpg"));
  // However it is written, it is the address that is connected to.
  for (const std::string loopback : {"http://127.0.0.1/", "http://127.1/", "http://2130706433/",
                                     "http://0x7f.0.0.1/", "http://0177.0.0.1/"}) {
    EXPECT_EQ(WebAddress(loopback).host(), "127.0.0.1") << loopback;
  }
}

// Some versions of the library decode such a host after they have looked for an IPv4 address.
TEST(WebAddress, AnEncodedAddressIsRefusedOrWrittenAsOne) {
  for (const auto& [text, host] :
       {std::pair("http://2%33/", "0.0.0.23"), std::pair("http://127%2e1/", "127.0.0.1"),
        std::pair("http://0x7%66%2e1/", "127.0.0.1")}) {
    try {
      EXPECT_EQ(WebAddress(text).host(), host);
    } catch (const Error& error) {
      EXPECT_EQ(error.reason(), "image_url_invalid") << text;
    }
  }
}

TEST(WebAddress, FollowsARedirectionFromWhereItIs) {
  const WebAddress from("https://a.example/x/y.jpg?q");
  EXPECT_EQ(from.Redirected("z.png").Display(), "https://a.example/x/z.png");
  EXPECT_EQ(from.Redirected("/z.png").Display(), "https://a.example/z.png");
  EXPECT_EQ(from.Redirected("//b.example/z").Display(), "https://b.example/z");
  EXPECT_EQ(from.Redirected("http://b.example:81/z").port(), 81);
  EXPECT_EQ(from.Display(), "https://a.example/x/y.jpg") << "it is left as it was";
  for (const std::string location : {"ftp://b.example/", "file:///etc/passwd", "//u:p@b.example/",
                                     "http://b.example\x01/", "//", "gopher://b.example/"}) {
    EXPECT_THROW(from.Redirected(location), Error) << location;
  }
}

TEST(WebAddress, RefusesWhatIsNoneOrSuspicious) {
  for (const std::string text : {"",
                                 "x",
                                 "/a.jpg",
                                 "a.example/a.jpg",
                                 "//a.example/a.jpg",
                                 "ftp://a.example/a.jpg",
                                 "file:///etc/passwd",
                                 "gopher://a.example/",
                                 "dict://a.example/",
                                 "data:image/png;base64,AA",
                                 "javascript:alert(1)",
                                 "http://",
                                 "http:///",
                                 "http://user@a.example/",
                                 "http://user:pass@a.example/",
                                 "http://:@a.example/",
                                 "http://a.example\\@b.example/",
                                 "http://a.example:99999/",
                                 "http://a.example:x/",
                                 "http://a.example\r\nX: y/",
                                 "http://a.example/\n",
                                 "http://a.example/\x7f",
                                 "http://m\xc3\xbctze.example/",
                                 "http://a%2eexample%00/",
                                 "http://a.example.0x1/",
                                 "http://1.2.3.4.5/",
                                 "http://a.example%2f/",
                                 "http://[::1/",
                                 "http://[fe80::1%25eth0]/",
                                 "http://a b/",
                                 "http://a,b/",
                                 "http://a'b/"}) {
    EXPECT_THROW(WebAddress{text}, Error) << text;
  }
  EXPECT_THROW(WebAddress{"http://a.example/" + std::string(2048, 'a')}, Error);
  std::string wide = "http://a.example/";
  for (int i = 0; i < 700; ++i) wide += "\xc3\xbc";
  EXPECT_THROW(WebAddress{wide}, Error) << "too long once it is encoded";
}

}  // namespace
}  // namespace pliant::server
