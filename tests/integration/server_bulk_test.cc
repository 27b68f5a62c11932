// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Many images at once: imports of folders that survive kill -9, backups that can be restored, and
// databases that say how their images are described.
#include <csignal>
#include <fstream>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/integration/server_process.h"

namespace pliant::testing {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

constexpr const char* kCollection = "/v1/collections/default";
constexpr const char* kImports = "/v1/collections/default/imports";
constexpr const char* kSearch = "/v1/collections/default/search";

class BulkTest : public ::testing::Test {
 protected:
  std::filesystem::path database() const { return folder_.path() / "test.db"; }

  void Save(const std::string& name, const std::string& bytes) {
    std::filesystem::create_directories((folder_ / name).parent_path());
    std::ofstream(folder_ / name, std::ios::binary) << bytes;
  }

  static Json AwaitJob(httplib::Client& client, const std::string& id) {
    while (true) {
      const Json job = Json::parse(client.Get("/v1/jobs/" + id)->body);
      if (!job["finished_at"].is_null()) return job;
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
  }

  static int Images(httplib::Client& client) {
    return Json::parse(client.Get(kCollection)->body)["images"];
  }

  void ExpectSound(const std::filesystem::path& file) {
    const ProgramResult check = RunProgram({"db", "check", "--db", DatabaseOf(file), "--json"});
    EXPECT_EQ(check.status, 0) << check.out << check.err;
  }

  TemporaryFolder folder_;
};

TEST_F(BulkTest, ImportsAFolderAndSaysWhatItLeftOut) {
  Save("shelf/mug/1.png", TestImage(1));
  Save("shelf/mug/2.png", TestImage(1, 1));
  Save("shelf/cup/1.png", TestImage(2));
  Save("shelf/cup/broken.png", "no image");
  Save("shelf/twin/1.png", TestImage(2));
  Save("shelf/@eaDir/1.png/M.png", TestImage(3));
  Save("secret/1.png", TestImage(9));
  std::filesystem::create_symlink(folder_ / "secret/1.png", folder_ / "shelf/cup/link.png");
  const ServerProcess server(database(), {"--import-dir", (folder_ / "shelf").string()});
  auto client = server.Client();
  const auto refused = client.Post(kImports, R"({"folder": "../secret"})", "application/json");
  EXPECT_EQ(refused->status, 400);
  EXPECT_THAT(refused->body, Not(HasSubstr(folder_.path().string())));
  const auto accepted = client.Post(kImports, R"({"folder": "."})", "application/json");
  ASSERT_EQ(accepted->status, 202) << accepted->body;
  const Json job = AwaitJob(client, Json::parse(accepted->body)["id"]);
  EXPECT_EQ(job["state"], "done") << job;
  EXPECT_EQ(job["total"], 6);
  EXPECT_EQ(job["failed"], 3) << job;
  EXPECT_EQ(job["system_files"], 1);
  std::map<std::string, std::string> skipped;
  for (const Json& item : job["skipped"]) skipped[item["item"]] = item["code"];
  EXPECT_EQ(skipped["cup/broken.png"], "image_type_unknown");
  EXPECT_EQ(skipped["cup/link.png"], "outside");
  EXPECT_EQ(skipped.count("cup/1.png") + skipped.count("twin/1.png"), 1U)
      << "the same bytes in two folders are reported, whichever came first";
  EXPECT_EQ(Images(client), 3);
  // The vocabulary comes by itself.
  const auto found = client.Post(kSearch, TestImage(1, 2), "image/png");
  ASSERT_EQ(found->status, 200) << found->body;
  EXPECT_EQ(Json::parse(found->body)["hits"][0]["object"], "mug");
}

TEST_F(BulkTest, ImportsGoOnAfterKill) {
  constexpr int kImages = 60;
  for (int i = 0; i < kImages; ++i) {
    Save("shelf/" + std::to_string(i) + ".png", TestImage(i, 0, 480, 360));
  }
  const std::vector<std::string> flags = {"--import-dir", (folder_ / "shelf").string(),
                                          "--auto-train", "false"};
  std::string id;
  {
    ServerProcess server(database(), flags);
    auto client = server.Client();
    const auto accepted = client.Post(kImports, R"({"folder": "."})", "application/json");
    ASSERT_EQ(accepted->status, 202) << accepted->body;
    id = Json::parse(accepted->body)["id"];
    while (Images(client) < 3) std::this_thread::sleep_for(std::chrono::milliseconds(2));
    server.Signal(SIGKILL);
    server.Wait();
  }
  ServerProcess server(database(), flags);
  auto client = server.Client();
  EXPECT_LT(Images(client), kImages) << "it was not killed midway: nothing was tested";
  const Json job = AwaitJob(client, id);
  EXPECT_EQ(job["state"], "done") << job;
  EXPECT_EQ(job["attempts"], 2);
  EXPECT_EQ(Images(client), kImages);
  // An import that is cancelled keeps what it has, and says so.
  const auto again = client.Post(kImports, R"({"folder": "."})", "application/json");
  const std::string other = Json::parse(again->body)["id"];
  EXPECT_EQ(client.Delete("/v1/jobs/" + other)->status, 202);
  const Json ended = AwaitJob(client, other);
  EXPECT_TRUE(ended["state"] == "cancelled" || ended["state"] == "done") << ended;
  EXPECT_EQ(server.Stop(), 0);
  ExpectSound(database());
}

TEST_F(BulkTest, ABackupMadeUnderLoadCanBeRestored) {
  std::filesystem::create_directories(folder_ / "backups");
  const std::vector<std::string> flags = {"--backup-dir", (folder_ / "backups").string()};
  {
    const ServerProcess server(database(), flags);
    auto client = server.Client();
    for (int i = 0; i < 4; ++i) {
      client.Put(std::string(kCollection) + "/images/p" + std::to_string(i) + "?object=o" +
                     std::to_string(i),
                 TestImage(i), "image/png");
    }
    ASSERT_EQ(client.Post(kSearch, TestImage(1, 1), "image/png")->status, 200);
    std::atomic<bool> stop{false};
    std::thread uploads([&] {
      auto other = server.Client();
      for (int i = 100; !stop; ++i) {
        other.Put(std::string(kCollection) + "/images/p" + std::to_string(i), TestImage(i),
                  "image/png");
      }
    });
    const auto accepted =
        client.Post("/v1/backups", R"({"name": "monday.db"})", "application/json");
    ASSERT_EQ(accepted->status, 202) << accepted->body;
    const Json job = AwaitJob(client, Json::parse(accepted->body)["id"]);
    stop = true;
    uploads.join();
    EXPECT_EQ(job["state"], "done") << job;
    EXPECT_EQ(job["result"], "/v1/backups/monday.db");
    const auto again = client.Post("/v1/backups", R"({"name": "monday.db"})", "application/json");
    EXPECT_EQ(Json::parse(again->body)["code"], "backup_exists");
    const Json list = Json::parse(client.Get("/v1/backups")->body)["backups"];
    ASSERT_EQ(list.size(), 1U);
    EXPECT_GT(list[0]["bytes"], 100'000);
    client.Delete(std::string(kCollection) + "/images/p1");
  }
  // Restoring as the README says.
  ExpectSound(folder_ / "backups/monday.db");
  for (const char* side : {"-wal", "-shm"}) {
    std::filesystem::remove(database().string() + side);
  }
  std::filesystem::copy_file(folder_ / "backups/monday.db", database(),
                             std::filesystem::copy_options::overwrite_existing);
  const ServerProcess server(database(), flags);
  auto client = server.Client();
  EXPECT_EQ(client.Get(std::string(kCollection) + "/images/p1")->status, 200);
  const auto found = client.Post(kSearch, TestImage(1, 1), "image/png");
  ASSERT_EQ(found->status, 200) << found->body;
  EXPECT_EQ(Json::parse(found->body)["hits"][0]["object"], "o1");
}

TEST_F(BulkTest, ImagesAreDescribedAsTheDatabaseWasMade) {
  Save("p/a.png", TestImage(1));
  Save("p/b.png", TestImage(2));
  const std::vector<std::string> index = {
      "index", (folder_ / "p").string(), "--db", DatabaseOf(database()), "--descriptor", "rootsift",
      "--json"};
  auto with = [&](std::vector<std::string> more) {
    more.insert(more.begin(), index.begin(), index.end());
    return RunProgram(more);
  };
  ASSERT_EQ(with({"--max-keypoints", "50"}).status, 0);
  Save("p/c.png", TestImage(3));
  const ProgramResult mismatch = with({"--max-keypoints", "70"});
  EXPECT_EQ(mismatch.status, 1);
  EXPECT_EQ(mismatch.json()["error"]["code"], "extraction_mismatch") << mismatch.out;
  EXPECT_EQ(with({}).json()["indexed"], 1) << "not told, it follows";
  ServerProcess server(database());
  auto client = server.Client();
  const auto added = client.Post(std::string(kCollection) + "/images", TestImage(4), "image/png");
  ASSERT_EQ(added->status, 201) << added->body;
  EXPECT_LE(Json::parse(added->body)["keypoints"], 50);
  const auto found = client.Post(kSearch, TestImage(2, 1), "image/png");
  EXPECT_LE(Json::parse(found->body)["keypoints"], 200);  // twice as many, at each of two sizes
  EXPECT_EQ(server.Stop(), 0);
  const ProgramResult refused = Program({"--db", DatabaseOf(database()), "--listen", "127.0.0.1:0",
                                         "--max-keypoints", "70", "--descriptor", "rootsift"},
                                        {}, ServerPath())
                                    .Wait();
  EXPECT_EQ(refused.status, 1);
  EXPECT_THAT(refused.err, HasSubstr("--max-keypoints 50, not 70"));
}

}  // namespace
}  // namespace pliant::testing
