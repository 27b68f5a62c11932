// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Demonstration objects: added by one request, and found by their crumpled images.
#include <chrono>
#include <thread>

#include <gtest/gtest.h>

#include "tests/integration/server_process.h"

namespace pliant::testing {
namespace {

Json WaitForJob(httplib::Client& client, const std::string& id) {
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::minutes(4);
  while (std::chrono::steady_clock::now() < deadline) {
    Json job = Json::parse(client.Get("/v1/jobs/" + id)->body);
    if (job["state"] != "queued" && job["state"] != "running") return job;
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
  return {{"state", "too slow"}};
}

TEST(ServerDemo, IsAddedOnceAndFound) {
  const TemporaryFolder folder;
  ServerProcess server(folder.path() / "test.db");
  auto client = server.Client();
  client.set_read_timeout(std::chrono::minutes(1));
  const std::string path = "/v1/collections/default/demo";
  EXPECT_EQ(Json::parse(client.Get(path)->body)["loaded"], false);
  for (int time = 0; time < 2; ++time) {  // the second time there is nothing to do
    const auto started = client.Post(path);
    ASSERT_EQ(started->status, 202) << started->body;
    const Json job = WaitForJob(client, Json::parse(started->body)["id"]);
    EXPECT_EQ(job["state"], "done") << job;
  }
  const Json demo = Json::parse(client.Get(path)->body);
  EXPECT_EQ(demo["loaded"], true);
  const std::size_t count = demo["objects"].size();
  ASSERT_GT(count, 3U);
  EXPECT_EQ(Json::parse(client.Get("/v1/collections/default")->body)["images"], count);
  for (const Json& object : demo["objects"]) {
    const auto crumpled = client.Get(object["crumpled"].get<std::string>());
    ASSERT_EQ(crumpled->status, 200) << crumpled->body;
    EXPECT_EQ(crumpled->get_header_value("Content-Type"), "image/jpeg");
    const auto found = client.Post("/v1/collections/default/search", crumpled->body, "image/jpeg");
    ASSERT_EQ(found->status, 200) << found->body;
    const Json answer = Json::parse(found->body);
    EXPECT_EQ(answer["verdict"], "found") << answer;
    EXPECT_EQ(answer["hits"][0]["image_id"], object["image_id"]) << answer;
  }
  EXPECT_EQ(client.Get("/assets/demo/nothing.jpg")->status, 404);
  EXPECT_EQ(client.Post("/v1/collections/none/demo")->status, 404);
}

}  // namespace
}  // namespace pliant::testing
