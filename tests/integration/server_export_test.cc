// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What leaves the server at once: all records, and features for NumPy.
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstring>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

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
                       TestImage(i), "image/png")
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
  // Large metadata make a large answer of few images.
  const std::string filler(60'000, 'x');
  const std::string image = TestImage(1);
  for (int i = 0; i < 200; ++i) {
    const Json body = {{"image", Base64Of(image)}, {"metadata", {{"filler", filler}, {"i", i}}}};
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

constexpr const char* kFeatures = "/v1/collections/default/features";

// Numbers of an array of int64 in an archive that is not compressed.
std::vector<std::int64_t> NumbersIn(const std::string& archive, const std::string& name) {
  const std::size_t file = archive.find(name + ".npy");  // in its head, before the directory
  const std::size_t header = archive.find("\x93NUMPY", file);
  const std::size_t begin = archive.find('\n', header) + 1;
  const std::size_t shape = archive.find("'shape': (", header) + 10;
  std::vector<std::int64_t> numbers(std::stoul(archive.substr(shape, 20)));
  if (numbers.empty()) return numbers;
  std::memcpy(numbers.data(), archive.data() + begin, numbers.size() * sizeof(std::int64_t));
  return numbers;
}

TEST_F(ExportTest, FeaturesOfACollection) {
  auto client = server_->Client();
  const auto empty = client.Get(kFeatures);
  ASSERT_EQ(empty->status, 200) << empty->body;
  EXPECT_EQ(NumbersIn(empty->body, "starts"), std::vector<std::int64_t>{0});
  std::vector<std::int64_t> starts = {0};
  for (std::uint64_t i = 0; i < 5; ++i) {
    const auto added = client.Put(
        std::string(kImages) + "/p" + std::to_string(i) + "?object=o" + std::to_string(i % 2),
        TestImage(i), "image/png");
    ASSERT_EQ(added->status, 201);
    starts.push_back(starts.back() + Json::parse(added->body)["keypoints"].get<std::int64_t>());
  }
  const auto answer = client.Get(kFeatures);
  ASSERT_EQ(answer->status, 200) << answer->body;
  EXPECT_EQ(answer->get_header_value("Content-Type"), "application/vnd.numpy.npz");
  EXPECT_THAT(answer->get_header_value("Content-Disposition"), HasSubstr("default.npz"));
  EXPECT_EQ(NumbersIn(answer->body, "starts"), starts);
  EXPECT_EQ(NumbersIn(answer->body, "width"), std::vector<std::int64_t>(5, 320));
  for (const char* name : {"keypoints", "descriptors", "names", "objects", "model_id", "height"}) {
    EXPECT_THAT(answer->body, HasSubstr(std::string(name) + ".npy"));
  }
  EXPECT_EQ(NumbersIn(client.Get(std::string(kFeatures) + "?object=o1")->body, "starts").size(),
            3U);
  EXPECT_EQ(client.Get("/v1/collections/none/features")->status, 404);
  EXPECT_EQ(client.Get(std::string(kFeatures) + "?format=json")->status, 400);
  EXPECT_EQ(client.Head(kFeatures)->get_header_value("Content-Length"),
            std::to_string(answer->body.size()));
}

TEST_F(ExportTest, FeaturesAreOfOneStateHoweverLongTheyTake) {
  auto client = server_->Client();
  const std::string image = TestImage(1, 0, 1600, 1200);
  for (int i = 0; i < 60; ++i) {
    ASSERT_EQ(client
                  .Put(std::string(kImages) + "/p" + std::to_string(i) + "?object=mass", image,
                       "image/png")
                  ->status,
              201);
  }
  const std::string whole = client.Get(kFeatures)->body;
  ASSERT_GT(whole.size(), 12'000'000U) << "more than sockets hold";
  // All is removed when a client has seen the first bytes.
  std::string taken;
  auto slow = server_->Client();
  const auto answer = slow.Get(kFeatures, [&](const char* data, std::size_t size) {
    if (taken.empty()) {
      EXPECT_EQ(client.Delete("/v1/collections/default/objects/mass")->status, 200);
      std::this_thread::sleep_for(std::chrono::milliseconds(300));
    }
    taken.append(data, size);
    return true;
  });
  ASSERT_TRUE(answer);
  EXPECT_TRUE(taken == whole);
  // Others add and remove while archives are made.
  std::atomic<bool> stop{false};
  std::thread writer([&] {
    auto other = server_->Client();
    for (int i = 0; !stop; ++i) {
      const std::string path = std::string(kImages) + "/w" + std::to_string(i % 7);
      i % 3 == 0 ? other.Delete(path) : other.Put(path, TestImage(i % 11), "image/png");
    }
  });
  for (int i = 0; i < 20; ++i) {
    const auto archive = client.Get(kFeatures);
    EXPECT_EQ(archive->status, 200) << archive->body;
    const std::vector<std::int64_t> starts = NumbersIn(archive->body, "starts");
    EXPECT_EQ(starts.size(), NumbersIn(archive->body, "height").size() + 1);
    EXPECT_TRUE(std::is_sorted(starts.begin(), starts.end()));
  }
  stop = true;
  writer.join();
}

TEST_F(ExportTest, WhoStopsReadingHoldsNothing) {
  auto client = server_->Client();
  const std::string image = TestImage(1, 0, 1600, 1200);
  for (int i = 0; i < 60; ++i) {
    ASSERT_EQ(
        client.Put(std::string(kImages) + "/p" + std::to_string(i), image, "image/png")->status,
        201);
  }
  // More than may be made at once: none of them is being made any more.
  std::vector<int> sockets;
  for (int i = 0; i < 6; ++i) {
    sockets.push_back(
        server_->Open("GET " + std::string(kFeatures) + " HTTP/1.1\r\nHost: localhost\r\n\r\n"));
    ASSERT_GE(sockets.back(), 0);
    char byte = 0;
    ASSERT_EQ(::recv(sockets.back(), &byte, 1, MSG_PEEK), 1) << "the answer begins";
    EXPECT_EQ(byte, 'H');
  }
  EXPECT_EQ(client.Get(kFeatures)->status, 200);
  EXPECT_EQ(client.Delete(std::string(kImages) + "/p1")->status, 204);
  for (const int socket : sockets) ::close(socket);
  EXPECT_EQ(client.Get("/livez")->status, 200);
}

TEST_F(ExportTest, AFullDiskIsSaid) {
  auto client = server_->Client();
  for (int i = 0; i < 3; ++i) {
    ASSERT_EQ(
        client.Put(std::string(kImages) + "/p" + std::to_string(i), TestImage(1), "image/png")
            ->status,
        201);
  }
  server_->LimitFiles(4096);
  const auto full = client.Get(kFeatures);
  EXPECT_EQ(full->status, 507) << full->body;
  server_->LimitFiles(RLIM_INFINITY);
  EXPECT_EQ(client.Get(kFeatures)->status, 200);
}

TEST_F(ExportTest, FeaturesAsNumpyArchive) {
  auto client = server_->Client();
  ASSERT_EQ(client.Put(std::string(kImages) + "/p", TestImage(1), "image/png")->status, 201);
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
