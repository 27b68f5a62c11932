// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Backups that are downloaded and deleted over HTTP.
#include <fstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
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

TEST_F(BackupsTest, ADownloadedOneCanBeRestored) {
  StartWithBackups();
  MakeBackup("a.db", 8);
  const std::string copy = (folder_ / "copy.db").string();
  std::ofstream(copy, std::ios::binary) << client_->Get("/v1/backups/a.db/content")->body;
  const std::string restored = (folder_ / "restored.db").string();
  const ProgramResult done = RunProgram({"db", "restore", copy, "--db", restored});
  EXPECT_EQ(done.status, 0) << done.err;
  const ProgramResult check = RunProgram({"db", "check", "--db", restored});
  EXPECT_EQ(check.status, 0) << check.out << check.err;
  // Its own job was running when the backup was made.
  server_->Stop();
  fs::rename(restored, folder_ / "test.db");
  StartWithBackups();
  EXPECT_EQ(Json::parse(client_->Get("/v1/jobs")->body)["jobs"], Json::array());
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
  EXPECT_EQ(client.Get("/v1/backups/a.db/content")->body, bytes);
}

TEST_F(BackupsTest, AreOffWithoutADirectory) {
  Start({"--auto-train", "false"});
  client_ = std::make_unique<httplib::Client>("127.0.0.1", server_->port());
  Refused(client_->Get("/v1/backups/a.db/content"), 403, "backups_off");
  Refused(client_->Delete("/v1/backups/a.db"), 403, "backups_off");
}

TEST_F(BackupsTest, AreForAdminsAlone) {
  StartWithBackups();
  MakeBackup("a.db");
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
  client_->set_default_headers({});
  Refused(client_->Get("/v1/backups/a.db/content"), 401, "unauthorized");
  EXPECT_THAT(Files(), ElementsAre("a.db"));
}

}  // namespace
}  // namespace pliant::testing
