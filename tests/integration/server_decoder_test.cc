// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The server with its decoders: the same answers as without, and no harm when one ends.
#include <algorithm>
#include <chrono>
#include <csignal>
#include <fstream>
#include <functional>
#include <iterator>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/decoder/sandbox.h"
#include "tests/integration/server_fixture.h"
#include "tests/support/eventually.h"

namespace pliant::testing {
namespace {

using server::kSanitized;
using ::testing::HasSubstr;

std::string ContentOf(const std::filesystem::path& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

std::filesystem::path ProcOf(int id) { return "/proc/" + std::to_string(id); }

std::string Proc(int id, const char* name) { return ContentOf(ProcOf(id) / name); }

bool Runs(int id) {
  const char state = StateOf(ProcOf(id));
  return state != '\0' && state != 'Z' && state != 'X';
}

bool IsAsleep(int id) {
  const std::filesystem::directory_iterator threads(ProcOf(id) / "task");
  return std::all_of(begin(threads), end(threads),
                     [](const auto& thread) { return StateOf(thread.path()) == 'S'; });
}

class ServerDecoderTest : public ServerTest {
 protected:
  // The decoders, by what they were started as.
  std::vector<int> Decoders() const {
    std::vector<int> found;
    for (const auto& entry : std::filesystem::directory_iterator("/proc")) {
      const int id = std::atoi(entry.path().filename().c_str());
      if (id == 0) continue;
      std::string line = Proc(id, "cmdline");
      std::replace(line.begin(), line.end(), '\0', ' ');
      const std::string started = " --decode-for " + std::to_string(server_->id()) + " ";
      if (line.find(started) != std::string::npos) found.push_back(id);
    }
    return found;
  }
  int OnlyDecoder() const {
    const std::vector<int> found = Decoders();
    EXPECT_EQ(found.size(), 1U);
    return found.at(0);
  }
};

// What a server says of images and searches, without times.
std::vector<std::string> AnswersOf(httplib::Client& client) {
  std::vector<std::string> answers;
  for (int i = 1; i <= 3; ++i) {
    const std::string path = std::string(kImages) + "/p" + std::to_string(i);
    const auto put =
        client.Put(path + "?object=o" + std::to_string(i), TestImage(i, 0, 1500, 900), "image/png");
    EXPECT_EQ(put->status, 201) << put->body;
    answers.push_back(client.Get(path + "/features")->body);
    answers.push_back(client.Get(path + "/thumbnail")->body);
  }
  client.Post("/v1/collections/default/vocabularies", R"({"words": 20})", "application/json");
  EXPECT_TRUE(Eventually([&] {
    return Json::parse(client.Get("/v1/collections/default")->body)["vocabulary"].is_object();
  }));
  Json found = SearchFor(client, TestImage(2, 1, 1500, 900));
  for (const char* timed : {"took_ms", "timings"}) found.erase(timed);
  answers.push_back(found.dump());
  const auto located = client.Post("/v1/collections/default/objects/o2/locate",
                                   TestImage(2, 1, 1500, 900), "image/png");
  EXPECT_EQ(located->status, 200) << located->body;
  Json place = Json::parse(located->body);
  for (const char* timed : {"took_ms", "timings"}) place.erase(timed);
  answers.push_back(place.dump());
  const auto broken = client.Post(kSearch, TestImage(2).substr(0, 5000), "image/png");
  answers.push_back(Json::parse(broken->body)["detail"]);
  return answers;
}

TEST_F(ServerDecoderTest, AnswersAsOneThatDecodesInside) {
  Start({"--auto-train", "false"});
  EXPECT_EQ(Decoders().size(), 1U);
  auto client = server_->Client();
  const std::vector<std::string> apart = AnswersOf(client);
  EXPECT_EQ(Metric(client, R"(pliant_decoders_ended_total{cause="forbidden"})"), 0);
  EXPECT_GE(Metric(client, "pliant_decoders"), 1);
  EXPECT_EQ(server_->Stop(), 0);
  const TemporaryFolder other;
  ServerProcess inside(other / "test.db", {"--auto-train", "false", "--decoder", "inside"});
  auto inside_client = inside.Client();
  const std::vector<std::string> expected = AnswersOf(inside_client);
  ASSERT_EQ(apart.size(), expected.size());
  for (std::size_t i = 0; i < apart.size(); ++i) EXPECT_TRUE(apart[i] == expected[i]) << i;
  EXPECT_EQ(Metric(inside_client, "pliant_decoders"), 0);
  EXPECT_THAT(inside.Log(), HasSubstr("decodes images in its own process"));
}

TEST_F(ServerDecoderTest, GoesOnWhenOneTakesTooLong) {
  Start({"--decode-timeout", "1"});
  auto client = server_->Client();
  kill(OnlyDecoder(), SIGSTOP);
  const auto refused = client.Post(kImages, TestImage(1), "image/png");
  ASSERT_TRUE(refused);
  EXPECT_EQ(refused->status, 413) << refused->body;
  EXPECT_EQ(Json::parse(refused->body)["code"], "image_too_large");
  EXPECT_EQ(Metric(client, R"(pliant_decoders_ended_total{cause="timeout"})"), 1);
  EXPECT_THAT(server_->Log(), HasSubstr("a decoder ended while it decoded an image of"));
  EXPECT_EQ(client.Post(kImages, TestImage(1), "image/png")->status, 201);
}

TEST_F(ServerDecoderTest, GoesOnWhenOneCrashes) {
  Start();
  auto client = server_->Client();
  const int id = OnlyDecoder();
  kill(id, SIGSTOP);
  // Before it has stopped, the next signal would overtake.
  EXPECT_TRUE(Eventually([&] { return StateOf(ProcOf(id)) == 'T'; }));
  kill(id, SIGSEGV);  // comes when it goes on
  std::thread later([&] {
    auto watcher = server_->Client();
    EXPECT_TRUE(Eventually([&] { return Metric(watcher, "pliant_busy_cores") > 0; }));
    // Then all threads wait: the image is at the decoder.
    EXPECT_TRUE(Eventually([&] { return IsAsleep(server_->id()); }));
    kill(id, SIGCONT);
  });
  const auto refused = client.Post(kImages, TestImage(1), "image/png");
  later.join();
  ASSERT_TRUE(refused);
  EXPECT_EQ(refused->status, 422) << refused->body;
  EXPECT_EQ(Json::parse(refused->body)["code"], "image_corrupt");
  EXPECT_EQ(Metric(client, R"(pliant_decoders_ended_total{cause="crashed"})"), 1);
  EXPECT_EQ(client.Post(kImages, TestImage(1), "image/png")->status, 201);
}

TEST_F(ServerDecoderTest, MayDoNothingElse) {
  if (kSanitized) GTEST_SKIP() << "not limited beside a sanitizer";
  Start();
  const int id = OnlyDecoder();
  const std::string status = Proc(id, "status");
  EXPECT_THAT(status, HasSubstr("NoNewPrivs:\t1"));
  EXPECT_THAT(status, HasSubstr("Seccomp:\t2"));
  EXPECT_THAT(status, HasSubstr("Threads:\t1"));
  const std::string limits = Proc(id, "limits");
  EXPECT_THAT(limits, ::testing::ContainsRegex("Max open files +4 +4 "));
  EXPECT_THAT(limits, ::testing::ContainsRegex("Max core file size +0 +0 "));
  EXPECT_THAT(limits, ::testing::ContainsRegex("Max file size +0 +0 "));
  EXPECT_THAT(limits, ::testing::ContainsRegex("Max address space +[0-9]+ +[0-9]+ "));
}

TEST_F(ServerDecoderTest, NoneSurvivesTheServer) {
  Start();
  const int waiting = OnlyDecoder();
  server_->Signal(SIGKILL);
  server_->Wait();
  EXPECT_TRUE(Eventually([&] { return !Runs(waiting); }));
  Start();
  const int busy = OnlyDecoder();
  kill(busy, SIGSTOP);  // one that does not hear that the server is gone
  server_->Signal(SIGKILL);
  server_->Wait();
  EXPECT_TRUE(Eventually([&] { return !Runs(busy); }));
  Start();
  const int last = OnlyDecoder();
  EXPECT_EQ(server_->Stop(), 0);
  EXPECT_FALSE(Runs(last));
}

TEST(PrintConfig, SaysHowDecodersAreHeld) {
  const auto said = [](const std::vector<std::string>& flags) {
    std::vector<std::string> arguments = {"--db", "x.db", "--print-config"};
    arguments.insert(arguments.end(), flags.begin(), flags.end());
    return Program(arguments, {}, ServerPath()).Wait().out;
  };
  EXPECT_THAT(said({}), HasSubstr(kSanitized ? "# Images are decoded in child processes"
                                             : "memory and time, and on system calls."));
  EXPECT_THAT(said({}), HasSubstr("\ndecoder = \"process\"\n"));
  EXPECT_THAT(said({"--decoder", "inside"}), HasSubstr("# Images are decoded in the server."));
  // Limits that are stricter already may not be raised, and need not.
  const std::string limited =
      "ulimit -t 300; " + ServerPath().string() + " --db x.db --print-config";
  EXPECT_THAT(Program({"-c", limited}, {.unprivileged = true}, "/bin/sh").Wait().out,
              HasSubstr("# Images are decoded in child processes"));
  EXPECT_EQ(Program({"--db", "x.db", "--decoder", "nowhere"}, {}, ServerPath()).Wait().status, 2);
}

}  // namespace
}  // namespace pliant::testing
