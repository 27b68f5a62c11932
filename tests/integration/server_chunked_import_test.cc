// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Imports whose length nobody knows before their end: bodies in chunks (RFC 9112, section 7.1).
#include <csignal>

#include <gmock/gmock.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include "tests/integration/large_import_fixture.h"

namespace pliant::testing {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

class ChunkedImportTest : public LargeImportTest {
 protected:
  static std::string Head(const std::string& more = "") {
    return "POST " + std::string(kImport) +
           " HTTP/1.1\r\nHost: localhost\r\nContent-Type: " + kTar +
           "\r\nTransfer-Encoding: chunked\r\n" + more + "\r\n";
  }
  static std::string Chunk(const std::string& content, const std::string& extension = "") {
    char size[20];
    std::snprintf(size, sizeof size, "%zx", content.size());
    return size + extension + "\r\n" + content + "\r\n";
  }
  static std::string Chunks(const std::string& content, std::size_t each) {
    std::string body;
    for (std::size_t at = 0; at < content.size(); at += each) {
      body += Chunk(content.substr(at, each));
    }
    return body;
  }
  // Sends as long as the server takes it, and gives what the server says.
  std::string Say(const std::string& bytes) {
    const int fd = server_->Open("");
    std::string answer;
    std::thread reader([&] {
      char buffer[4096];
      while (true) {
        const ssize_t got = ::recv(fd, buffer, sizeof buffer, 0);
        if (got <= 0) return;
        answer.append(buffer, static_cast<std::size_t>(got));
      }
    });
    std::size_t sent = 0;
    while (sent < bytes.size()) {
      const ssize_t n = ::send(fd, bytes.data() + sent, bytes.size() - sent, MSG_NOSIGNAL);
      if (n <= 0) break;
      sent += static_cast<std::size_t>(n);
    }
    ::shutdown(fd, SHUT_WR);
    reader.join();
    ::close(fd);
    return answer;
  }
  void ExpectRefused(const std::string& answer, int status, const std::string& code) {
    EXPECT_THAT(answer, StartsWith("HTTP/1.1 " + std::to_string(status)));
    EXPECT_THAT(answer, HasSubstr("\"code\":\"" + code + "\""));
    ExpectNoFiles();
  }
};

TEST_F(ChunkedImportTest, ManyMegabytesInChunksOfAnySize) {
  StartSmall({"--max-import-mb", "8"});
  std::uint64_t first = 1;
  for (const std::size_t each : {kMiB, std::size_t{1} << 16, std::size_t{1000}}) {
    const std::string archive = Archive(first, 3, 3 * kMiB);
    const std::string next = "GET /livez HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n";
    const std::string answer = Say(Head() + Chunks(archive, each) + "0\r\n\r\n" + next);
    ASSERT_THAT(answer, StartsWith("HTTP/1.1 202"));
    const std::size_t second = answer.find("HTTP/1.1 200", 10);
    EXPECT_NE(second, std::string::npos) << "what follows the body is the next request: " << answer;
    const std::size_t location = answer.find("Location: ") + 10;
    const Json job = Finished(answer.substr(location, answer.find('\r', location) - location));
    EXPECT_EQ(job["state"], "done") << job;
    EXPECT_EQ(job["total"], 3);
    EXPECT_EQ(job["failed"], 0);
    first += 3;
  }
  EXPECT_EQ(Images(), 9);
  ExpectNoFiles();
}

TEST_F(ChunkedImportTest, SmallOnesAndLinesAsBefore) {
  StartSmall();
  std::string line = Json{{"image", Base64Of(TestImage(1))}, {"object", "line"}}.dump();
  const auto answer = client_->Post(
      kImport,
      [&](std::size_t, httplib::DataSink& sink) {
        sink.write(line.data(), line.size());
        sink.done();
        return true;
      },
      kLines);
  EXPECT_EQ(Finished(answer)["failed"], 0);
  EXPECT_EQ(Images(), 1);
  ExpectRefused(Say(Head() + "0\r\n\r\n"), 400, "missing_parameter");
}

TEST_F(ChunkedImportTest, TooMuchIsSaidWhenItComes) {
  StartSmall({"--max-import-mb", "3"});
  const std::string archive = Archive(1, 2, 6 * kMiB);
  ExpectRefused(Say(Head() + Chunks(archive, 65536)), 413, "body_too_large");
  ExpectRefused(Say(Head() + Chunks(archive, archive.size())), 413, "body_too_large");
  ExpectRefused(Say(Head() + "ffffffffffffffff\r\nx"), 413, "body_too_large");
  ExpectRefused(Say(Head() + "3fffffffffff\r\n" + archive), 413, "body_too_large");
  // So it is for framing without end.
  std::string framing;
  while (framing.size() < 4 * kMiB) framing += Chunk("x", ";" + std::string(900, 'e'));
  ExpectRefused(Say(Head() + framing), 413, "body_too_large");
  // Other routes have the limit that they had.
  const std::string put = "POST " + std::string(kImages) +
                          " HTTP/1.1\r\nHost: localhost\r\nContent-Type: image/png\r\n"
                          "Transfer-Encoding: chunked\r\n\r\n";
  EXPECT_THAT(Say(put + Chunks(archive.substr(0, 2 * kMiB), 65536)), StartsWith("HTTP/1.1 413"));
  EXPECT_EQ(Images(), 0);
}

TEST_F(ChunkedImportTest, WhatIsBrokenLeavesNothing) {
  StartSmall();
  const std::string archive = Archive(1, 2, 2 * kMiB);
  const std::string good = Chunks(archive, 65536);
  for (const std::string wrong :
       {"0x1\r\nx\r\n", "-1\r\n", " 1\r\nx\r\n", "1\nx\r\n", "1\r\nxy\r\n", "\r\n",
        "1;\x01\r\nx\r\n", "0\r\nTrailer: x\r\n\r\n"}) {
    ExpectRefused(Say(Head() + good + wrong), 400, "bad_request");
  }
  ExpectRefused(Say(Head("Content-Length: 5\r\n") + good + "0\r\n\r\n"), 400, "bad_request");
  ExpectRefused(Say(Head("Transfer-Encoding: chunked\r\n") + good), 400, "bad_request");
  std::string gzip = Head() + good;
  gzip.replace(gzip.find("chunked"), 7, "gzip, chunked");
  EXPECT_THAT(Say(gzip), HasSubstr("\"code\":\"unsupported_transfer_encoding\""));
  // Whole for HTTP, but its archive is not.
  ExpectRefused(Say(Head() + Chunks(archive.substr(0, archive.size() - 5000), 65536) + "0\r\n\r\n"),
                400, "bad_request");
  ExpectNoFiles();
  EXPECT_EQ(Json::parse(client_->Get("/v1/jobs")->body)["jobs"].size(), 0U);
}

TEST_F(ChunkedImportTest, WhoGoesBeforeTheEndLeavesNothing) {
  StartSmall();
  const std::string archive = Archive(1, 2, 2 * kMiB);
  const int fd = server_->Open(Head() + Chunks(archive, 65536));
  ASSERT_GE(fd, 0);
  for (int i = 0; i < 200 && Files().empty(); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  EXPECT_EQ(Files().size(), 1U) << "all but the end is there";
  ::close(fd);
  ExpectNoFiles();
  EXPECT_EQ(Json::parse(client_->Get("/v1/jobs")->body)["jobs"].size(), 0U);
}

TEST_F(ChunkedImportTest, SlowOnesAreCutOff) {
  StartSmall({"--body-timeout", "1"});
  const auto begun = std::chrono::steady_clock::now();
  const std::string answer =
      server_->Talk(Head() + "fffff\r\n", std::chrono::milliseconds(10'000), /*drip=*/true);
  EXPECT_LT(std::chrono::steady_clock::now() - begun, std::chrono::seconds(8));
  EXPECT_THAT(answer, StartsWith("HTTP/1.1 408"));
  ExpectNoFiles();
}

TEST_F(ChunkedImportTest, AFullDiskIsSaid) {
  StartSmall();
  const std::string archive = Archive(1, 2, 6 * kMiB);
  server_->LimitFiles(3 * kMiB);
  ExpectRefused(Say(Head() + Chunks(archive, 65536)), 507, "no_space");
  server_->LimitFiles(RLIM_INFINITY);
  const std::string answer = Say(Head() + Chunks(archive, 65536) + "0\r\n\r\n");
  EXPECT_THAT(answer, StartsWith("HTTP/1.1 202"));
}

}  // namespace
}  // namespace pliant::testing
