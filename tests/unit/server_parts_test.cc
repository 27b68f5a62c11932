// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The options and the file of an index in parts.
#include <fstream>
#include <map>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/app/options.h"
#include "server/http/http_server.h"
#include "server/http/parameters.h"
#include "server/http/problem.h"
#include "server/peers/peers.h"
#include "tests/unit/expect_error.h"
#include "tests/unit/index_test_images.h"

namespace pliant::server {
namespace {

using pliant::testing::ExpectError;
using pliant::testing::TemporaryFolder;

class PeerLayoutTest : public ::testing::Test {
 protected:
  PeerLayout Read(const std::string& text) {
    std::ofstream(folder_ / "peers.toml") << text;
    return ReadPeerLayout(folder_ / "peers.toml");
  }
  void ExpectInvalid(const std::string& text, const std::string& why) {
    try {
      Read(text);
      ADD_FAILURE() << "was read:\n" << text;
    } catch (const Error& error) {
      EXPECT_EQ(error.reason(), "peers_invalid");
      EXPECT_THAT(error.what(), ::testing::HasSubstr(why));
      EXPECT_THAT(error.what(), ::testing::HasSubstr("peers.toml"));
    }
  }

  TemporaryFolder folder_;
};

TEST_F(PeerLayoutTest, NamesTheServersOfEachPart) {
  const PeerLayout layout = Read(
      "# ours\nkey = \"plk_1\"\ntimeout_ms = 250\n[parts]\n"
      "1 = [\"http://a:1\", \"https://b:2/\"]\n2 = [\"http://c:3\"]\n");
  EXPECT_EQ(layout.key, "plk_1");
  EXPECT_EQ(layout.timeout, std::chrono::milliseconds(250));
  EXPECT_EQ(layout.parts,
            (std::vector<std::vector<std::string>>{{"http://a:1", "https://b:2"}, {"http://c:3"}}));
  EXPECT_EQ(Read("[parts]\n1 = [\"http://a:1\"]\n").key, "");
}

TEST_F(PeerLayoutTest, SaysWhatIsWrong) {
  ExpectInvalid("", "no servers");
  ExpectInvalid("[parts]\n2 = [\"http://a:1\"]\n", "in order");
  ExpectInvalid("[parts]\n1 = [\"a:1\"]\n", "'a:1'");
  ExpectInvalid("timeout_ms = soon\n[parts]\n1 = [\"http://a:1\"]\n", "timeout_ms");
  ExpectInvalid("keys = 1\n[parts]\n1 = [\"http://a:1\"]\n", "unknown entry keys");
  std::filesystem::remove(folder_ / "peers.toml");
  ExpectError(ErrorCode::kInvalidArgument, "peers_invalid",
              [&] { ReadPeerLayout(folder_ / "peers.toml"); });
}

TEST_F(PeerLayoutTest, TheOptionsMustFitTogether) {
  ServerOptions options;
  options.service.engine.database = "postgresql://db/pliant";
  options.service.peers = folder_ / "peers.toml";
  options.service.engine.index_dir = folder_.path();
  for (const char* part : {"1/1", "1/4", "4/4"}) {
    options.part = part;
    EXPECT_NO_THROW(CheckOptions(options)) << part;
  }
  for (const char* part : {"", "0/4", "5/4", "1", "1/", "a/4", "1/5000", "-1/4"}) {
    options.part = part;
    ExpectError(ErrorCode::kInvalidArgument, "invalid_option", [&] { CheckOptions(options); });
  }
  options.part = "1/4";
  options.service.engine.index_dir = folder_ / "missing";
  ExpectError(ErrorCode::kInvalidArgument, "invalid_option", [&] { CheckOptions(options); });
  options.service.engine.index_dir = "";
  options.service.engine.database = folder_ / "a.db";
  ExpectError(ErrorCode::kInvalidArgument, "invalid_option", [&] { CheckOptions(options); });
}

class PeersTest : public PeerLayoutTest {
 protected:
  PeersTest() {
    HttpOptions options;
    options.port = 0;
    options.admit = [](const Route&, Request&) {};
    options.on_request = [](const RequestRecord&) {};
    server_.emplace(router_, options);
    server_->Start();
    address_ = "http://127.0.0.1:" + std::to_string(server_->port());
  }
  // Of one step that asks all parts.
  PartServers::Replies Ask(Peers& peers, PartServers::Clock::time_point until) {
    const std::string body = "query";
    return peers.Current()->Ask(body, {}, {}, until);
  }
  static PartServers::Clock::time_point Later() {
    return PartServers::Clock::now() + std::chrono::seconds(30);
  }
  static Handler State(const std::string& body) {
    return [body](const Request&, const Parameters&) {
      Response answer;
      answer.body = body;
      return answer;
    };
  }

  const Router router_{
      {{.name = "rank",
        .method = "POST",
        .pattern = "/v1/peer/rank",
        .parameters = {Parameter("part", ""), Parameter("parts", ""), Parameter("timeout_ms", "")},
        .handler =
            [](const Request&, const Parameters& parameters) {
              if (parameters.Text("part") == "3") {
                throw ProblemError("part_elsewhere", "Another part is here.");
              }
              Response answer;
              answer.body = "votes";
              return answer;
            }},
       {.name = "state",
        .method = "GET",
        .pattern = "/v1/peer",
        .handler = State(R"({"part":1,"parts":2,"followed":7,"database":"d"})")},
       {.name = "stranger",
        .method = "GET",
        .pattern = "/other/v1/peer",
        .handler = State(R"({"part":"two","parts":null})")}}};
  std::optional<HttpServer> server_;
  std::string address_;
};

// An answer that is read together with another part's must not wait for the deadline.
TEST_F(PeersTest, NoAnswerIsOverlooked) {
  const std::string list = "[\"" + address_ + "\"]\n";
  std::ofstream(folder_ / "peers.toml") << "[parts]\n1 = " << list << "2 = " << list;
  Peers peers(folder_ / "peers.toml", [](std::size_t, PeerOutcome, double) {});
  for (int i = 0; i < 3000; ++i) {
    const auto until = Later();
    for (const auto& reply : Ask(peers, until)) ASSERT_TRUE(reply && reply->body == "votes");
    ASSERT_LT(PartServers::Clock::now(), until) << "after " << i;
  }
}

TEST_F(PeersTest, OnlyAServerOfPliantSaysItsState) {
  std::ofstream(folder_ / "peers.toml")
      << "[parts]\n1 = [\"" << address_ << "\"]\n2 = [\"" << address_ << "/other\"]\n";
  const Peers peers(folder_ / "peers.toml", [](std::size_t, PeerOutcome, double) {});
  while (peers.states().empty()) std::this_thread::yield();
  const std::vector<PeerState> states = peers.states();
  EXPECT_TRUE(states[0].answers);
  EXPECT_EQ(states[0].followed, 7);
  EXPECT_EQ(states[0].database, "d");
  EXPECT_FALSE(states[1].answers);
}

TEST_F(PeersTest, AFileThatWentAwayIsLoggedOnce) {
  const std::filesystem::path file = folder_ / "peers.toml";
  std::ofstream(file) << "[parts]\n1 = [\"" << address_ << "\"]\n";
  Peers peers(file, [](std::size_t, PeerOutcome, double) {});
  peers.Current();
  ::testing::internal::CaptureStdout();
  std::filesystem::remove(file);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(Ask(peers, Later()).size(), 1U);
  const std::string log = ::testing::internal::GetCapturedStdout();
  const auto at = log.find("cannot be read; the servers stay as they were");
  EXPECT_NE(at, std::string::npos);
  EXPECT_EQ(log.find("cannot be read", at + 1), std::string::npos);
}

TEST_F(PeersTest, TheLogSaysWhyAServerDoesNotRank) {
  std::ofstream(folder_ / "peers.toml") << "[parts]\n1 = [\"" << address_ << "/\"]\n2 = [\""
                                        << address_ << "/other\"]\n3 = [\"" << address_ << "\"]";
  std::map<std::size_t, PeerOutcome> outcomes;
  Peers peers(folder_ / "peers.toml",
              [&](std::size_t part, PeerOutcome outcome, double) { outcomes[part] = outcome; });
  ::testing::internal::CaptureStdout();
  const auto replies = Ask(peers, Later());
  const std::string log = ::testing::internal::GetCapturedStdout();
  EXPECT_TRUE(replies[0].has_value());
  EXPECT_FALSE(replies[1].has_value());
  EXPECT_FALSE(replies[2].has_value());
  EXPECT_EQ(outcomes, (std::map<std::size_t, PeerOutcome>{{0, PeerOutcome::kAnswered},
                                                          {1, PeerOutcome::kFailed},
                                                          {2, PeerOutcome::kRefused}}));
  EXPECT_THAT(log, ::testing::HasSubstr("did not rank part 3: Another part is here."));
  EXPECT_THAT(log, ::testing::HasSubstr(address_ + "/other did not rank part 2: "));
}

}  // namespace
}  // namespace pliant::server
