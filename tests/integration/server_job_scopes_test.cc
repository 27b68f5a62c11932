// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Which jobs a key sees and cancels: those that name files of the server are its admins' alone.
#include <fstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/integration/backups_fixture.h"

namespace pliant::testing {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::UnorderedElementsAre;

constexpr const char* kImports = "/v1/collections/default/imports";

class JobScopesTest : public BackupsTest {
 protected:
  void SetUp() override {
    BackupsTest::SetUp();
    fs::create_directories(folder_ / "imports" / "secret-shelf");
    std::ofstream(folder_ / "imports" / "secret-shelf" / "broken-one.png") << "no image";
    StartWithBackups({"--import-dir", (folder_ / "imports").string()});
    MakeBackup("secret.db", 1);
    backup_ = Json::parse(client_->Get("/v1/jobs")->body)["jobs"][0]["id"];
    const auto import = client_->Post(kImports, kShelf, "application/json");
    import_ = Json::parse(import->body)["id"];
    EXPECT_EQ(Json::parse(client_->Get("/v1/jobs/" + import_ + "?wait=30")->body)["failed"], 1);
    demo_ = Json::parse(client_->Post("/v1/collections/default/demo")->body)["id"];
    const std::string admin = MakeKey("admin");
    client_->set_default_headers({{"X-API-Key", admin}});
  }
  std::string MakeKey(const std::string& scope) {
    const auto made = client_->Post("/v1/keys", Json{{"name", scope}, {"scope", scope}}.dump(),
                                    "application/json");
    EXPECT_EQ(made->status, 201) << made->body;
    return Json::parse(made->body)["key"];
  }
  std::vector<std::string> Listed() const {
    std::vector<std::string> ids;
    const Json list = Json::parse(client_->Get("/v1/jobs")->body);
    for (const Json& job : list["jobs"]) ids.push_back(job["id"]);
    return ids;
  }

  static constexpr const char* kShelf = R"({"folder": "secret-shelf"})";
  std::string backup_, import_, demo_;
};

TEST_F(JobScopesTest, JobsAreListedPageByPage) {
  EXPECT_EQ(Json::parse(client_->Get("/v1/jobs/" + demo_ + "?wait=60")->body)["state"], "done");
  std::vector<std::string> ids;
  for (std::string next = "/v1/jobs?limit=1&state=done";;) {
    const auto answer = client_->Get(next);
    ASSERT_EQ(answer->status, 200) << answer->body;
    const Json page = Json::parse(answer->body);
    ASSERT_EQ(page["jobs"].size(), 1U);
    ids.push_back(page["jobs"][0]["id"]);
    const std::string link = answer->get_header_value("Link");
    EXPECT_EQ(link.empty(), page["next"].is_null());
    if (link.empty()) break;
    EXPECT_THAT(link, HasSubstr("&limit=1&state=done>; rel=\"next\""));
    next = link.substr(1, link.find('>') - 1);
  }
  EXPECT_EQ(ids, (std::vector<std::string>{demo_, import_, backup_}));
  const auto listed = [&](const std::string& query) {
    return Json::parse(client_->Get("/v1/jobs?" + query)->body)["jobs"].size();
  };
  EXPECT_EQ(listed("state=failed"), 0U);
  EXPECT_EQ(listed("collection=none"), 0U);
  EXPECT_EQ(listed("collection=default&state=done"), 2U) << "a backup is of no collection";
  Refused(client_->Get("/v1/jobs?state=over"), 400, "invalid_parameter");
  const Json page = Json::parse(client_->Get("/v1/jobs?limit=1")->body);
  Refused(client_->Get("/v1/jobs?state=done&cursor=" + page["next"].get<std::string>()), 400,
          "invalid_cursor");
}

TEST_F(JobScopesTest, WhatNamesFilesOfTheServerIsForAdmins) {
  EXPECT_THAT(Listed(), UnorderedElementsAre(backup_, import_, demo_));
  EXPECT_EQ(client_->Get("/v1/jobs/" + backup_)->status, 200);
  EXPECT_EQ(client_->Delete("/v1/jobs/" + import_)->status, 202);
  const std::string write = MakeKey("write");
  const std::string read = MakeKey("read");
  for (const std::string& key : {write, read}) {
    client_->set_default_headers({{"X-API-Key", key}});
    EXPECT_THAT(client_->Get("/v1/jobs")->body, Not(HasSubstr("secret")));
    EXPECT_THAT(Listed(), UnorderedElementsAre(demo_));
    EXPECT_EQ(client_->Get("/v1/jobs/" + demo_)->status, 200);
    for (const std::string& id : {backup_, import_}) {
      Refused(client_->Get("/v1/jobs/" + id), 404, "job_not_found");
      Refused(client_->Get("/v1/jobs/" + id + "?wait=1"), 404, "job_not_found");
      Refused(client_->Get("/v1/jobs/" + id + "/items"), 404, "job_not_found");
      if (key == write) Refused(client_->Delete("/v1/jobs/" + id), 404, "job_not_found");
    }
    Refused(client_->Post(kImports, kShelf, "application/json"), 403, "forbidden");
  }
  client_->set_default_headers({{"X-API-Key", write}});
  EXPECT_EQ(client_->Delete("/v1/jobs/" + demo_)->status, 202);
}

}  // namespace
}  // namespace pliant::testing
