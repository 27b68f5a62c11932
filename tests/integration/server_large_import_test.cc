// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Imports whose bodies are larger than those of other requests: files beside the database, until
// their jobs end.
#include <chrono>
#include <csignal>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "tests/integration/large_import_fixture.h"

namespace pliant::testing {
namespace {

using ::testing::HasSubstr;

TEST_F(LargeImportTest, AnArchiveAndLinesBeyondTheLimitOfBodies) {
  StartSmall();
  std::string archive = Archive(1, 6, 3 * kMiB);
  archive.resize(archive.size() - 1024);
  archive += TarEntry("shelf/huge.png", std::string(kMiB + 1, 'x')) + std::string(1024, '\0');
  const Json job = Finished(client_->Post(kImport + std::string("?object=thing"), archive, kTar));
  EXPECT_EQ(job["state"], "done") << job;
  EXPECT_EQ(job["total"], 7);
  EXPECT_EQ(job["failed"], 1);
  const Json items = Items(job);
  for (int i = 0; i < 6; ++i) EXPECT_EQ(items[i]["status"], 201) << items[i];
  EXPECT_EQ(items[6]["status"], 413) << "each is limited as in a request of its own";
  EXPECT_EQ(items[6]["problem"]["code"], "body_too_large");
  EXPECT_EQ(items[0]["object"], "thing");

  std::string lines;
  for (std::uint64_t i = 11; i < 16; ++i) {
    lines += Json{{"image", Base64Of(TestImage(i))}, {"object", "line"}}.dump() +
             std::string(500'000, ' ') + "\n";
  }
  lines += std::string(kMiB, ' ') + "{}\n";
  ASSERT_GT(lines.size(), 3 * kMiB);
  const Json second = Finished(client_->Post(kImport, lines, kLines));
  EXPECT_EQ(second["total"], 6);
  EXPECT_EQ(second["failed"], 1);
  EXPECT_EQ(Images(), 11);
  ExpectNoFiles();
}

TEST_F(LargeImportTest, WhatIsWrongIsSaidAndNothingIsLeft) {
  StartSmall({"--max-import-mb", "3"});
  const auto refused = [&](const httplib::Result& answer, int status, const std::string& code) {
    ASSERT_TRUE(answer);
    EXPECT_EQ(answer->status, status) << answer->body;
    EXPECT_EQ(Json::parse(answer->body)["code"], code) << answer->body;
    ExpectNoFiles();
  };
  const std::string archive = Archive(1, 2, 2 * kMiB);
  refused(client_->Post(kImport, archive.substr(0, archive.size() - 5000), kTar), 400,
          "bad_request");
  refused(client_->Post(kImport, std::string(2 * kMiB, 'x'), kTar), 400, "bad_request");
  refused(client_->Post(kImport, std::string(2 * kMiB, '\n'), kLines), 400, "missing_parameter");
  refused(client_->Post("/v1/collections/none/images:import", archive, kTar), 404,
          "collection_not_found");
  refused(client_->Post(kImport + std::string("?colour=red"), archive, kTar), 400,
          "unknown_parameter");
  refused(client_->Post(kImport, archive, "image/png"), 415, "unsupported_content_type");
  refused(client_->Post(kImport, Archive(1, 2, 4 * kMiB), kTar), 413, "body_too_large");
  // Other routes have the limit that they had.
  refused(client_->Post(kImages, archive, "image/png"), 413, "body_too_large");
  EXPECT_EQ(Images(), 0);
}

TEST_F(LargeImportTest, WhoGoesBeforeTheEndLeavesNothing) {
  StartSmall();
  const std::string archive = Archive(1, 2, 2 * kMiB);
  const int fd = server_->Open("POST " + std::string(kImport) +
                               " HTTP/1.1\r\nHost: localhost\r\nContent-Type: " + kTar +
                               "\r\nContent-Length: " + std::to_string(archive.size()) +
                               "\r\n\r\n" + archive.substr(0, kMiB));
  ASSERT_GE(fd, 0);
  for (int i = 0; i < 200 && Files().empty(); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  EXPECT_EQ(Files().size(), 1U) << "it is on its way";
  ::close(fd);
  ExpectNoFiles();
  EXPECT_EQ(Json::parse(client_->Get("/v1/jobs")->body)["jobs"].size(), 0U);
}

TEST_F(LargeImportTest, GoesOnAfterKill) {
  StartSmall();
  const auto started = client_->Post(kImport, Archive(1, 30, 2 * kMiB), kTar);
  ASSERT_EQ(started->status, 202) << started->body;
  const std::string path = started->get_header_value("Location");
  while (Images() < 4) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  EXPECT_EQ(Files().size(), 1U);
  server_->Signal(SIGKILL);
  server_->Wait();
  ASSERT_EQ(Files().size(), 1U);
  const std::filesystem::path body = Files().front();
  // Left by a server that was killed while it received something, and one that may be young.
  const std::string abandoned = (folder_.path() / "test.db.import-").string();
  const std::filesystem::path old = abandoned + std::string(32, 'a');
  const std::filesystem::path young = abandoned + std::string(32, 'b');
  const std::filesystem::path other = abandoned + "mine";
  for (const auto& file : {old, young, other}) std::ofstream(file) << "x";
  for (const auto& file : {old, other, body}) {
    std::filesystem::last_write_time(
        file, std::filesystem::file_time_type::clock::now() - std::chrono::hours(1));
  }
  StartSmall();
  EXPECT_FALSE(std::filesystem::exists(old));
  EXPECT_TRUE(std::filesystem::exists(young));
  EXPECT_TRUE(std::filesystem::exists(other)) << "it is none of ours";
  std::filesystem::remove(young);
  std::filesystem::remove(other);
  const Json job = Finished(path);
  EXPECT_EQ(job["state"], "done") << job;
  EXPECT_EQ(job["failed"], 0);
  EXPECT_EQ(job["attempts"], 2);
  EXPECT_EQ(Items(job).size(), 30U);
  EXPECT_EQ(Images(), 30);
  ExpectNoFiles();
}

TEST_F(LargeImportTest, ACancelledOneIsGoneAndOneWithoutItsFileFails) {
  StartSmall();
  const auto first = client_->Post(kImport, Archive(1, 40, 2 * kMiB), kTar);
  const auto second = client_->Post(kImport, Archive(50, 40, 2 * kMiB), kTar);
  ASSERT_EQ(second->status, 202) << second->body;
  EXPECT_EQ(Files().size(), 2U);
  for (const auto* started : {&first, &second}) {
    const std::string path = (*started)->get_header_value("Location");
    EXPECT_EQ(client_->Delete(path)->status, 202);
    EXPECT_EQ(Finished(path)["state"], "cancelled");
  }
  ExpectNoFiles();
  EXPECT_LT(Images(), 40);

  const auto third = client_->Post(kImport, Archive(100, 40, 2 * kMiB), kTar);
  server_->Signal(SIGKILL);
  server_->Wait();
  for (const auto& file : Files()) std::filesystem::remove(file);
  StartSmall();
  const Json job = Finished(third->get_header_value("Location"));
  EXPECT_EQ(job["state"], "failed");
  EXPECT_EQ(job["problem"]["code"], "interrupted") << job;
}

TEST_F(LargeImportTest, SentAgainWithItsKeyItIsDoneOnce) {
  StartSmall();
  const std::string archive = Archive(1, 3, 2 * kMiB);
  const httplib::Headers key = {{"Idempotency-Key", "monday"}};
  const auto first = client_->Post(kImport, key, archive, kTar);
  ASSERT_EQ(first->status, 202) << first->body;
  const auto again = client_->Post(kImport, key, archive, kTar);
  EXPECT_EQ(again->body, first->body);
  EXPECT_EQ(again->get_header_value("Idempotency-Replayed"), "true");
  std::string other = archive;
  other[other.size() / 2] ^= 1;
  EXPECT_EQ(client_->Post(kImport, key, other, kTar)->status, 422);
  EXPECT_EQ(Finished(first)["failed"], 0);
  EXPECT_EQ(Json::parse(client_->Get("/v1/jobs")->body)["jobs"].size(), 1U);
  ExpectNoFiles();
}

}  // namespace
}  // namespace pliant::testing
