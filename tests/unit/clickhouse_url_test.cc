// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// How a cluster is named, and how ClickHouse refuses.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "index/store/clickhouse/database_url.h"
#include "index/store/clickhouse/server_error.h"

namespace pliant::clickhouse {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

std::string Refusal(const std::string& text) {
  try {
    ParseDatabaseUrl(text);
  } catch (const Error& error) {
    EXPECT_EQ(error.reason(), "database_url_invalid");
    return error.what();
  }
  return "";
}

TEST(ClickhouseUrl, AllOfIt) {
  const DatabaseUrl url = ParseDatabaseUrl(
      "clickhouses://me@one:9,[::1]/pliant?keeper=zk1,zk2:2182&cluster=big&ca=/etc/ca.pem");
  EXPECT_TRUE(url.tls);
  EXPECT_EQ(url.user, "me");
  EXPECT_EQ(url.hosts, (std::vector<HostPort>{{"one", 9}, {"::1", 8443}}));
  EXPECT_EQ(url.keepers, (std::vector<HostPort>{{"zk1", 2181}, {"zk2", 2182}}));
  EXPECT_EQ(url.database + " " + url.cluster + " " + url.ca_file, "pliant big /etc/ca.pem");
  EXPECT_EQ(ParseDatabaseUrl(url.Text()), url);
}

TEST(ClickhouseUrl, RefusalsNameWhatIsWrong) {
  EXPECT_EQ(Refusal("clickhouse://h/pliant"), "");
  EXPECT_THAT(Refusal("my.db"), HasSubstr("does not begin"));
  EXPECT_THAT(Refusal("clickhouse:///pliant"), HasSubstr("names no host"));
  EXPECT_THAT(Refusal("clickhouse://h"), HasSubstr("names no database"));
  EXPECT_THAT(Refusal("clickhouse://h/"), HasSubstr("names no database"));
  EXPECT_THAT(Refusal("clickhouse://h:0/p"), HasSubstr("\"h\" a port that is not"));
  EXPECT_THAT(Refusal("clickhouse://h:65536/p"), HasSubstr("not 1 to 65535"));
  EXPECT_THAT(Refusal("clickhouse://h,,i/p"), HasSubstr("empty host"));
  EXPECT_THAT(Refusal("clickhouse://h,h/p"), HasSubstr("twice"));
  EXPECT_THAT(Refusal("clickhouse://h/p;drop"), HasSubstr("letters, digits"));
  EXPECT_THAT(Refusal("clickhouse://h/p?kepeer=z"), HasSubstr("kepeer"));
  EXPECT_THAT(Refusal("clickhouse://h/p?keeper="), HasSubstr("without a value"));
  EXPECT_THAT(Refusal("clickhouse://h/p?cluster=a&cluster=b"), HasSubstr("twice"));
  EXPECT_THAT(Refusal("clickhouse://me:secret@h/p"), HasSubstr("PLIANT_DB_PASSWORD"));
  // Also where it has characters of URLs, or @ was forgotten.
  for (const char* url : {"clickhouse://me:secret@h/p", "clickhouse://me:secret/p",
                          "clickhouse://me:a:secret/p", "clickhouse://me:80/a?secret@h/p",
                          "clickhouse://me:80/a?x=secret@h/p", "clickhouse://me:80?secret@h/p",
                          "clickhouse://me:a@secret:b@h/p", "clickhouse://me:#secret@h/p",
                          "clickhouse://me:a/secret@h/p", "clickhouse://h/p?password=secret"}) {
    EXPECT_NE(Refusal(url), "") << url;
    EXPECT_THAT(Refusal(url), Not(HasSubstr("secret"))) << url;
  }
}

TEST(ClickhouseErrors, BothFormsAreUnderstood) {
  const auto old = FindServerError(
      "Code: 60, e.displayText() = DB::Exception: Table p.x doesn't exist., e.what() = "
      "DB::Exception");
  ASSERT_TRUE(old);
  EXPECT_EQ(old->code, 60);
  EXPECT_EQ(old->text, "Table p.x doesn't exist");
  const auto later = FindServerError(
      "bytes before\x01"
      "Code: 279. DB::NetException: All tries failed. (ALL) (version 24.3.1)\n");
  ASSERT_TRUE(later);
  EXPECT_EQ(ToError(*later, "h:1").reason(), "shard_unavailable");
  EXPECT_EQ(ToError(*later, "h:1").code(), ErrorCode::kUnavailable);
  EXPECT_FALSE(FindServerError("Code: of conduct"));
  EXPECT_FALSE(FindServerError(""));
}

// What clients can do nothing about but try again must not look like a defect.
TEST(ClickhouseErrors, AFullDiskAndAReplicaThatStartsOrEnds) {
  const auto of = [](const std::string& text) {
    return ToError(FindServerError("Code: " + text + ", e.what() = DB::Exception").value(), "h:1");
  };
  const Error full =
      of("75, e.displayText() = DB::Exception: Cannot write to file /d/x, errno: 28, strerror: No "
         "space left on device");
  EXPECT_EQ(full.code(), ErrorCode::kNoSpace);
  EXPECT_EQ(full.reason(), "database_full");
  const Error failing =
      of("75, e.displayText() = DB::Exception: Cannot write to file /d/x, errno: 5, strerror: "
         "Input/output error");
  EXPECT_EQ(failing.code(), ErrorCode::kUnavailable);
  const Error starting =
      of("244, e.displayText() = DB::Exception: Unexpected logical error while adding block 56 "
         "with ID 'a': No node, path /clickhouse/replicas/s1r1/is_active");
  EXPECT_EQ(starting.code(), ErrorCode::kUnavailable);
  EXPECT_EQ(starting.reason(), "database_outcome_unknown");
  EXPECT_EQ(of("236, e.displayText() = DB::Exception: Aborted").code(), ErrorCode::kUnavailable);
}

}  // namespace
}  // namespace pliant::clickhouse
