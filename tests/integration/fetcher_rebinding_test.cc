// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Names that mean another address each time they are asked for (DNS rebinding), through the
// system's resolver, as in a running server. This program has a getaddrinfo() and a connect() of
// its own, which the HTTP library finds in the place of the system's: the one answers what a test
// has written, the other takes connections to public addresses to a server of the test's.
#include <algorithm>
#include <cerrno>
#include <deque>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include <arpa/inet.h>
#include <dlfcn.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netdb.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include "server/fetch/fetcher.h"
#include "server/fetch/web_address.h"
#include "server/http/problem.h"
#include "tests/integration/elsewhere.h"

namespace {

constexpr const char* kPublic = "1.2.3.4";       // where the test's server is
constexpr const char* kUnreachable = "1.2.3.5";  // public, too, but nobody is there

// A resolver that lies: the first lookup of a name gets the first of its answers, and so on.
struct Resolver {
  std::mutex mutex;  // guards all below
  std::map<std::string, std::deque<std::vector<std::string>>> answers;
  int lookups = 0;
  std::vector<std::string> connected_to;
};

Resolver& TheResolver() {
  static Resolver resolver;
  return resolver;
}

template <typename Function>
Function* Real(const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}

std::string TextOf(const sockaddr* address) {
  char text[INET6_ADDRSTRLEN] = {};
  if (address->sa_family == AF_INET) {
    inet_ntop(AF_INET, &reinterpret_cast<const sockaddr_in*>(address)->sin_addr, text, sizeof text);
  } else if (address->sa_family == AF_INET6) {
    inet_ntop(AF_INET6, &reinterpret_cast<const sockaddr_in6*>(address)->sin6_addr, text,
              sizeof text);
  }
  return text;
}

}  // namespace

extern "C" int getaddrinfo(const char* name, const char* service, const addrinfo* hints,
                           addrinfo** result) {
  static auto* const real = Real<decltype(getaddrinfo)>("getaddrinfo");
  std::vector<std::string> addresses;
  {
    Resolver& resolver = TheResolver();
    const std::lock_guard lock(resolver.mutex);
    const auto known = resolver.answers.find(name == nullptr ? "" : name);
    if (known == resolver.answers.end()) return real(name, service, hints, result);
    ++resolver.lookups;
    if (known->second.empty()) return EAI_NONAME;
    addresses = known->second.front();
    known->second.pop_front();
  }
  addrinfo numeric = hints == nullptr ? addrinfo{} : *hints;
  numeric.ai_flags |= AI_NUMERICHOST;
  *result = nullptr;
  addrinfo** end = result;
  for (const std::string& address : addresses) {
    if (real(address.c_str(), service, &numeric, end) != 0) continue;  // of a family nobody wants
    while (*end != nullptr) end = &(*end)->ai_next;
  }
  return *result == nullptr ? EAI_NONAME : 0;
}

extern "C" int connect(int fd, const sockaddr* address, socklen_t size) {
  static auto* const real = Real<decltype(connect)>("connect");
  const std::string text = TextOf(address);
  {
    Resolver& resolver = TheResolver();
    const std::lock_guard lock(resolver.mutex);
    if (!text.empty()) resolver.connected_to.push_back(text);
  }
  if (text == kUnreachable) {
    errno = ECONNREFUSED;
    return -1;
  }
  if (text != kPublic) return real(fd, address, size);
  sockaddr_in here = *reinterpret_cast<const sockaddr_in*>(address);
  here.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  return real(fd, reinterpret_cast<const sockaddr*>(&here), sizeof here);
}

namespace pliant::testing {
namespace {

using server::Fetcher;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr const char* kImage = "the bytes of an image";

class RebindingTest : public ::testing::Test {
 protected:
  RebindingTest() {
    Resolver& resolver = TheResolver();
    const std::lock_guard lock(resolver.mutex);
    resolver.answers.clear();
    resolver.lookups = 0;
    resolver.connected_to.clear();
  }

  static void Answer(const std::string& name, std::deque<std::vector<std::string>> answers) {
    const std::lock_guard lock(TheResolver().mutex);
    TheResolver().answers[name] = std::move(answers);
  }
  static int Lookups() {
    const std::lock_guard lock(TheResolver().mutex);
    return TheResolver().lookups;
  }
  static std::vector<std::string> ConnectedTo() {
    const std::lock_guard lock(TheResolver().mutex);
    return TheResolver().connected_to;
  }

  std::string Url(const std::string& name, const std::string& path = "/a.png") const {
    return "http://" + name + ":" + std::to_string(other_.port()) + path;
  }
  Fetcher MakeFetcher() const {
    server::FetchOptions options;
    options.hosts = {"*.test:" + std::to_string(other_.port())};
    options.timeout = std::chrono::milliseconds(20'000);
    return Fetcher(options);
  }
  void ExpectImage(Fetcher& fetcher, const std::string& url) {
    const server::FetchedImage image = fetcher.Fetch(url);
    EXPECT_EQ(std::string(image.bytes->begin(), image.bytes->end()), kImage);
  }
  static void ExpectRefused(Fetcher& fetcher, const std::string& url) {
    try {
      fetcher.Fetch(url);
      ADD_FAILURE() << url << " was fetched";
    } catch (...) {
      const server::Problem problem = server::CurrentProblem();
      EXPECT_EQ(problem.code, "fetch_host_not_allowed") << problem.detail;
      EXPECT_THAT(problem.detail, HasSubstr("no public address"));
    }
  }

  Elsewhere other_{[](const std::string& head) {
    return head.find("GET /away") == 0 ? Elsewhere::Redirect("/a.png") : Elsewhere::Ok(kImage);
  }};
};

// The test's own doors work: else nothing below would mean anything.
TEST_F(RebindingTest, APublicAddressIsConnectedTo) {
  Answer("shop.test", {{kPublic}});
  Fetcher fetcher = MakeFetcher();
  ExpectImage(fetcher, Url("shop.test"));
  EXPECT_THAT(ConnectedTo(), ElementsAre(kPublic));
  EXPECT_THAT(other_.heads().at(0), HasSubstr("Host: shop.test:"));
}

TEST_F(RebindingTest, PublicTheFirstTimePrivateTheSecond) {
  for (const std::string inside :
       {"127.0.0.1", "10.0.0.1", "192.168.1.1", "169.254.169.254", "0.0.0.0"}) {
    SCOPED_TRACE(inside);
    const int lookups = Lookups();
    const int connections = other_.connections();
    Answer("shop.test", {{kPublic}, {inside}, {kPublic}});
    Fetcher fetcher = MakeFetcher();
    ExpectImage(fetcher, Url("shop.test"));
    ExpectRefused(fetcher, Url("shop.test"));
    ExpectImage(fetcher, Url("shop.test"));
    EXPECT_EQ(other_.connections(), connections + 2);
    EXPECT_EQ(Lookups(), lookups + 3) << "what is connected to is what was looked at";
  }
  for (const std::string& address : ConnectedTo()) EXPECT_EQ(address, kPublic);
}

TEST_F(RebindingTest, PublicAtFirstPrivateWhereItIsRedirectedTo) {
  Answer("shop.test", {{kPublic}, {"127.0.0.1"}});
  Fetcher fetcher = MakeFetcher();
  ExpectRefused(fetcher, Url("shop.test", "/away.png"));
  EXPECT_EQ(Lookups(), 2);
  EXPECT_EQ(other_.connections(), 1);
  EXPECT_THAT(ConnectedTo(), ElementsAre(kPublic));
}

TEST_F(RebindingTest, PrivateAddressesAmongOthersAreNotTried) {
  Fetcher fetcher = MakeFetcher();
  Answer("mixed.test", {{"127.0.0.1", "::1", "10.0.0.1", kPublic}});
  ExpectImage(fetcher, Url("mixed.test"));
  EXPECT_THAT(ConnectedTo(), ElementsAre(kPublic));
  Answer("mixed.test", {{kUnreachable, "127.0.0.1", "::1"}});
  ExpectRefused(fetcher, Url("mixed.test"));
  EXPECT_THAT(ConnectedTo(), ElementsAre(kPublic, kUnreachable));
  Answer("mixed.test", {{"127.0.0.1", "::1", "169.254.169.254", "192.168.1.1"}});
  ExpectRefused(fetcher, Url("mixed.test"));
  EXPECT_THAT(ConnectedTo(), ElementsAre(kPublic, kUnreachable)) << "not even tried";
  EXPECT_EQ(other_.connections(), 1);
}

}  // namespace
}  // namespace pliant::testing
