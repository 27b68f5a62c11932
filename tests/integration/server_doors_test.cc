// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Pages of other sites, security headers, and what the log says.
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/integration/server_process.h"

namespace pliant::testing {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr const char* kImages = "/v1/collections/default/images";

class DoorsTest : public ::testing::Test {
 protected:
  std::filesystem::path database() const { return folder_.path() / "test.db"; }
  TemporaryFolder folder_;
};

TEST_F(DoorsTest, PagesOfAllowedOriginsMayAsk) {
  const ServerProcess server(database(),
                             {"--cors-origins", "https://shop.example", "--auto-train", "false"});
  auto client = server.Client();
  const httplib::Headers shop = {{"Origin", "https://shop.example"},
                                 {"Sec-Fetch-Site", "cross-site"}};
  const auto preflight = [&](const std::string& origin) {
    httplib::Request request;
    request.method = "OPTIONS";
    request.path = kImages;
    request.headers = {{"Origin", origin}, {"Access-Control-Request-Method", "POST"}};
    return client.send(request);
  };
  const auto allowed = preflight("https://shop.example");
  EXPECT_EQ(allowed->status, 204);
  EXPECT_EQ(allowed->get_header_value("Access-Control-Allow-Origin"), "https://shop.example");
  EXPECT_EQ(allowed->get_header_value("Access-Control-Allow-Methods"), "DELETE, GET, HEAD, POST");
  EXPECT_THAT(allowed->get_header_value("Access-Control-Allow-Headers"),
              HasSubstr("Authorization"));
  EXPECT_EQ(preflight("https://evil.example")->status, 403);
  const auto added = client.Post(kImages, shop, TestImage(1), "image/png");
  EXPECT_EQ(added->status, 201) << added->body;
  EXPECT_EQ(added->get_header_value("Access-Control-Allow-Origin"), "https://shop.example");
  std::vector<std::string> varies;
  const auto [first, last] = added->headers.equal_range("Vary");
  for (auto header = first; header != last; ++header) varies.push_back(header->second);
  EXPECT_THAT(varies, Contains("Origin"));
  const auto other = client.Get(kImages, {{"Origin", "https://evil.example"}});
  EXPECT_FALSE(other->has_header("Access-Control-Allow-Origin"));
}

TEST_F(DoorsTest, NamesThatTheOperatorAllowsAreTaken) {
  const ServerProcess server(
      database(), {"--allowed-hosts", "images.example,other.example", "--auto-train", "false"});
  auto client = server.Client();
  const auto add = [&](const std::string& name) {
    const httplib::Headers headers = {{"Host", name}, {"Origin", "https://" + name}};
    return client.Put(std::string(kImages) + "/one", headers, TestImage(1), "image/png")->status;
  };
  EXPECT_EQ(add("images.example"), 201);
  EXPECT_EQ(add("other.example:8443"), 200);
  EXPECT_EQ(add("evil.example"), 421);
}

TEST_F(DoorsTest, CorsIsOffUnlessToldAndHeadersAreSafe) {
  const ServerProcess server(database());
  auto client = server.Client();
  const auto answer = client.Get(kImages, {{"Origin", "https://shop.example"}});
  EXPECT_FALSE(answer->has_header("Access-Control-Allow-Origin"));
  EXPECT_EQ(answer->get_header_value("Cross-Origin-Resource-Policy"), "same-origin");
  for (const char* path : {"/", "/livez", kImages, "/nothing"}) {
    const auto each = client.Get(path);
    EXPECT_EQ(each->get_header_value("X-Content-Type-Options"), "nosniff") << path;
    EXPECT_EQ(each->get_header_value("Referrer-Policy"), "no-referrer") << path;
    EXPECT_THAT(each->get_header_value("Content-Security-Policy"), HasSubstr("default-src 'none'"))
        << path;
    EXPECT_FALSE(each->has_header("Strict-Transport-Security")) << path;
  }
}

TEST_F(DoorsTest, TheLogCanBeReadByPrograms) {
  ServerProcess server(database(), {"--log-format", "json"});
  auto client = server.Client();
  client.Get("/v1/collections/default/images?object=secret", {{"X-Request-Id", "mine"}});
  client.Get("/v1/%22quoted%22");
  EXPECT_EQ(server.Stop(), 0);
  std::istringstream log(server.Log());
  bool seen = false;
  int lines = 0;
  for (std::string line; std::getline(log, line); ++lines) {
    const Json json = Json::parse(line, nullptr, false);
    ASSERT_TRUE(json.is_object()) << line;
    EXPECT_TRUE(json.contains("time")) << line;
    EXPECT_TRUE(json.contains("level")) << line;
    if (json.value("request_id", "") != "mine") continue;
    seen = true;
    EXPECT_EQ(json["event"], "request");
    EXPECT_EQ(json["route"], "images.list");
    EXPECT_EQ(json["status"], 200);
    EXPECT_THAT(line, Not(HasSubstr("secret")));
  }
  EXPECT_TRUE(seen);
  EXPECT_GT(lines, 2);
}

}  // namespace
}  // namespace pliant::testing
