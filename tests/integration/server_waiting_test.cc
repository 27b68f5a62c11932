// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Requests that wait for the end of a job: told at once, holding no thread, limited, and over when
// the client or the server goes.
#include <chrono>
#include <csignal>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include "tests/integration/server_fixture.h"

namespace pliant::testing {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;
using Clock = std::chrono::steady_clock;
using Seconds = std::chrono::duration<double>;

constexpr int kPatienceMs = 30'000;

double SecondsSince(Clock::time_point begin) { return Seconds(Clock::now() - begin).count(); }

// What comes until the server closes.
std::string ReadAll(int fd) {
  std::string text;
  char buffer[4096];
  pollfd input = {fd, POLLIN, 0};
  while (poll(&input, 1, kPatienceMs) > 0) {
    const ssize_t got = recv(fd, buffer, sizeof(buffer), 0);
    if (got <= 0) break;
    text.append(buffer, static_cast<std::size_t>(got));
  }
  close(fd);
  return text;
}

bool HasAnswer(int fd, int patience_ms) {
  pollfd input = {fd, POLLIN, 0};
  return poll(&input, 1, patience_ms) > 0;
}

class WaitingTest : public ServerTest {
 protected:
  // A server with a job that takes long: images of millions of pixels, on one core.
  void StartWithJob(std::vector<std::string> flags = {}) {
    constexpr int kImages = 12;
    std::filesystem::create_directories(folder_ / "shelf");
    for (int i = 0; i < kImages; ++i) {
      std::ofstream(folder_ / ("shelf/" + std::to_string(i) + ".png"), std::ios::binary)
          << TestImage(i, 0, 2400, 1800);
    }
    flags.insert(flags.end(), {"--import-dir", (folder_ / "shelf").string(), "--auto-train",
                               "false", "--cores", "1", "--max-side", "4096"});
    Start(flags);
    auto client = server_->Client();
    const auto accepted =
        client.Post("/v1/collections/default/imports", R"({"folder": "."})", "application/json");
    ASSERT_EQ(accepted->status, 202) << accepted->body;
    job_ = Json::parse(accepted->body)["id"];
  }
  void Cancel() { EXPECT_EQ(server_->Client().Delete("/v1/jobs/" + job_)->status, 202); }

  std::string Question(const std::string& wait) const {
    return "GET /v1/jobs/" + job_ + "?wait=" + wait +
           " HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n";
  }
  std::vector<int> Ask(int clients, const std::string& wait) const {
    std::vector<int> waiting;
    for (int i = 0; i < clients; ++i) waiting.push_back(server_->Open(Question(wait)));
    return waiting;
  }

  std::string job_;
};

// With two threads for requests, hundreds wait: others are served as if they were not there, and
// all hear of the end at once.
TEST_F(WaitingTest, HundredsHoldNoThreadAndHearOfTheEnd) {
  constexpr int kClients = 400;
  StartWithJob({"--http-threads", "2", "--connection-queue", "250"});
  auto client = server_->Client();
  std::vector<int> waiting;
  for (int i = 0; i < kClients; ++i) {
    waiting.push_back(server_->Open(Question("60")));
    ASSERT_GE(waiting.back(), 0);
    // The queue is short, so that all who wait at once do not fit into it.
    if (i % 4 == 3) {
      ASSERT_EQ(client.Get("/v1/me")->status, 200);
    }
  }
  double slowest = 0;
  for (int i = 0; i < 20; ++i) {
    for (const char* path : {"/livez", "/v1/collections", "/v1/me"}) {
      const auto begin = Clock::now();
      const auto answer = client.Get(path);
      ASSERT_TRUE(answer);
      EXPECT_EQ(answer->status, 200) << answer->body;
      slowest = std::max(slowest, SecondsSince(begin));
    }
  }
  EXPECT_LT(slowest, 5);
  for (const int fd : waiting) ASSERT_FALSE(HasAnswer(fd, 0)) << "the job has ended too early";
  Cancel();
  Clock::time_point first;  // the job ends when the image that it is at is done
  for (const int fd : waiting) {
    const std::string answer = ReadAll(fd);
    if (fd == waiting.front()) first = Clock::now();
    ASSERT_THAT(answer, StartsWith("HTTP/1.1 200 "));
    EXPECT_THAT(answer, HasSubstr(R"("state":"cancelled")"));
  }
  std::cout << kClients << " waiting: others were answered in " << slowest * 1e3
            << " ms at most; all others were told " << SecondsSince(first)
            << " s after the first\n";
}

TEST_F(WaitingTest, TimeRunsOutAndWhatHasEndedIsToldAtOnce) {
  StartWithJob();
  auto client = server_->Client();
  auto begin = Clock::now();
  const auto early = client.Get("/v1/jobs/" + job_ + "?wait=0.3");
  ASSERT_EQ(early->status, 200) << early->body;
  EXPECT_TRUE(Json::parse(early->body)["finished_at"].is_null()) << early->body;
  EXPECT_GE(SecondsSince(begin), 0.3);
  EXPECT_EQ(client.Head("/v1/jobs/" + job_ + "?wait=0.1")->status, 200);
  begin = Clock::now();
  EXPECT_EQ(client.Get("/v1/jobs/" + job_ + "?wait=0")->status, 200);
  EXPECT_EQ(client.Get("/v1/jobs/nothing?wait=30")->status, 404);
  for (const char* wait : {"-1", "61", "x", "nan", "inf", "", "1e9"}) {
    const auto refused = client.Get("/v1/jobs/" + job_ + "?wait=" + wait);
    EXPECT_EQ(refused->status, 400) << wait;
    EXPECT_EQ(Json::parse(refused->body)["parameter"], "wait");
  }
  Cancel();
  EXPECT_EQ(Json::parse(client.Get("/v1/jobs/" + job_ + "?wait=60")->body)["state"], "cancelled");
  EXPECT_EQ(Json::parse(client.Get("/v1/jobs/" + job_ + "?wait=60")->body)["state"], "cancelled");
  EXPECT_LT(SecondsSince(begin), 25);
}

TEST_F(WaitingTest, AStopOfTheServerEndsThem) {
  StartWithJob();
  const std::vector<int> waiting = Ask(20, "60");
  ASSERT_FALSE(HasAnswer(waiting.back(), 300));
  const auto begin = Clock::now();
  server_->Signal(SIGTERM);
  for (const int fd : waiting) {
    const std::string answer = ReadAll(fd);
    EXPECT_THAT(answer, StartsWith("HTTP/1.1 200 "));
    EXPECT_THAT(answer, HasSubstr("Connection: close"));
    EXPECT_THAT(answer, HasSubstr(R"("finished_at":null)"));
  }
  EXPECT_EQ(server_->Wait(), 0);
  EXPECT_LT(SecondsSince(begin), 20);
}

TEST_F(WaitingTest, OnlySoManyAndNotForClientsThatHaveGone) {
  StartWithJob({"--max-connections", "20"});  // half of them may wait
  const std::vector<int> waiting = Ask(10, "60");
  ASSERT_FALSE(HasAnswer(waiting.back(), 500));
  auto client = server_->Client();
  const auto refused = client.Get("/v1/jobs/" + job_ + "?wait=60");
  ASSERT_EQ(refused->status, 503) << refused->body;
  EXPECT_EQ(Json::parse(refused->body)["code"], "busy");
  EXPECT_TRUE(refused->has_header("Retry-After"));
  EXPECT_EQ(client.Get("/v1/jobs/" + job_)->status, 200);
  for (const int fd : waiting) close(fd);
  const auto begin = Clock::now();
  while (client.Get("/v1/jobs/" + job_ + "?wait=0.01")->status != 200) {
    ASSERT_LT(SecondsSince(begin), 10) << "clients that are gone still count";
  }
}

TEST_F(WaitingTest, WhoEndsHisSideGetsTheAnswerAsItIsAndTheNextRequestIsNotLost) {
  StartWithJob();
  const int half = server_->Open(Question("60"));
  shutdown(half, SHUT_WR);
  EXPECT_THAT(ReadAll(half), HasSubstr(R"("finished_at":null)"));
  const std::string path = "/v1/jobs/" + job_;
  const int pipelined =
      server_->Open("GET " + path + "?wait=0.5 HTTP/1.1\r\nHost: localhost\r\n\r\n" +
                    "GET /v1/me HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
  const std::string answers = ReadAll(pipelined);
  EXPECT_LT(answers.find("finished_at"), answers.find("keys_required"));
  EXPECT_THAT(answers, HasSubstr("keys_required"));
}

}  // namespace
}  // namespace pliant::testing
