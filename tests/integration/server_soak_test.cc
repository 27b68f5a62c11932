// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Many clients for some time, and kill -9 again and again. How long, how many: from the environment
// (PLIANT_SOAK_SECONDS, PLIANT_SOAK_CLIENTS, PLIANT_SOAK_KILLS); a few seconds unless told.
#include <atomic>
#include <csignal>
#include <cstdlib>
#include <iostream>
#include <map>
#include <random>
#include <set>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/integration/server_process.h"

namespace pliant::testing {
namespace {

constexpr const char* kImages = "/v1/collections/default/images";
constexpr const char* kBatch = "/v1/collections/default/images:batch";
constexpr const char* kSearch = "/v1/collections/default/search";
constexpr const char* kVocabularies = "/v1/collections/default/vocabularies";
constexpr unsigned kSeed = 20261121;
constexpr int kPictures = 24;

int FromEnvironment(const char* name, int otherwise) {
  const char* text = std::getenv(name);
  return text == nullptr ? otherwise : std::atoi(text);
}

const std::string& Picture(int number) {
  static const std::vector<std::string> pictures = [] {
    std::vector<std::string> made;
    for (int i = 0; i < kPictures; ++i) made.push_back(TestPicture(i));
    return made;
  }();
  return pictures[static_cast<std::size_t>(number) % pictures.size()];
}

std::string ImagePath(const std::string& id) { return std::string(kImages) + "/" + id; }

// What a client knows of the ids that are its own: the number of the picture, or that there is
// none.
struct Known {
  std::map<std::string, int> there;
  std::set<std::string> gone;
  std::set<std::string> unknown;  // asked for, never acknowledged

  void Put(const std::string& id, int picture) {
    there[id] = picture;
    gone.erase(id);
    unknown.erase(id);
  }
  void Delete(const std::string& id) {
    there.erase(id);
    gone.insert(id);
    unknown.erase(id);
  }
  void Forget(const std::string& id) {
    there.erase(id);
    gone.erase(id);
    unknown.insert(id);
  }
};

struct Counts {
  std::atomic<int> done{0};
  std::atomic<int> refused{0};
};

// Busy, and it says so: with a code, and when to come again. Anything else is wrong.
bool IsHonestRefusal(const httplib::Response& answer) {
  if (answer.status != 503 && answer.status != 429) return false;
  const Json problem = Json::parse(answer.body, nullptr, false);
  const std::string code = problem.is_object() ? problem.value("code", "") : "";
  return std::atoi(answer.get_header_value("Retry-After").c_str()) > 0 &&
         (code == "busy" || code == "starting" || code == "rate_limited");
}

// One client's life: until `stop`, or until the server does not answer. Returns what went wrong.
std::string Live(const ServerProcess& server, int client_number, const std::atomic<bool>& stop,
                 Known& known, Counts& counts) {
  auto client = server.Client();
  std::mt19937 random(kSeed + static_cast<unsigned>(client_number));
  const auto refused = [&](const httplib::Result& answer) {
    if (!IsHonestRefusal(*answer)) return false;
    ++counts.refused;
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    return true;
  };
  const auto wrong = [](const std::string& what, const httplib::Result& answer) {
    return what + " was answered " + std::to_string(answer->status) + " " + answer->body;
  };
  while (!stop) {
    const std::string id = "c" + std::to_string(client_number) + "-" + std::to_string(random() % 6);
    const int picture = static_cast<int>(random() % kPictures);
    const unsigned what = random() % 10;
    if (what < 4) {
      const auto answer = client.Put(ImagePath(id) + "?object=o" + std::to_string(picture),
                                     Picture(picture), "image/png");
      if (!answer) return known.Forget(id), "";
      if (refused(answer)) continue;
      if (answer->status != 200 && answer->status != 201) return wrong("PUT", answer);
      known.Put(id, picture);
    } else if (what < 6) {
      const bool expected = known.there.contains(id);
      const bool certain = !known.unknown.contains(id);
      const auto answer = client.Delete(ImagePath(id));
      if (!answer) return known.Forget(id), "";
      if (refused(answer)) continue;
      const bool as_expected = answer->status == (expected ? 204 : 404);
      if (certain ? !as_expected : answer->status != 204 && answer->status != 404) {
        return wrong("DELETE", answer);
      }
      known.Delete(id);
    } else if (what < 7) {
      const auto answer = client.Post(
          kBatch, httplib::MultipartFormDataItems{{"image", Picture(picture), "a.png", "image/png"},
                                                  {"image", "no picture", "b.png", "image/png"},
                                                  {"items",
                                                   "[{\"id\": \"" + id + "\", \"object\": \"o" +
                                                       std::to_string(picture) + "\"}, {}]",
                                                   "", ""}});
      if (!answer) return known.Forget(id), "";
      if (refused(answer)) continue;
      if (answer->status != 207) return wrong("batch", answer);
      const Json result = Json::parse(answer->body)["results"][0];
      if (result["status"] == 503) {
        ++counts.refused;
        continue;
      }
      if (result["status"] != 200 && result["status"] != 201) return wrong("batch", answer);
      known.Put(id, picture);
    } else {
      const auto answer = client.Post(kSearch, Picture(picture), "image/png");
      if (!answer) return "";
      if (refused(answer)) continue;
      // 409: nobody has uploaded anything yet.
      if (answer->status != 200 && answer->status != 409) return wrong("search", answer);
    }
    ++counts.done;
  }
  return "";
}

double Metric(httplib::Client& client, const std::string& name) {
  const std::string text = client.Get("/metrics")->body;
  const std::size_t at = text.find("\n" + name + " ");
  return at == std::string::npos ? -1 : std::stod(text.substr(at + name.size() + 2));
}

// Trains a vocabulary that depends on nothing but the pictures, and asks about each of them.
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
  for (int picture = 0; picture < kPictures; ++picture) {
    const auto answer = client.Post(std::string(kSearch) + "?group_by=image&limit=20&verify=none",
                                    Picture(picture), "image/png");
    EXPECT_EQ(answer->status, 200) << answer->body;
    answers.push_back(Json::parse(answer->body)["hits"]);
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
      threads.emplace_back([&, c, i] { wrong[i] = Live(server, c, stop, known[i], counts); });
    }
    auto client = server.Client();
    const auto part = std::chrono::milliseconds(seconds * 1000 / 3);
    std::this_thread::sleep_for(part);
    const double early = Metric(client, "process_resident_memory_bytes");
    std::this_thread::sleep_for(2 * part);
    const double late = Metric(client, "process_resident_memory_bytes");
    stop = true;
    for (std::thread& thread : threads) thread.join();
    for (const std::string& what : wrong) EXPECT_EQ(what, "");
    EXPECT_GT(counts.done, clients);
    EXPECT_LT(late, 1.3 * early + 64e6) << "memory grows";
    RecordProperty("requests", counts.done);
    RecordProperty("refused", counts.refused);
    std::cout << counts.done << " requests, " << counts.refused << " refused, memory "
              << early / 1e6 << " MB after a third, " << late / 1e6 << " MB at the end\n";
    for (const Known& each : known) {
      for (const auto& [id, picture] : each.there) {
        const auto record = client.Get(ImagePath(id));
        ASSERT_EQ(record->status, 200) << id;
        EXPECT_EQ(Json::parse(record->body)["object"], "o" + std::to_string(picture));
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
    for (const auto& [id, picture] : each.there) {
      ASSERT_EQ(client
                    .Put(ImagePath(id) + "?object=o" + std::to_string(picture), Picture(picture),
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
      threads.emplace_back(
          [&, c, i, kill] { wrong[i] = Live(server, c + 1000 * kill, stop, known[i], counts); });
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
    for (const auto& [id, picture] : each.there) {
      const auto record = client.Get(ImagePath(id));
      ASSERT_EQ(record->status, 200) << id;
      EXPECT_EQ(Json::parse(record->body)["object"], "o" + std::to_string(picture));
      EXPECT_EQ(client.Get(ImagePath(id) + "/content")->body, Picture(picture));
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
  EXPECT_EQ(stats["originals"]["files"], files.size() - 1) << "no file without a picture";
  ExpectSound(database("kill.db"));
  std::cout << counts.done << " requests acknowledged, " << checked << " pictures checked\n";
}

}  // namespace
}  // namespace pliant::testing
