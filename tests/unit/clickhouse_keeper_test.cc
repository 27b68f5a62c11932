// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What a Keeper says and does where there is no ZooKeeper; tests/cluster has the rest.
#include <atomic>
#include <chrono>
#include <thread>
#include <utility>
#include <vector>

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include "index/store/clickhouse/gate.h"
#include "index/store/clickhouse/keeper.h"
#include "tests/unit/expect_error.h"

namespace pliant::testing {
namespace {

using clickhouse::HostPort;
using clickhouse::Keeper;
using clickhouse::KeeperOptions;
using std::chrono::milliseconds;
using Clock = std::chrono::steady_clock;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

// Takes connections, as far as the system does that by itself, and never says a word.
class SilentServer {
 public:
  SilentServer() : listener_(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t length = sizeof(address);
    auto* plain = reinterpret_cast<sockaddr*>(&address);
    EXPECT_EQ(bind(listener_, plain, length), 0);
    EXPECT_EQ(listen(listener_, 64), 0);
    EXPECT_EQ(getsockname(listener_, plain, &length), 0);
    port_ = ntohs(address.sin_port);
  }
  ~SilentServer() { close(listener_); }
  int port() const { return port_; }

 private:
  int listener_;
  int port_ = 0;
};

KeeperOptions Options(std::vector<HostPort> hosts) {
  return {.hosts = std::move(hosts),
          .root = "/pliant/test",
          .session_timeout = milliseconds(2000),
          .timeout = milliseconds(300)};
}

void ExpectUnavailable(Keeper& keeper, const std::string& words) {
  const auto before = Clock::now();
  try {
    keeper.Read("a");
    ADD_FAILURE() << "nothing was thrown";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kUnavailable);
    EXPECT_EQ(error.reason(), "keeper_unavailable");
    EXPECT_THAT(error.what(), HasSubstr(words));
  }
  EXPECT_LT(Clock::now() - before, milliseconds(3000));
}

TEST(KeeperTest, OptionsAreChecked) {
  const auto expect_refused = [](auto change) {
    KeeperOptions options = Options({{"127.0.0.1", 2181}});
    change(options);
    ExpectError(ErrorCode::kInvalidArgument, "keeper_options_invalid",
                [&] { Keeper keeper(options); });
  };
  expect_refused([](KeeperOptions& options) { options.hosts.clear(); });
  expect_refused([](KeeperOptions& options) { options.hosts[0].port = 0; });
  expect_refused([](KeeperOptions& options) { options.hosts[0].port = 65536; });
  expect_refused([](KeeperOptions& options) { options.hosts[0].host = ""; });
  for (const char* root : {"", "/", "pliant", "/pliant/", "//pliant", "/a/../b", "/a b", "/\xff"}) {
    expect_refused([&](KeeperOptions& options) { options.root = root; });
  }
  expect_refused([](KeeperOptions& options) { options.timeout = milliseconds(0); });
  expect_refused([](KeeperOptions& options) { options.session_timeout = milliseconds(-1); });
  Keeper keeper(Options({{"127.0.0.1", 2181}}));  // connects to nobody
}

TEST(KeeperTest, PathsTextsAndVersionsAreCheckedBeforeAnybodyIsAsked) {
  Keeper keeper(Options({{"127.0.0.1", 1}}));
  for (const std::string& path :
       {std::string(), std::string("/a"), std::string("a/"), std::string("a//b"), std::string("."),
        std::string("a/../b"), std::string("a b"), std::string("a\0b", 3), std::string("\xc3\xa4"),
        std::string(2000, 'a')}) {
    const auto refused = [](auto work) {
      ExpectError(ErrorCode::kInvalidArgument, "keeper_path_invalid", work);
    };
    refused([&] { keeper.Read(path); });
    refused([&] { keeper.Create(path, ""); });
    refused([&] { keeper.Write(path, "", 0); });
    refused([&] { keeper.Remove(path); });
    refused([&] { keeper.Children(path); });
    refused([&] { keeper.TakeNumbers(path, 1); });
    refused([&] { keeper.TryLease(path, ""); });
    refused([&] { keeper.Lock(path, Clock::now() + milliseconds(100)); });
  }
  const std::string large(Keeper::kMaxTextBytes + 1, 'x');
  const auto too_large = [](auto work) {
    ExpectError(ErrorCode::kTooLarge, "keeper_text_too_large", work);
  };
  too_large([&] { keeper.Create("a", large); });
  too_large([&] { keeper.Write("a", large, 0); });
  too_large([&] { keeper.TryLease("a", large); });
  ExpectError(ErrorCode::kInvalidArgument, "keeper_version_invalid",
              [&] { keeper.Write("a", "", -1); });
}

TEST(KeeperTest, SaysWhichHostsDoNotAnswer) {
  Keeper refused(Options({{"127.0.0.1", 1}, {"::1", 1}}));
  ExpectUnavailable(refused, "127.0.0.1:1, [::1]:1");
  Keeper nameless(Options({{"keeper.invalid", 2181}}));
  ExpectUnavailable(nameless, "keeper.invalid:2181");
}

TEST(KeeperTest, OneThatIsSilentCostsNoMoreThanTheTimeout) {
  const SilentServer server;
  Keeper keeper(Options({{"127.0.0.1", server.port()}}));
  for (int i = 0; i < 3; ++i) ExpectUnavailable(keeper, "in time");
  ExpectError(ErrorCode::kUnavailable, "keeper_unavailable", [&] { keeper.TryLease("a", ""); });
  ExpectError(ErrorCode::kUnavailable, "keeper_unavailable",
              [&] { keeper.Lock("a", Clock::now() + std::chrono::minutes(1)); });
  ExpectError(ErrorCode::kUnavailable, "keeper_unavailable", [&] { keeper.TakeNumbers("a", 1); });
}

TEST(KeeperTest, WaitingForOneThatIsSilentCanBeStopped) {
  const SilentServer server;
  KeeperOptions options = Options({{"127.0.0.1", server.port()}});
  options.timeout = std::chrono::minutes(1);
  options.session_timeout = std::chrono::minutes(10);
  const auto before = Clock::now();
  {
    Keeper keeper(options);
    std::stop_source stop;
    std::jthread stopper([&stop] {
      std::this_thread::sleep_for(milliseconds(100));
      stop.request_stop();
    });
    ExpectError(ErrorCode::kCancelled, "cancelled",
                [&] { keeper.Lock("a", Clock::now() + std::chrono::hours(1), stop.get_token()); });
  }
  EXPECT_LT(Clock::now() - before, std::chrono::seconds(10));
}

TEST(GateTest, FirstComeFirstServed) {
  clickhouse::Gate gate;
  const auto late = Clock::now() + std::chrono::minutes(1);
  std::vector<int> order;  // guarded by the gate
  std::atomic<int> waiting{0};
  std::vector<std::jthread> threads;
  {
    const clickhouse::Gate::Pass pass(gate, late);
    ASSERT_TRUE(static_cast<bool>(pass));
    EXPECT_FALSE(static_cast<bool>(clickhouse::Gate::Pass(gate, Clock::now() + milliseconds(20))));
    for (int i = 0; i < 5; ++i) {
      threads.emplace_back([&, i] {
        ++waiting;
        const clickhouse::Gate::Pass mine(gate, late);
        order.push_back(i);
      });
      while (waiting != i + 1) std::this_thread::yield();
      std::this_thread::sleep_for(milliseconds(100));  // until it is in the queue
    }
  }
  const clickhouse::Gate::Pass again(gate, late);  // at once, and yet behind all of them
  EXPECT_THAT(order, ElementsAre(0, 1, 2, 3, 4));
}

TEST(KeeperTest, ALockThatIsTooLateFromTheBeginning) {
  Keeper keeper(Options({{"127.0.0.1", 1}}));
  ExpectError(ErrorCode::kUnavailable, "keeper_busy", [&] { keeper.Lock("a", Clock::now()); });
}

}  // namespace
}  // namespace pliant::testing
