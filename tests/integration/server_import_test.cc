// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Bulk imports: many images in one body, added in the background.
#include <algorithm>
#include <chrono>
#include <csignal>
#include <map>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "tests/integration/server_fixture.h"
#include "tests/integration/tar_files.h"

namespace pliant::testing {
namespace {

constexpr const char* kImport = "/v1/collections/default/images:import";
constexpr const char* kLines = "application/x-ndjson";

class ImportTest : public ServerTest {
 protected:
  void SetUp() override {
    Start({"--auto-train", "false"});
    client_ = std::make_unique<httplib::Client>(server_->Client());
  }
  Json Finished(const httplib::Result& started) {
    EXPECT_TRUE(started && started->status == 202) << (started ? started->body : "no answer");
    if (!started || started->status != 202) return Json::object();
    const std::string path = started->get_header_value("Location");
    for (int i = 0; i < 2400; ++i) {
      const Json job = Json::parse(client_->Get(path)->body);
      if (!job["finished_at"].is_null()) return job;
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
    ADD_FAILURE() << "the import does not end";
    return Json::object();
  }
  Json Items(const Json& job, const std::string& query = "") {
    const auto answer = client_->Get("/v1/jobs/" + job["id"].get<std::string>() + "/items" + query);
    EXPECT_EQ(answer->status, 200) << answer->body;
    return Json::parse(answer->body);
  }
  Json Record(const std::string& id) {
    return Json::parse(client_->Get(std::string(kImages) + "/" + id)->body);
  }
  void Refused(const std::string& body, const std::string& type, int status,
               const std::string& code, const std::string& query = "") {
    const auto answer = client_->Post(kImport + query, body, type);
    ASSERT_TRUE(answer);
    EXPECT_EQ(answer->status, status) << answer->body;
    EXPECT_EQ(Json::parse(answer->body)["code"], code) << answer->body;
  }

  std::unique_ptr<httplib::Client> client_;
};

TEST_F(ImportTest, ACollectionThatIsMadeAnewIsNotFilled) {
  Start({"--auto-train", "false", "--cores", "1"});
  client_ = std::make_unique<httplib::Client>(server_->Client());
  const std::string path = "/v1/collections/shelf";
  ASSERT_EQ(client_->Put(path)->status, 201);
  std::string body;
  for (int i = 0; i < 100; ++i) body += Json{{"image", Base64Of(TestImage(i))}}.dump() + "\n";
  const auto started = client_->Post(path + "/images:import", body, kLines);
  ASSERT_EQ(started->status, 202) << started->body;
  const std::string job = started->get_header_value("Location");
  while (Json::parse(client_->Get(job)->body)["done"] == 0) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  ASSERT_EQ(client_->Delete(path)->status, 204);
  ASSERT_EQ(client_->Put(path)->status, 201);
  const Json ended = Finished(started);
  EXPECT_EQ(ended["state"], "failed") << ended;
  EXPECT_EQ(ended["problem"]["code"], "collection_not_found") << ended;
  EXPECT_EQ(Json::parse(client_->Get(path)->body)["images"], 0);
}

TEST_F(ImportTest, LinesOfJsonHaveAResultEach) {
  const std::string one = Base64Of(TestImage(1));
  std::string body;
  const auto line = [&](const std::string& text) { body += text + "\n"; };
  line(Json{{"image", one}, {"id", "one"}, {"object", "mug"}, {"metadata", {{"n", 1}}}}.dump());
  line("");
  line(Json{{"image", Base64Of(TestImage(2))}, {"source", "two.png"}}.dump() + "\r");
  line("{");
  line("[1]");
  line(R"({"id": "none"})");
  line(R"({"image": "*"})");
  line(R"({"image": 3})");
  line(Json{{"image", one}, {"name", "x"}}.dump());
  line(Json{{"image", one}, {"id", "a/b"}}.dump());
  line(Json{{"image", one}, {"metadata", 3}}.dump());
  line(Json{{"image", Base64Of("no image")}}.dump());
  line(Json{{"image", Base64Of(TestImage(3).substr(0, 900))}}.dump());
  line(Json{{"image", one}, {"id", "one"}, {"object", "mug"}, {"metadata", {{"n", 1}}}}.dump());
  line("\"\xff\"");
  const Json job = Finished(
      client_->Post(std::string(kImport) + R"(?object=thing&metadata={"batch":7})", body, kLines));
  EXPECT_EQ(job["state"], "done") << job;
  EXPECT_EQ(job["total"], 14);
  EXPECT_EQ(job["failed"], 11);
  EXPECT_EQ(job["result"], "/v1/jobs/" + job["id"].get<std::string>() + "/items");
  const Json items = Items(job)["items"];
  ASSERT_EQ(items.size(), 14U);
  std::vector<int> statuses;
  for (std::size_t i = 0; i < items.size(); ++i) {
    EXPECT_EQ(items[i]["index"], i);
    statuses.push_back(items[i]["status"]);
  }
  EXPECT_EQ(statuses, (std::vector<int>{201, 201, 400, 400, 400, 400, 400, 400, 400, 400, 415, 422,
                                        200, 400}));
  EXPECT_EQ(items[1]["source"], "line 3") << "blank lines are no items, but are counted";
  EXPECT_EQ(items[3]["problem"]["code"], "invalid_json");
  EXPECT_EQ(items[4]["problem"]["parameter"], "image");
  EXPECT_EQ(items[7]["problem"]["code"], "unknown_parameter");
  EXPECT_EQ(items[12]["outcome"], "unchanged");
  EXPECT_EQ(Record("one")["object"], "mug");
  EXPECT_EQ(Record("one")["metadata"], (Json{{"n", 1}}));
  const Json two = Record(items[1]["image_id"]);
  EXPECT_EQ(two["object"], "thing");
  EXPECT_EQ(two["metadata"], (Json{{"batch", 7}}));
  EXPECT_EQ(two["source"], "two.png");
  // Page by page.
  std::size_t seen = 0;
  std::string query = "?limit=5";
  while (true) {
    const Json page = Items(job, query);
    for (const Json& item : page["items"]) EXPECT_EQ(item["index"], seen++);
    if (page["next"].is_null()) break;
    query = "?limit=5&cursor=" + page["next"].get<std::string>();
  }
  EXPECT_EQ(seen, 14U);
  EXPECT_EQ(client_->Get("/v1/jobs/none/items")->status, 404);
  EXPECT_EQ(client_->Get("/v1/jobs/" + job["id"].get<std::string>() + "/items?cursor=x")->status,
            400);
}

TEST_F(ImportTest, ATableChangesNamesAndLabels) {
  const std::string labels = R"({"note":"a, \"b\"\n; c","shop":"west"})";
  for (const auto& [id, i] : std::map<std::string, int>{{"a", 1}, {"b", 2}, {"c", 3}}) {
    const Json body = {{"image", Base64Of(TestImage(static_cast<std::uint64_t>(i)))},
                       {"object", "cup; \"old\", " + id},
                       {"metadata", Json::parse(labels)}};
    ASSERT_EQ(
        client_->Put(std::string(kImages) + "/" + id, body.dump(), "application/json")->status,
        201);
  }
  const auto table = [&] {
    const auto answer = client_->Get("/v1/collections/default/export?format=csv");
    EXPECT_EQ(answer->get_header_value("Content-Type"), "text/csv");
    return answer->body;
  };
  const std::string before = table();
  EXPECT_TRUE(before.starts_with("id,object,file,labels\r\na,\"cup; \"\"old\"\", a\",")) << before;
  EXPECT_EQ(Finished(client_->Post(kImport, before, "text/csv"))["failed"], 0);
  EXPECT_EQ(table(), before) << "the same table changes nothing";
  // As a spreadsheet in German writes it.
  const std::string changed =
      "\xef\xbb\xbf"
      "Object;ID;Labels\r\n"
      "Tasse \xc3\xa4;a;\r\n"
      "\"two\nlines\";b;\r\n"
      "mug;none;\r\n"
      "mug;b\r\n"
      "mug;b;7\r\n"
      ";c;\"{\"\"shop\"\": \"\"east\"\", \"\"note\"\": null}\"\r\n";
  const Json job = Finished(client_->Post(kImport, changed, "text/csv; charset=utf-8"));
  EXPECT_EQ(job["state"], "done") << job;
  std::vector<int> statuses;
  const Json items = Items(job)["items"];
  for (const Json& item : items) statuses.push_back(item["status"]);
  EXPECT_EQ(statuses, (std::vector<int>{200, 400, 404, 400, 400, 200})) << items;
  EXPECT_EQ(items[0]["outcome"], "changed");
  EXPECT_EQ(items[2]["source"], "row 4");
  EXPECT_EQ(items[3]["problem"]["detail"], "The row has 2 fields instead of 3.");
  EXPECT_EQ(items[4]["problem"]["parameter"], "labels");
  EXPECT_EQ(Record("a")["object"], "Tasse \xc3\xa4");
  EXPECT_EQ(Record("a")["metadata"], Json::parse(labels)) << "an empty cell changes no labels";
  EXPECT_EQ(Record("c")["object"], "");
  EXPECT_EQ(Record("c")["metadata"], (Json{{"shop", "east"}}));
  Refused("id,object\r\na,\"open\r\n", "text/csv", 400, "invalid_parameter");
  Refused("object,file\r\nmug,a.jpg\r\n", "text/csv", 400, "invalid_parameter");
  Refused("id,price\r\na,7\r\n", "text/csv", 400, "invalid_parameter");
  Refused("id,object\r\n", "text/csv", 400, "missing_parameter");
}

TEST_F(ImportTest, TarArchives) {
  const std::string archive =
      TarEntry("shelf/", "", '5') + TarEntry("shelf/mug/a.png", TestImage(1)) +
      TarEntry("shelf/mug/b.png", TestImage(2)) + TarEntry("shelf/cup/._c.png", "x") +
      TarEntry("shelf/.trash/d.png", TestImage(4)) + TarEntry("shelf/mug/@eaDir/a.png/M.png", "x") +
      TarEntry("__MACOSX/shelf/._a.png", "x") + TarEntry("shelf/cup/c.png", TestImage(3)) +
      TarEntry("shelf/notes.txt", "no image") + TarEntry("link.png", "", '2') +
      std::string(1024, '\0');
  const Json job = Finished(client_->Post(kImport, archive, kTar));
  EXPECT_EQ(job["state"], "done") << job;
  EXPECT_EQ(job["total"], 4);
  EXPECT_EQ(job["failed"], 1);
  EXPECT_EQ(job["system_files"], 2);
  const Json items = Items(job)["items"];
  ASSERT_EQ(items.size(), 4U);
  EXPECT_EQ(items[0]["object"], "mug");
  EXPECT_EQ(items[2]["object"], "cup");
  EXPECT_EQ(items[2]["source"], "shelf/cup/c.png");
  EXPECT_EQ(items[3]["problem"]["code"], "image_type_unknown");
  EXPECT_EQ(job["skipped"][0]["item"], "shelf/notes.txt");
  // Names of files where there are no folders, or as asked.
  const std::string flat = TarEntry("red mug.png", TestImage(4)) + std::string(1024, '\0');
  EXPECT_EQ(Items(Finished(client_->Post(kImport, flat, kTar)))["items"][0]["object"], "red mug");
  const std::string other = TarEntry("x/y.png", TestImage(5));  // without an end
  EXPECT_EQ(Items(Finished(client_->Post(std::string(kImport) + "?object_from=none", other,
                                         kTar)))["items"][0]["object"],
            "");
  // The way to the folder, below what all have in common.
  const std::string deep = TarEntry("./all/coat/front/a.png", TestImage(7)) +
                           TarEntry("./all/coat/back/b.png", TestImage(8)) +
                           TarEntry("./all/hat/front/c.png", TestImage(9)) +
                           TarEntry("./d.png", TestImage(10)) + std::string(1024, '\0');
  const Json named = Items(Finished(client_->Post(kImport, deep, kTar)))["items"];
  EXPECT_EQ(named[0]["object"], "coat/front");
  EXPECT_EQ(named[1]["object"], "coat/back");
  EXPECT_EQ(named[2]["object"], "hat/front");
  EXPECT_EQ(named[3]["object"], "d");
  // GNU's long names.
  const std::string name = std::string(150, 'd') + "/" + std::string(150, 'f') + ".png";
  const std::string longer =
      TarEntry("././@LongLink", name + std::string(1, '\0'), 'L') + TarEntry(name, TestImage(6));
  EXPECT_EQ(Items(Finished(client_->Post(kImport, longer, kTar)))["items"][0]["object"],
            std::string(150, 'd'));
}

TEST_F(ImportTest, BodiesThatAreNoneAreRefusedAtOnce) {
  Refused("", kLines, 400, "missing_parameter");
  Refused("\n \n", kLines, 400, "missing_parameter");
  Refused("x", "application/json", 415, "unsupported_content_type");
  Refused("no archive", kTar, 400, "bad_request");
  Refused("\x1f\x8b compressed", kTar, 400, "bad_request");
  Refused(std::string(512, 'x'), kTar, 400, "bad_request");
  Refused(std::string(1024, '\0'), kTar, 400, "missing_parameter");
  const std::string entry = TarEntry("a.png", TestImage(1));
  Refused(entry.substr(0, entry.size() / 2), kTar, 400, "bad_request");
  std::string damaged = entry;
  damaged[5] = 'x';
  Refused(damaged, kTar, 400, "bad_request");
  std::string many;
  for (int i = 0; i < 10'001; ++i) many += "{}\n";
  Refused(many, kLines, 400, "invalid_parameter");
  Refused("{}", kLines, 400, "invalid_parameter", "?object_from=x");
  Refused("{}", kLines, 400, "invalid_json", "?metadata=x");
  EXPECT_EQ(client_->Post("/v1/collections/none/images:import", "{}", kLines)->status, 404);
  EXPECT_EQ(Json::parse(client_->Get("/v1/jobs")->body)["jobs"].size(), 0U);
}

TEST_F(ImportTest, AnImportGoesOnAfterKill) {
  std::string body;
  for (std::uint64_t i = 0; i < 40; ++i) {
    body += Json{{"image", Base64Of(TestImage(i))}, {"id", "p" + std::to_string(i)}}.dump() + "\n";
  }
  const auto started = client_->Post(kImport, body, kLines);
  ASSERT_EQ(started->status, 202) << started->body;
  const std::string path = started->get_header_value("Location");
  while (Json::parse(client_->Get(path + "/items")->body)["items"].size() < 3) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  server_->Signal(SIGKILL);
  server_->Wait();
  Start({"--auto-train", "false"});
  client_ = std::make_unique<httplib::Client>(server_->Client());
  const Json job = Finished(started);
  EXPECT_EQ(job["state"], "done") << job;
  EXPECT_EQ(job["failed"], 0);
  const Json items = Items(job, "?limit=100")["items"];
  ASSERT_EQ(items.size(), 40U);
  std::size_t unchanged = 0;
  for (const Json& item : items) {
    EXPECT_LT(item["status"], 300);
    if (item["outcome"] == "unchanged") ++unchanged;
  }
  EXPECT_LE(unchanged, 4U) << "what was done is not done again";
  EXPECT_EQ(Json::parse(client_->Get("/v1/collections/default")->body)["images"], 40);
}

}  // namespace
}  // namespace pliant::testing
