// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Backups that are downloaded, uploaded and deleted over HTTP.
#include <chrono>
#include <csignal>
#include <string>
#include <thread>
#include <vector>

#include <SQLiteCpp/SQLiteCpp.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include "tests/integration/backups_fixture.h"
#include "tests/integration/certificate.h"

namespace pliant::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;

TEST_F(BackupsTest, AreDownloadedWholeAndInParts) {
  StartWithBackups();
  const std::string bytes = MakeBackup("a.db");
  ASSERT_GT(bytes.size(), 100'000U);
  const std::string path = "/v1/backups/a.db/content";
  const auto whole = client_->Get(path);
  ASSERT_TRUE(whole);
  EXPECT_EQ(whole->status, 200);
  EXPECT_EQ(whole->body, bytes);
  EXPECT_EQ(whole->get_header_value("Content-Type"), kType);
  EXPECT_EQ(whole->get_header_value("Accept-Ranges"), "bytes");
  EXPECT_THAT(whole->get_header_value("Content-Disposition"), HasSubstr("a.db"));
  const std::string etag = whole->get_header_value("ETag");
  EXPECT_THAT(etag, StartsWith("\""));
  const auto head = client_->Head(path);
  EXPECT_EQ(head->get_header_value("Content-Length"), std::to_string(bytes.size()));
  EXPECT_EQ(head->body, "");
  const auto part = client_->Get(path, {{"Range", "bytes=70000-99999"}, {"If-Range", etag}});
  EXPECT_EQ(part->status, 206);
  EXPECT_EQ(part->body, bytes.substr(70'000, 30'000));
  EXPECT_EQ(part->get_header_value("Content-Range"),
            "bytes 70000-99999/" + std::to_string(bytes.size()));
  EXPECT_EQ(client_->Get(path, {{"Range", "bytes=-100"}})->body, bytes.substr(bytes.size() - 100));
  EXPECT_EQ(client_->Get(path, {{"Range", "bytes=5-"}, {"If-Range", "\"other\""}})->body, bytes);
  EXPECT_EQ(client_->Get(path, {{"Range", "bytes=999999999-"}})->status, 416);
  const auto same = client_->Get(path, {{"If-None-Match", etag}, {"Connection", "close"}});
  EXPECT_EQ(same->status, 304);
  EXPECT_EQ(same->body, "");
  EXPECT_EQ(client_->Get(path, {{"If-Match", "\"other\""}})->status, 412);
  Refused(client_->Get("/v1/backups/none.db/content"), 404, "backup_not_found");
  Refused(client_->Get("/v1/backups/..%2Ftest.db/content"), 404, "backup_not_found");
  fs::create_symlink(folder_.path() / "test.db", fs::path(directory_) / "link.db");
  Refused(client_->Get("/v1/backups/link.db/content"), 404, "backup_not_found");
}

TEST_F(BackupsTest, RemovedWhileTheyAreSentTheyArriveWhole) {
  StartWithBackups();
  const std::string bytes = MakeBackup("a.db", 8);
  const int fd = server_->Open(
      "GET /v1/backups/a.db/content HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n");
  ASSERT_GE(fd, 0);
  char first = 0;
  ASSERT_EQ(recv(fd, &first, 1, 0), 1);
  EXPECT_EQ(client_->Delete("/v1/backups/a.db")->status, 204);
  EXPECT_THAT(Files(), IsEmpty());
  Refused(client_->Get("/v1/backups/a.db/content"), 404, "backup_not_found");
  Refused(client_->Delete("/v1/backups/a.db"), 404, "backup_not_found");
  std::string all(1, first);
  char buffer[65536];
  for (ssize_t n = 0; (n = recv(fd, buffer, sizeof(buffer), 0)) > 0;) {
    all.append(buffer, static_cast<std::size_t>(n));
  }
  close(fd);
  ASSERT_GT(all.size(), bytes.size());
  EXPECT_TRUE(all.ends_with(bytes));
}

TEST_F(BackupsTest, AnUploadedOneIsTheSameAndCanBeRestored) {
  StartWithBackups();
  const std::string bytes = MakeBackup("a.db", 8);
  ASSERT_GT(bytes.size(), 1U << 20) << "more than any other body may have";
  const auto stored = Put("b.db", bytes);
  ASSERT_TRUE(stored) << httplib::to_string(stored.error());
  ASSERT_EQ(stored->status, 201) << stored->body;
  EXPECT_EQ(stored->get_header_value("Location"), "/v1/backups/b.db");
  EXPECT_EQ(Json::parse(stored->body)["bytes"], bytes.size());
  EXPECT_EQ(Contents(fs::path(directory_) / "b.db"), bytes);
  EXPECT_THAT(Files(), ElementsAre("a.db", "b.db")) << "and nothing beside them";
  EXPECT_EQ(fs::status(fs::path(directory_) / "b.db").permissions(),
            fs::perms::owner_read | fs::perms::owner_write);
  EXPECT_EQ(client_->Get("/v1/backups/b.db/content")->body, bytes);
  EXPECT_THAT(server_->Talk("PUT /v1/backups/c.db HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: " +
                            std::to_string(bytes.size()) + "\r\n\r\n" + bytes),
              StartsWith("HTTP/1.1 201"))
      << "without a type, as curl -T sends it";
  EXPECT_EQ(client_->Get("/v1/collections")->status, 200) << "the connection goes on";
  const std::string restored = (folder_.path() / "restored.db").string();
  const ProgramResult done =
      RunProgram({"db", "restore", (fs::path(directory_) / "b.db").string(), "--db", restored});
  EXPECT_EQ(done.status, 0) << done.err;
  const ProgramResult check = RunProgram({"db", "check", "--db", restored});
  EXPECT_EQ(check.status, 0) << check.out << check.err;
}

TEST_F(BackupsTest, EncryptedTheyAreTheSame) {
  StartWithBackups();
  const std::string bytes = MakeBackup("a.db", 8);
  server_->Stop();
  WriteCertificate(folder_ / "cert.pem", folder_ / "key.pem");
  StartWithBackups(
      {"--tls-cert", (folder_ / "cert.pem").string(), "--tls-key", (folder_ / "key.pem").string()});
  httplib::SSLClient client("127.0.0.1", server_->port());
  client.set_ca_cert_path((folder_ / "cert.pem").string());
  client.set_read_timeout(60);
  const auto stored = client.Put("/v1/backups/b.db", bytes, kType);
  ASSERT_TRUE(stored) << httplib::to_string(stored.error());
  EXPECT_EQ(stored->status, 201) << stored->body;
  EXPECT_EQ(Contents(fs::path(directory_) / "b.db"), bytes);
  EXPECT_EQ(client.Get("/v1/backups/b.db/content")->body, bytes);
}

TEST_F(BackupsTest, OnlyWhatIsABackupIsTaken) {
  StartWithBackups();
  const std::string bytes = MakeBackup("a.db");
  Refused(Put("a.db", bytes), 409, "backup_exists");
  EXPECT_EQ(Contents(fs::path(directory_) / "a.db"), bytes);
  Refused(Put("b.db", "hello"), 422, "backup_invalid", "no database of Pliant's");
  Refused(Put("b.db", std::string(2'000'000, 'x')), 422, "backup_invalid", "no database");
  Refused(Put("b.db", bytes.substr(0, 10)), 422, "backup_invalid", "no database");
  Refused(Put("b.db", bytes.substr(0, 99)), 422, "backup_invalid", "no database");
  Refused(Put("b.db", bytes.substr(0, bytes.size() / 2)), 422, "backup_invalid", "cut short");
  Refused(Put("b.db", bytes.substr(0, bytes.size() - 1)), 422, "backup_invalid", "cut short");
  std::string other = bytes;
  other[70] = 'x';  // of the application id
  Refused(Put("b.db", other), 422, "backup_invalid", "no database of Pliant's");
  std::string newer = bytes;
  newer[62] = 99;  // of the schema's version
  Refused(Put("b.db", newer), 422, "backup_invalid", "another Pliant");
  std::string damaged = bytes;
  for (std::size_t at = 8192 + 100; at + 64 < damaged.size(); at += 8192) {
    damaged.replace(at, 64, 64, '\xa5');
  }
  Refused(Put("b.db", damaged), 422, "backup_invalid", "damaged");
  Refused(Put("b.db", ""), 400, "missing_parameter");
  Refused(Put("b.txt", bytes), 400, "invalid_parameter");
  Refused(Put(".b.db", bytes), 400, "invalid_parameter");
  Refused(Put("..%2Fb.db", bytes), 400, "invalid_parameter");
  Refused(Put("b.db?x=1", bytes), 400, "unknown_parameter");
  Refused(Put("b.db", bytes, "text/plain"), 415, "unsupported_content_type");
  EXPECT_THAT(server_->Talk("PUT /v1/backups/b.db HTTP/1.1\r\nHost: 127.0.0.1\r\n"
                            "Content-Type: application/octet-stream\r\n"
                            "Transfer-Encoding: chunked\r\n\r\n"),
              HasSubstr("length_required"));
  EXPECT_THAT(FilesWhenSettled({"a.db"}), ElementsAre("a.db"));
}

TEST_F(BackupsTest, OneWhoseCheckWouldNeverEndIsRefusedAtOnce) {
  StartWithBackups();
  MakeBackup("a.db");
  const std::string changed = folder_ / "changed.db";
  fs::copy_file(fs::path(directory_) / "a.db", changed);
  SQLite::Database(changed, SQLite::OPEN_READWRITE)
      .exec(
          "PRAGMA journal_mode = DELETE; DROP TABLE pictures; CREATE VIEW pictures AS "
          "WITH RECURSIVE n (key) AS (SELECT 1 UNION ALL SELECT key + 1 FROM n) "
          "SELECT key, 1 AS collection, 1 AS keypoints FROM n");
  for (int i = 0; i < 3; ++i) {  // more often than there are places for uploads
    Refused(Put("b.db", Contents(changed)), 422, "backup_invalid", "not Pliant's");
  }
  EXPECT_THAT(FilesWhenSettled({"a.db"}), ElementsAre("a.db"));
}

TEST_F(BackupsTest, LimitsAndAFullDisk) {
  StartWithBackups({"--max-backup-mb", "2"});
  const std::string bytes = MakeBackup("a.db");
  Refused(Put("b.db", std::string((2 << 20) + 1, 'x')), 413, "body_too_large", "2 MiB");
  EXPECT_THAT(server_->Talk("PUT /v1/backups/b.db HTTP/1.1\r\nHost: 127.0.0.1\r\n"
                            "Content-Type: application/octet-stream\r\n"
                            "Content-Length: 99999999999999999999999\r\n\r\n"),
              HasSubstr("body_too_large"));
  server_->LimitFiles(bytes.size() / 2);
  const auto full = Put("b.db", bytes);
  server_->LimitFiles(RLIM_INFINITY);
  Refused(full, 507, "no_space");
  EXPECT_THAT(FilesWhenSettled({"a.db"}), ElementsAre("a.db"));
  EXPECT_EQ(Put("b.db", bytes)->status, 201);
  server_->Stop();
  StartWithBackups();
  EXPECT_THAT(server_->Talk("PUT /v1/backups/c.db HTTP/1.1\r\nHost: 127.0.0.1\r\n"
                            "Content-Type: application/octet-stream\r\n"
                            "Content-Length: 9000000000000000\r\n\r\n"),
              HasSubstr("no_space"))
      << "said before anything is sent";
}

TEST_F(BackupsTest, WhatBreaksOffLeavesNothing) {
  StartWithBackups({"--body-timeout", "1"});
  const std::string bytes = MakeBackup("a.db");
  const std::string half = bytes.substr(0, bytes.size() / 2);
  const int gone = BeginUpload("b.db", bytes.size(), half);
  while (Files().size() < 2) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  close(gone);
  EXPECT_THAT(FilesWhenSettled({"a.db"}), ElementsAre("a.db"));
  const std::string silent = server_->Talk(
      "PUT /v1/backups/b.db HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: "
      "application/octet-stream\r\n"
      "Content-Length: " +
          std::to_string(bytes.size()) + "\r\n\r\n" + half,
      std::chrono::seconds(20));
  EXPECT_THAT(silent, HasSubstr("request_timeout"));
  EXPECT_THAT(FilesWhenSettled({"a.db"}), ElementsAre("a.db"));
  // Who is slow but goes on has time: longer than --body-timeout.
  const int slow = BeginUpload("slow.db", bytes.size(), half);
  std::size_t sent = half.size();
  for (int i = 0; i < 4; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(500));
    const std::size_t piece = i < 3 ? 1000 : bytes.size() - sent;
    for (std::size_t end = sent + piece; sent < end;) {
      const ssize_t n = send(slow, bytes.data() + sent, end - sent, MSG_NOSIGNAL);
      ASSERT_GT(n, 0);
      sent += static_cast<std::size_t>(n);
    }
  }
  EXPECT_THAT(FilesWhenSettled({"a.db", "slow.db"}), ElementsAre("a.db", "slow.db"));
  close(slow);
}

TEST_F(BackupsTest, KilledMidwayLeavesNothing) {
  StartWithBackups();
  const std::string bytes = MakeBackup("a.db");
  const int fd = BeginUpload("b.db", bytes.size(), bytes.substr(0, bytes.size() / 2));
  while (Files().size() < 2) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  server_->Signal(SIGKILL);
  server_->Wait();
  close(fd);
  ASSERT_EQ(Files().size(), 2U);
  for (const std::string& name : Files()) {  // as if it had lain there for a while
    if (name != "a.db") {
      fs::last_write_time(fs::path(directory_) / name,
                          fs::file_time_type::clock::now() - std::chrono::minutes(2));
    }
  }
  StartWithBackups();
  EXPECT_THAT(Files(), ElementsAre("a.db"));
}

TEST_F(BackupsTest, UploadsAtOnceAreFew) {
  StartWithBackups();
  const std::string bytes = MakeBackup("a.db");
  const int first = BeginUpload("b.db", bytes.size(), bytes.substr(0, 100));
  const int second = BeginUpload("c.db", bytes.size(), bytes.substr(0, 100));
  while (Files().size() < 3) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  Refused(Put("d.db", bytes), 503, "busy");
  close(first);
  close(second);
  FilesWhenSettled({"a.db"});
  EXPECT_EQ(Put("d.db", bytes)->status, 201);
}

TEST_F(BackupsTest, AreOffWithoutADirectory) {
  Start({"--auto-train", "false"});
  client_ = std::make_unique<httplib::Client>("127.0.0.1", server_->port());
  Refused(client_->Get("/v1/backups/a.db/content"), 409, "backups_off");
  Refused(client_->Delete("/v1/backups/a.db"), 409, "backups_off");
  Refused(Put("a.db", "SQLite format 3"), 409, "backups_off");
}

TEST_F(BackupsTest, AreForAdminsAlone) {
  StartWithBackups();
  const std::string bytes = MakeBackup("a.db");
  const auto made =
      client_->Post("/v1/keys", R"({"name": "root", "scope": "admin"})", "application/json");
  ASSERT_EQ(made->status, 201) << made->body;
  const std::string admin = Json::parse(made->body)["key"];
  client_->set_default_headers({{"Authorization", "Bearer " + admin}});
  const auto write =
      client_->Post("/v1/keys", R"({"name": "shop", "scope": "write"})", "application/json");
  const std::string key = Json::parse(write->body)["key"];
  client_->set_default_headers({{"Authorization", "Bearer " + key}});
  Refused(client_->Get("/v1/backups/a.db/content"), 403, "forbidden");
  Refused(client_->Delete("/v1/backups/a.db"), 403, "forbidden");
  Refused(Put("b.db", bytes), 403, "forbidden");
  client_->set_default_headers({});
  Refused(Put("b.db", bytes), 401, "unauthorized");
  EXPECT_THAT(Files(), ElementsAre("a.db"));
}

}  // namespace
}  // namespace pliant::testing
