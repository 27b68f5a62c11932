// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A collection that tests itself, over HTTP and with `pliant selftest`.
#include <gtest/gtest.h>

#include "tests/integration/program.h"
#include "tests/integration/server_fixture.h"

namespace pliant::testing {
namespace {

constexpr const char* kCollection = "/v1/collections/default";
constexpr const char* kSelfTest = "/v1/collections/default/selftest";
constexpr const char* kJson = "application/json";
constexpr const char* kPatch = "application/merge-patch+json";

using ServerSelfTest = ServerTest;

// The job at its end.
Json Finish(httplib::Client& client, const httplib::Result& started) {
  EXPECT_TRUE(started && started->status == 202) << (started ? started->body : "no answer");
  const std::string id = Json::parse(started->body)["id"];
  Json job;
  do {
    job = Json::parse(client.Get("/v1/jobs/" + id + "?wait=30")->body);
  } while (job["state"] == "queued" || job["state"] == "running");
  return job;
}

TEST_F(ServerSelfTest, ReportsAndCalibrates) {
  Start();
  httplib::Client client = server_->Client();
  client.set_read_timeout(std::chrono::minutes(2));
  EXPECT_TRUE(Json::parse(client.Get(kSelfTest)->body)["report"].is_null());
  const Json empty = Finish(client, client.Post(kSelfTest, "{}", kJson));
  EXPECT_EQ(empty["state"], "failed");
  EXPECT_EQ(empty["problem"]["code"], "no_images") << empty;

  EXPECT_EQ(Finish(client, client.Post(std::string(kCollection) + "/demo"))["state"], "done");
  SearchFor(client, TestImage(0, 0));  // waits for the vocabulary
  const Json job = Finish(
      client, client.Post(kSelfTest, R"({"pictures": 6, "false_alarms": 0.2, "seed": 3})", kJson));
  EXPECT_EQ(job["state"], "done") << job;
  EXPECT_EQ(job["result"], kSelfTest);
  const Json report = Json::parse(client.Get(kSelfTest)->body)["report"];
  EXPECT_EQ(report["images"], 6);
  EXPECT_EQ(report["photos"], 6);
  EXPECT_GE(report["outcomes"]["found"]["count"], 4) << report["outcomes"];
  EXPECT_EQ(report["outcomes"]["false_alarms"]["count"], 0);
  EXPECT_EQ(report["reaches_rate"], true);
  ASSERT_FALSE(report["examples"].empty());
  const std::string photo = BytesOfBase64(report["examples"][0]["photo"]);
  EXPECT_EQ(photo.substr(0, 2), "\xff\xd8");

  const Json patch = {{"found_from", report["found_from"]}};
  const auto changed = client.Patch(kCollection, patch.dump(), kPatch);
  ASSERT_EQ(changed->status, 200) << changed->body;
  EXPECT_EQ(Json::parse(changed->body)["found_from"], report["found_from"]);
  EXPECT_EQ(client.Patch(kCollection, R"({"found_from": 0.2})", kPatch)->status, 400);
  EXPECT_EQ(client.Patch(kCollection, R"({"found_from": "much"})", kPatch)->status, 400);
  EXPECT_EQ(
      Json::parse(client.Patch(kCollection, R"({"found_from": null})", kPatch)->body)["found_from"],
      0.9);
  for (const char* wrong : {R"({"pictures": 0})", R"({"false_alarms": 1})", R"({"photos": 3})"}) {
    EXPECT_EQ(client.Post(kSelfTest, wrong, kJson)->status, 400) << wrong;
  }
  EXPECT_EQ(client.Get("/v1/collections/none/selftest")->status, 404);

  // The same photos from the command line.
  const std::string db = (folder_.path() / "test.db").string();
  const ProgramResult result = RunProgram({"selftest", "--db", db, "--pictures", "6",
                                           "--false-alarms", "0.2", "--seed", "3", "--json"});
  ASSERT_EQ(result.status, 0) << result.err;
  EXPECT_GE(result.json()["outcomes"]["found"]["count"], 4);  // maybe with a newer vocabulary
  EXPECT_FALSE(result.json().contains("examples"));
  const ProgramResult text = RunProgram(
      {"selftest", "--db", db, "--pictures", "3", "--false-alarms", "0.5", "--calibrate"});
  ASSERT_EQ(text.status, 0) << text.err;
  EXPECT_NE(text.out.find("3 simulated photos of 6 images"), std::string::npos) << text.out;
  EXPECT_EQ(Json::parse(client.Get(kCollection)->body)["found_from"], 0.5);
}

}  // namespace
}  // namespace pliant::testing
