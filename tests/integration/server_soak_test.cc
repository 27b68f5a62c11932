// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Many clients for some time, and kill -9 again and again. How long, how many: from the environment
// (PLIANT_SOAK_SECONDS, PLIANT_SOAK_CLIENTS, PLIANT_SOAK_KILLS); a few seconds unless told.
#include <atomic>
#include <csignal>
#include <cstdlib>
#include <iostream>
#include <random>
#include <set>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/integration/soak_client.h"

namespace pliant::testing {
namespace {

constexpr const char* kVocabularies = "/v1/collections/default/vocabularies";

int FromEnvironment(const char* name, int otherwise) {
  const char* text = std::getenv(name);
  return text == nullptr ? otherwise : std::atoi(text);
}

// Trains a vocabulary that depends on nothing but the images, and asks about each of them.
Json SearchAll(const ServerProcess& server) {
  auto client = server.Client();
  const auto accepted =
      client.Post(kVocabularies, R"({"words": 30, "seed": 7})", "application/json");
  EXPECT_EQ(accepted->status, 202) << accepted->body;
  const std::string job = "/v1/jobs/" + Json::parse(accepted->body)["id"].get<std::string>();
  Json state;
  do {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    state = Json::parse(client.Get(job)->body);
  } while (state["finished_at"].is_null());
  EXPECT_EQ(state["state"], "done") << state;
  Json answers = Json::array();
  for (int image = 0; image < kImages; ++image) {
    const auto answer = client.Post(std::string(kSearch) + "?group_by=image&limit=20&verify=none",
                                    MakeImage(image), "image/png");
    EXPECT_EQ(answer->status, 200) << answer->body;
    answers.push_back(Json::parse(answer->body)["hits"]);
    for (Json& hit : answers.back()) hit.erase("source");  // some are sent with a file's name
  }
  return answers;
}

class SoakTest : public ::testing::Test {
 protected:
  std::filesystem::path database(const std::string& name) const { return folder_ / name; }

  void ExpectSound(const std::filesystem::path& file) {
    const ProgramResult check = RunProgram({"db", "check", "--db", file.string(), "--json"});
    EXPECT_EQ(check.status, 0) << check.out << check.err;
  }

  TemporaryFolder folder_;
};

TEST_F(SoakTest, ManyClientsGetHonestAnswersAndLeaveWhatTheyWereTold) {
  const int seconds = FromEnvironment("PLIANT_SOAK_SECONDS", 5);
  const int clients = FromEnvironment("PLIANT_SOAK_CLIENTS", 8);
  SCOPED_TRACE("seed " + std::to_string(kSeed));
  std::vector<Known> known(static_cast<std::size_t>(clients));
  Json after_soak;
  {
    ServerProcess server(database("soak.db"),
                         {"--originals-dir", (folder_ / "soak-originals").string()});
    std::atomic<bool> stop{false};
    Counts counts;
    std::vector<std::string> wrong(known.size());
    std::vector<std::thread> threads;
    for (int c = 0; c < clients; ++c) {
      const auto i = static_cast<std::size_t>(c);
      threads.emplace_back(
          [&, c, i] { wrong[i] = SoakClient(server, c, known[i], counts).Live(stop); });
    }
    auto client = server.Client();
    const auto part = std::chrono::milliseconds(seconds * 1000 / 3);
    // On a busy machine the time says nothing: buffers and caches must have been filled once.
    const auto await = [&](std::chrono::milliseconds time, int requests) {
      std::this_thread::sleep_for(time);
      for (int i = 0; counts.done < requests && i < 1200; ++i) {
        std::this_thread::sleep_for(std::chrono::milliseconds(100));
      }
    };
    await(part, 40 * clients);
    const double early = Metric(client, "process_resident_memory_bytes");
    await(2 * part, 80 * clients);
    const double late = Metric(client, "process_resident_memory_bytes");
    stop = true;
    for (std::thread& thread : threads) thread.join();
    for (const std::string& what : wrong) EXPECT_EQ(what, "");
    EXPECT_GT(counts.done, clients);
    EXPECT_GT(early, 0) << "the memory is not known";
    EXPECT_LT(late, 1.3 * early + 64e6) << "memory grows";
    RecordProperty("requests", counts.done);
    RecordProperty("refused", counts.refused);
    std::cout << counts.done << " requests, " << counts.refused << " refused, memory "
              << early / 1e6 << " MB after a third, " << late / 1e6 << " MB at the end\n";
    for (const Known& each : known) {
      for (const auto& [id, image] : each.there) {
        const auto record = client.Get(ImagePath(id));
        ASSERT_EQ(record->status, 200) << id;
        EXPECT_EQ(Json::parse(record->body)["object"], "o" + std::to_string(image));
      }
      for (const std::string& id : each.gone) EXPECT_EQ(client.Get(ImagePath(id))->status, 404);
    }
    after_soak = SearchAll(server);
    EXPECT_EQ(server.Stop(), 0) << server.Log();
  }
  ExpectSound(database("soak.db"));

  // One client that says the same in one thread gets the same answers.
  const ServerProcess server(database("replay.db"), {"--auto-train", "false"});
  auto client = server.Client();
  for (const Known& each : known) {
    for (const auto& [id, image] : each.there) {
      ASSERT_EQ(client
                    .Put(ImagePath(id) + "?object=o" + std::to_string(image), MakeImage(image),
                         "image/png")
                    ->status,
                201);
    }
  }
  EXPECT_EQ(SearchAll(server), after_soak);
}

TEST_F(SoakTest, KillAtAnyMomentKeepsWhatWasAcknowledged) {
  const int kills = FromEnvironment("PLIANT_SOAK_KILLS", 4);
  constexpr int kClients = 4;
  SCOPED_TRACE("seed " + std::to_string(kSeed));
  std::mt19937 random(kSeed);
  std::vector<Known> known(kClients);
  Counts counts;
  // Originals in the database and in a directory in turns: what one server left the next must find.
  const std::filesystem::path originals = folder_ / "originals";
  for (int kill = 0; kill < kills; ++kill) {
    const std::string place = kill % 2 == 0 ? originals.string() : "database";
    ServerProcess server(database("kill.db"), {"--originals-dir", place});
    std::vector<std::string> wrong(kClients);
    std::atomic<bool> stop{false};
    std::vector<std::thread> threads;
    for (int c = 0; c < kClients; ++c) {
      const auto i = static_cast<std::size_t>(c);
      threads.emplace_back([&, c, i, kill] {
        wrong[i] = SoakClient(server, c + 1000 * kill, known[i], counts).Live(stop);
      });
    }
    // Under load, however slow the machine is: after some requests, in the middle of others.
    const int enough = counts.done + 1 + static_cast<int>(random() % 30);
    const auto latest = std::chrono::steady_clock::now() + std::chrono::seconds(5);
    while (counts.done < enough && std::chrono::steady_clock::now() < latest) {
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    std::this_thread::sleep_for(std::chrono::microseconds(random() % 30'000));
    server.Signal(SIGKILL);
    EXPECT_EQ(server.Wait(), 128 + SIGKILL);
    stop = true;
    for (std::thread& thread : threads) thread.join();
    for (const std::string& what : wrong) EXPECT_EQ(what, "") << "before kill " << kill;
  }
  ServerProcess server(database("kill.db"));
  auto client = server.Client();
  int checked = 0;
  for (const Known& each : known) {
    for (const auto& [id, image] : each.there) {
      const auto record = client.Get(ImagePath(id));
      ASSERT_EQ(record->status, 200) << id;
      EXPECT_EQ(Json::parse(record->body)["object"], "o" + std::to_string(image));
      EXPECT_EQ(client.Get(ImagePath(id) + "/content")->body, MakeImage(image));
      ++checked;
    }
    for (const std::string& id : each.gone) EXPECT_EQ(client.Get(ImagePath(id))->status, 404) << id;
  }
  EXPECT_GT(checked, 0);
  EXPECT_EQ(server.Stop(), 0);
  std::set<std::string> files;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(originals)) {
    if (entry.is_regular_file()) files.insert(entry.path().filename().string());
  }
  const Json stats =
      RunProgram({"db", "stats", "--db", database("kill.db").string(), "--json"}).json();
  EXPECT_EQ(stats["originals"]["files"], files.size() - 1) << "no file without an image";
  ExpectSound(database("kill.db"));
  std::cout << counts.done << " requests acknowledged, " << checked << " images checked\n";
}

}  // namespace
}  // namespace pliant::testing
