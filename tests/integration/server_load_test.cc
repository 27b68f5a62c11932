// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Many clients at once, full queues, and ends that come at a bad moment.
#include <array>
#include <atomic>
#include <barrier>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <mutex>
#include <random>
#include <thread>

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <sys/socket.h>
#include <unistd.h>

#include "tests/integration/server_fixture.h"

namespace pliant::testing {
namespace {

class ServerLoadTest : public ::testing::Test {
 protected:
  std::filesystem::path database() const { return folder_.path() / "test.db"; }

  TemporaryFolder folder_;
};

// Waits until the server has read the head of a request with "Expect: 100-continue".
bool IsContinued(int connection) {
  std::string head(25, ' ');  // HTTP/1.1 100 Continue and an empty line
  return recv(connection, head.data(), head.size(), MSG_WAITALL) == 25 &&
         head.starts_with("HTTP/1.1 100 ");
}

std::string ImagePath(int number) { return std::string(kImages) + "/p" + std::to_string(number); }

TEST_F(ServerLoadTest, EightClientsMixEverything) {
  const ServerProcess server(database());
  constexpr int kClients = 8;
  constexpr int kRounds = 12;
  std::vector<std::string> images;
  for (int i = 0; i < kClients; ++i) images.push_back(TestImage(i));
  std::mutex mutex;
  std::map<int, bool> expected;  // image number -> there; each client has its own numbers
  std::vector<std::thread> clients;
  for (int c = 0; c < kClients; ++c) {
    clients.emplace_back([&, c] {
      auto client = server.Client();
      std::mt19937 random(c);
      const auto patiently = [](const auto& request) {
        httplib::Result answer = request();
        for (int i = 0; i < kMoreTries && answer && answer->status == 503; ++i) {
          answer = request();
        }
        return answer;
      };
      for (int round = 0; round < kRounds; ++round) {
        const int number = c * 100 + static_cast<int>(random() % 3);
        const auto& image = images[random() % images.size()];
        switch (random() % 4) {
          case 0:
          case 1: {
            const auto answer = patiently([&] {
              return client.Put(ImagePath(number) + "?object=o" + std::to_string(c), image,
                                "image/png");
            });
            ASSERT_TRUE(answer);
            ASSERT_TRUE(answer->status == 201 || answer->status == 200) << answer->body;
            const std::lock_guard lock(mutex);
            expected[number] = true;
            break;
          }
          case 2: {
            const auto answer = patiently([&] { return client.Delete(ImagePath(number)); });
            ASSERT_TRUE(answer);
            const std::lock_guard lock(mutex);
            ASSERT_EQ(answer->status, expected[number] ? 204 : 404) << answer->body;
            expected[number] = false;
            break;
          }
          default: {
            const auto answer = patiently([&] { return client.Post(kSearch, image, "image/png"); });
            ASSERT_TRUE(answer);
            // 409: nobody has uploaded anything yet.
            ASSERT_TRUE(answer->status == 200 || answer->status == 409) << answer->body;
          }
        }
      }
    });
  }
  for (std::thread& client : clients) client.join();
  auto client = server.Client();
  for (const auto& [number, there] : expected) {
    EXPECT_EQ(client.Get(ImagePath(number))->status, there ? 200 : 404) << number;
  }
}

TEST_F(ServerLoadTest, FullQueueSays503AndWhenToComeAgain) {
  const ServerProcess server(database(), {"--cores", "1", "--queue-length", "1", "--max-side",
                                          "4096", "--auto-train", "false"});
  constexpr int kClients = 8;
  std::vector<std::string> images;
  for (int i = 0; i < kClients; ++i) images.push_back(TestImage(i, 0, 1024, 768));
  std::barrier start(kClients);
  std::atomic<int> busy{0};
  std::vector<std::thread> clients;
  for (int c = 0; c < kClients; ++c) {
    clients.emplace_back([&, c] {
      auto client = server.Client();
      start.arrive_and_wait();
      for (int attempt = 0; attempt < 200; ++attempt) {
        const auto answer = client.Put(ImagePath(c), images[c], "image/png");
        ASSERT_TRUE(answer);
        if (answer->status == 201) return;
        ASSERT_EQ(answer->status, 503) << answer->body;
        EXPECT_EQ(Json::parse(answer->body)["code"], "busy");
        EXPECT_GE(std::stoi(answer->get_header_value("Retry-After")), 1);
        ++busy;
        std::this_thread::sleep_for(std::chrono::milliseconds(50));
      }
      FAIL() << "never got a turn";
    });
  }
  for (std::thread& client : clients) client.join();
  EXPECT_GT(busy, 0);
}

TEST_F(ServerLoadTest, TooManyConnectionsAreToldSo) {
  for (const char* limit : {"--max-connections", "--connections-per-address"}) {
    const ServerProcess server(database(), {limit, "2"});
    const std::string half = "GET /livez HTTP/1.1\r\n";
    const std::array<int, 2> held = {server.Open(half), server.Open(half)};
    const std::string answer =
        server.Talk("GET /livez HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
    EXPECT_THAT(answer, ::testing::StartsWith("HTTP/1.1 503 "));
    EXPECT_THAT(answer, ::testing::HasSubstr("Retry-After: "));
    EXPECT_THAT(answer, ::testing::HasSubstr("X-Request-Id: "));
    for (const int fd : held) close(fd);
    auto client = server.Client();
    httplib::Result again = client.Get("/livez");  // until they are forgotten
    while (again && again->status == 503) again = client.Get("/livez");
    ASSERT_TRUE(again);
    EXPECT_EQ(again->status, 200);
  }
}

// Hundreds of clients that send nothing, half a head, half a body, or take no answer, beside two
// threads for requests: others are served as if they were not there.
TEST_F(ServerLoadTest, SlowClientsHoldNoThread) {
  constexpr int kOfEach = 80;
  const ServerProcess server(
      database(), {"--http-threads", "2", "--header-timeout", "60", "--idle-timeout", "60",
                   "--body-timeout", "60", "--auto-train", "false"});
  const std::string image = TestImage(1, 0, 1600, 1200);
  auto client = server.Client();
  ASSERT_EQ(client.Put(ImagePath(1), image, "image/png")->status, 201);
  const std::string host = " HTTP/1.1\r\nHost: localhost\r\n";
  const std::string slow[] = {
      "", "GET /livez HTTP/1.1\r\nHost: loc",
      "PUT " + ImagePath(2) + host + "Content-Type: image/png\r\nContent-Length: 100000\r\n\r\nabc",
      "PUT " + ImagePath(2) + host +
          "Content-Type: image/png\r\nTransfer-Encoding: chunked\r\n\r\n5\r\nabc",
      "GET " + ImagePath(1) + "/features" + host + "\r\n"};
  std::vector<int> sockets;
  for (int i = 0; i < kOfEach; ++i) {
    for (const std::string& bytes : slow) {
      sockets.push_back(server.Open(bytes));
      ASSERT_GE(sockets.back(), 0);
    }
  }
  for (int i = 0; i < 5; ++i) {
    const auto start = std::chrono::steady_clock::now();
    const auto live = client.Get("/livez");
    ASSERT_TRUE(live);
    EXPECT_EQ(live->status, 200);
    const auto put = client.Put(ImagePath(3 + i), TestImage(3 + i), "image/png");
    ASSERT_TRUE(put);
    EXPECT_EQ(put->status, 201);
    EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(20));
  }
  for (const int fd : sockets) close(fd);
}

TEST_F(ServerLoadTest, SigtermFinishesWhatRuns) {
  ServerProcess server(database(), {"--cores", "1", "--max-side", "4096", "--auto-train", "false"});
  constexpr int kClients = 4;
  std::vector<std::string> images;
  for (int i = 0; i < kClients; ++i) images.push_back(TestImage(i, 0, 1600, 1200));
  std::vector<std::thread> clients;
  std::atomic<int> created{0};
  for (int c = 0; c < kClients; ++c) {
    clients.emplace_back([&, c] {
      auto client = server.Client();
      const auto answer = client.Put(ImagePath(c), images[c], "image/png");
      ASSERT_TRUE(answer) << httplib::to_string(answer.error());
      EXPECT_EQ(answer->status, 201) << answer->body;
      ++created;
    });
  }
  auto client = server.Client();
  while (Metric(client, "pliant_busy_cores") +
             Metric(client, "pliant_queue_length{lane=\"upload\"}") + created <
         kClients) {
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  EXPECT_LT(created, kClients) << "the server was not busy: nothing was tested";
  EXPECT_EQ(server.Stop(), 0) << server.Log();
  for (std::thread& thread : clients) thread.join();
  EXPECT_EQ(created, kClients);
  EXPECT_FALSE(client.Get("/livez"));

  const ServerProcess again(database());
  auto later = again.Client();
  for (int c = 0; c < kClients; ++c) EXPECT_EQ(later.Get(ImagePath(c))->status, 200);
}

TEST_F(ServerLoadTest, ShutdownDeadlineCutsOffAndSaysSo) {
  ServerProcess server(database(), {"--shutdown-timeout", "1", "--body-timeout", "600"});
  const int slow = server.Open("POST " + std::string(kImages) +
                               " HTTP/1.1\r\nHost: localhost\r\nContent-Type: image/png\r\n"
                               "Expect: 100-continue\r\nContent-Length: 1000\r\n\r\n");
  ASSERT_TRUE(IsContinued(slow));
  EXPECT_EQ(server.Stop(), 1);
  EXPECT_THAT(server.Log(), ::testing::HasSubstr("1 requests were cut off"));
  close(slow);
}

// As if the disk were slow: another process holds the lock of the files.
TEST_F(ServerLoadTest, AnIndexThatIsNotSavedInTimeIsNoFailure) {
  if (std::getenv("PLIANT_TEST_DATABASE") != nullptr) GTEST_SKIP() << "it needs --index-dir";
  for (std::uint64_t i = 0; i < 256; ++i) {
    WriteText(database().parent_path() / ("set/" + std::to_string(i) + ".png"),
              TestImage(i, 0, 120, 90));
  }
  const std::string set = (database().parent_path() / "set").string();
  ASSERT_EQ(RunProgram({"index", set, "--db", database().string(), "--descriptor", "rootsift",
                        "--max-keypoints", "32", "--no-originals"})
                .status,
            0);
  const std::string files = database().string() + ".index";
  std::filesystem::remove_all(files);
  std::filesystem::create_directory(files);
  const int folder = ::open(files.c_str(), O_RDONLY | O_DIRECTORY);
  ASSERT_EQ(::flock(folder, LOCK_EX), 0);
  {
    ServerProcess server(database(), {"--shutdown-timeout", "0"});
    EXPECT_EQ(server.Stop(), 0) << server.Log();
    EXPECT_THAT(server.Log(), ::testing::HasSubstr("before the index is saved"));
  }
  close(folder);
  EXPECT_TRUE(std::filesystem::is_empty(files));
  ServerProcess again(database());
  EXPECT_EQ(again.Stop(), 0) << again.Log();
  EXPECT_FALSE(std::filesystem::is_empty(files));
  EXPECT_THAT(again.Log(), ::testing::Not(::testing::HasSubstr("before the index is saved")));
}

// Ctrl-Z, a debugger or a suspended machine interrupt what waits for signals.
TEST_F(ServerLoadTest, AServerThatIsPausedWhileItStopsStillFinishes) {
  ServerProcess server(database(), {"--shutdown-timeout", "60", "--auto-train", "false"});
  const std::string image = TestImage(1);
  const int connection = server.Open(
      "PUT " + ImagePath(1) + " HTTP/1.1\r\nHost: localhost\r\nContent-Type: image/png\r\n" +
      "Expect: 100-continue\r\nContent-Length: " + std::to_string(image.size()) + "\r\n\r\n");
  ASSERT_TRUE(IsContinued(connection));
  server.Signal(SIGTERM);
  while (server.Log().find("stopping") == std::string::npos) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  const auto paused = [&server] {
    std::string state;
    std::getline(std::ifstream("/proc/" + std::to_string(server.id()) + "/stat"), state);
    return state.find(") T ") != std::string::npos;
  };
  server.Signal(SIGSTOP);
  while (!paused()) std::this_thread::sleep_for(std::chrono::milliseconds(2));
  server.Signal(SIGCONT);
  while (paused()) std::this_thread::sleep_for(std::chrono::milliseconds(2));
  EXPECT_EQ(send(connection, image.data(), image.size(), MSG_NOSIGNAL),
            static_cast<ssize_t>(image.size()));
  EXPECT_EQ(server.Wait(), 0) << server.Log();
  close(connection);
  const ServerProcess again(database());
  EXPECT_EQ(again.Client().Get(ImagePath(1))->status, 200);
}

TEST_F(ServerLoadTest, KillLosesNothingThatWasAcknowledged) {
  std::vector<int> acknowledged;
  std::vector<int> deleted;
  std::vector<std::string> images;
  for (int i = 0; i < 4; ++i) images.push_back(TestImage(i));
  constexpr unsigned kSeed = 5;
  std::mt19937 random(kSeed);
  int next = 0;
  for (int round = 0; round < 4; ++round) {
    ServerProcess server(database());
    std::atomic<int> answers{0};  // on a busy machine the first ones take their time
    std::thread killer([&, delay = random() % 500] {
      while (answers < 2) std::this_thread::sleep_for(std::chrono::milliseconds(1));
      std::this_thread::sleep_for(std::chrono::milliseconds(delay));
      server.Signal(SIGKILL);
    });
    auto client = server.Client();
    while (true) {
      const int number = next++;
      const auto answer = client.Put(ImagePath(number) + "?object=o" + std::to_string(number),
                                     images[number % images.size()], "image/png");
      if (!answer) break;
      ASSERT_EQ(answer->status, 201) << answer->body;
      acknowledged.push_back(number);
      ++answers;
      if (number % 5 != 0) continue;
      const auto removed = client.Delete(ImagePath(number));
      if (!removed) {
        acknowledged.pop_back();  // sent but not acknowledged: may be there or not
        break;
      }
      acknowledged.pop_back();
      deleted.push_back(number);
    }
    killer.join();
    EXPECT_EQ(server.Wait(), 128 + SIGKILL);
  }
  EXPECT_GT(acknowledged.size(), 3U) << "seed " << kSeed;
  const ServerProcess server(database());
  auto client = server.Client();
  for (const int number : acknowledged) EXPECT_EQ(client.Get(ImagePath(number))->status, 200);
  for (const int number : deleted) EXPECT_EQ(client.Get(ImagePath(number))->status, 404);
  EXPECT_EQ(PostPatiently(client, kSearch, TestImage(1, 1), "image/png")->status, 200);
}

}  // namespace
}  // namespace pliant::testing
