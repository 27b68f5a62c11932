// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What leaves the server at once: all records, and features for NumPy.
#include <algorithm>
#include <chrono>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>

#include "tests/integration/server_fixture.h"

namespace pliant::testing {
namespace {

using ::testing::HasSubstr;

constexpr const char* kExport = "/v1/collections/default/export";

class ExportTest : public ServerTest {
 protected:
  void SetUp() override { Start({"--auto-train", "false"}); }
};

TEST_F(ExportTest, ExportsAllRecordsOrSome) {
  auto client = server_->Client();
  std::set<std::string> ids;
  for (std::uint64_t i = 0; i < 7; ++i) {
    const std::string id = "p" + std::to_string(i);
    ASSERT_EQ(client
                  .Put(std::string(kImages) + "/" + id + "?object=o" + std::to_string(i % 2) +
                           "&metadata={\"n\":" + std::to_string(i) + "}",
                       TestPicture(i), "image/png")
                  ->status,
              201);
    ids.insert(id);
  }
  const auto lines = [&](const std::string& query) {
    const auto answer = client.Get(kExport + query);
    EXPECT_EQ(answer->status, 200) << answer->body;
    EXPECT_EQ(answer->get_header_value("Content-Type"), "application/x-ndjson");
    EXPECT_EQ(answer->get_header_value("Content-Length"), std::to_string(answer->body.size()));
    std::vector<Json> records;
    for (std::size_t begin = 0; begin < answer->body.size();) {
      const std::size_t end = answer->body.find('\n', begin);
      records.push_back(Json::parse(answer->body.substr(begin, end - begin)));
      begin = end + 1;
    }
    return records;
  };
  const std::vector<Json> all = lines("");
  ASSERT_EQ(all.size(), 7U);
  for (const Json& record : all) ids.erase(record["id"].get<std::string>());
  EXPECT_TRUE(ids.empty()) << "each once";
  for (const Json& record : all) {
    const std::string path = std::string(kImages) + "/" + record["id"].get<std::string>();
    EXPECT_EQ(record, Json::parse(client.Get(path)->body));
  }
  EXPECT_EQ(lines("?object=o1").size(), 3U);
  EXPECT_EQ(lines("?filter=%7B%22n%22%3A%7B%22gt%22%3A4%7D%7D").size(), 2U);
  EXPECT_TRUE(lines("?q=nothing").empty());
  const auto head = client.Head(kExport);
  EXPECT_EQ(head->status, 200);
  EXPECT_GT(std::stoi(head->get_header_value("Content-Length")), 1000);
  EXPECT_EQ(client.Get("/v1/collections/none/export")->status, 404);
  EXPECT_EQ(client.Get(std::string(kExport) + "?filter=x")->status, 400);
  EXPECT_EQ(client.Get("/livez")->status, 200) << "the connection goes on";
}

TEST_F(ExportTest, ALongExportIsSentAsTheClientTakesItAndTheServerStaysSmall) {
  auto client = server_->Client();
  // Large metadata make a large answer of few pictures.
  const std::string filler(60'000, 'x');
  const std::string picture = TestPicture(1);
  for (int i = 0; i < 200; ++i) {
    const Json body = {{"image", Base64Of(picture)}, {"metadata", {{"filler", filler}, {"i", i}}}};
    ASSERT_EQ(
        client
            .Put(std::string(kImages) + "/p" + std::to_string(i), body.dump(), "application/json")
            ->status,
        201);
  }
  std::size_t taken = 0;
  std::size_t newlines = 0;
  auto slow = server_->Client();
  const auto answer = slow.Get(kExport, [&](const char* data, std::size_t size) {
    if (taken == 0) std::this_thread::sleep_for(std::chrono::milliseconds(300));
    taken += size;
    newlines += static_cast<std::size_t>(std::count(data, data + size, '\n'));
    return true;
  });
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->status, 200);
  EXPECT_GT(taken, 200U * 60'000U);
  EXPECT_EQ(newlines, 200U);
  // Somebody who goes away in between harms nobody.
  auto gone = server_->Client();
  gone.Get(kExport, [](const char*, std::size_t) { return false; });
  EXPECT_EQ(client.Get("/livez")->status, 200);
}

TEST_F(ExportTest, FeaturesAsNumpyArchive) {
  auto client = server_->Client();
  ASSERT_EQ(client.Put(std::string(kImages) + "/p", TestPicture(1), "image/png")->status, 201);
  const auto answer = client.Get(std::string(kImages) + "/p/features?format=npz");
  ASSERT_EQ(answer->status, 200) << answer->body;
  EXPECT_EQ(answer->get_header_value("Content-Type"), "application/vnd.numpy.npz");
  EXPECT_EQ(answer->body.substr(0, 4), std::string("PK\x03\x04"));
  for (const char* name : {"keypoints.npy", "descriptors.npy", "model_id.npy", "width.npy"}) {
    EXPECT_THAT(answer->body, HasSubstr(name));
  }
  EXPECT_EQ(client.Get(std::string(kImages) + "/p/features?format=zip")->status, 400);
  EXPECT_EQ(Json::parse(client.Get(std::string(kImages) + "/p/features?format=json")->body)
                .contains("keypoints"),
            true);
}

}  // namespace
}  // namespace pliant::testing
