// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Images by their addresses on the web (image_url), wherever an image is taken in JSON.
#include <chrono>
#include <csignal>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/integration/fetch_fixture.h"

namespace pliant::testing {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

TEST_F(FetchTest, IsOffUnlessTheOperatorSaysOtherwise) {
  Start();
  client_ = std::make_unique<httplib::Client>("127.0.0.1", server_->port());
  EXPECT_EQ(Json::parse(client_->Get("/v1/me")->body)["image_url"], false);
  EXPECT_EQ(Json::parse(client_->Get("/v1/me")->body)["backups"], false);
  const Json body = {{"image_url", other_.url("/1.png")}};
  Refused(kImages, body, 403, "fetch_off", "image_url", "--fetch-hosts");
  Refused(kSearch, body, 403, "fetch_off", "image_url");
  const Json batch = Ask("/v1/collections/default/search:batch", {{"searches", {body}}}, 207);
  EXPECT_EQ(batch["results"][0]["problem"]["code"], "fetch_off");
  const Json items = Items(body.dump());
  EXPECT_EQ(items[0]["problem"]["code"], "fetch_off");
  EXPECT_EQ(other_.connections(), 0);
}

TEST_F(FetchTest, ImagesAreFetchedWhereverJsonTakesThem) {
  StartFetching();
  EXPECT_EQ(Json::parse(client_->Get("/v1/me")->body)["image_url"], true);
  const Json added =
      Ask(kImages,
          {{"image_url", other_.url("/1.png?token=secret")}, {"object", "one"}, {"image", nullptr}},
          201);
  EXPECT_EQ(added["source"], other_.url("/1.png"));
  EXPECT_EQ(added["object"], "one");
  EXPECT_EQ(added["media_type"], "image/png");
  EXPECT_EQ(
      client_->Get(std::string(kImages) + "/" + added["id"].get<std::string>() + "/content")->body,
      TestImage(1));
  const auto put =
      client_->Put(std::string(kImages) + "/two",
                   Json{{"image_url", other_.url("/2.png")}, {"object", "two"}}.dump(), kJson);
  EXPECT_EQ(put->status, 201) << put->body;
  EXPECT_EQ(Ask(kImages, {{"image_url", other_.url("/moved.png")}, {"object", "one"}}, 200)["id"],
            added["id"])
      << "the same bytes, redirected";
  for (int i = 3; i < 8; ++i) Upload(*client_, TestImage(static_cast<std::uint64_t>(i)), "more");
  const Json query = {{"image_url", other_.url("/1view.png")}, {"limit", 1}};
  EXPECT_EQ(Ask(kSearch, query, 200)["hits"][0]["object"], "one");
  EXPECT_EQ(Ask("/v1/collections/default/objects/one/locate",
                {{"image_url", other_.url("/1view.png")}}, 200)["found"],
            true);
  const Json batch = Ask("/v1/collections/default/search:batch",
                         {{"searches", {query, {{"image_url", other_.url("/gone.png")}}}}}, 207);
  EXPECT_EQ(batch["results"][0]["answer"]["hits"][0]["object"], "one");
  EXPECT_EQ(batch["results"][1]["status"], 422);
  EXPECT_EQ(batch["results"][1]["problem"]["code"], "fetch_failed");
  EXPECT_THAT(server_->Log(), Not(HasSubstr("secret")));
}

TEST_F(FetchTest, PreviewsAreMadeAnewAndStoreNothing) {
  StartFetching();
  const auto preview =
      client_->Post("/v1/preview", Json{{"image_url", other_.url("/1.png")}}.dump(), kJson);
  ASSERT_EQ(preview->status, 200) << preview->body;
  EXPECT_EQ(preview->get_header_value("Content-Type"), "image/jpeg");
  EXPECT_EQ(preview->body.substr(0, 3), "\xFF\xD8\xFF");
  EXPECT_EQ(preview->get_header_value("Cache-Control"), "no-store");
  const auto sent = client_->Post("/v1/preview", TestImage(1), "image/png");
  EXPECT_EQ(sent->body, preview->body);
  Refused("/v1/preview", {{"image_url", "http://evil.test/"}}, 422, "fetch_host_not_allowed",
          "image_url");
  Refused("/v1/preview", {{"image_url", other_.url("/page.html")}}, 415, "image_type_unknown", "");
  Refused("/v1/preview", Json::object(), 400, "missing_parameter", "image");
  EXPECT_EQ(client_->Post("/v1/preview", TestImage(1).substr(0, 500), "image/png")->status, 422);
  EXPECT_EQ(Json::parse(client_->Get("/v1/collections/default")->body)["images"], 0);
}

TEST_F(FetchTest, ImportsFetchEachLine) {
  StartFetching();
  const auto line = [](const Json& json) { return json.dump() + "\n"; };
  const Json items =
      Items(line({{"image_url", other_.url("/11.png")}, {"object", "eleven"}}) +
            line({{"image_url", other_.url("/12.png")}, {"source", "shelf 12"}, {"id", "twelve"}}) +
            line({{"image_url", other_.url("/gone.png")}}) +
            line({{"image_url", "http://evil.test/"}}) + line({{"image_url", 7}}) +
            line({{"image_url", other_.url("/1.png")}, {"image", Base64Of("x")}}) +
            line({{"object", "none"}}) + line({{"image", Base64Of(TestImage(13))}}));
  ASSERT_EQ(items.size(), 8U);
  EXPECT_EQ(items[0]["status"], 201) << items[0];
  EXPECT_EQ(items[1]["image_id"], "twelve") << items[1];
  EXPECT_EQ(items[2]["problem"]["code"], "fetch_failed");
  EXPECT_EQ(items[3]["problem"]["code"], "fetch_host_not_allowed");
  EXPECT_EQ(items[4]["problem"]["code"], "invalid_parameter");
  EXPECT_EQ(items[5]["problem"]["parameter"], "image_url");
  EXPECT_EQ(items[6]["problem"]["code"], "missing_parameter");
  EXPECT_EQ(items[7]["status"], 201);
  const auto record = [&](const std::string& id) {
    return Json::parse(client_->Get(std::string(kImages) + "/" + id)->body);
  };
  EXPECT_EQ(record(items[0]["image_id"])["source"], other_.url("/11.png"));
  EXPECT_EQ(record("twelve")["source"], "shelf 12");
}

TEST_F(FetchTest, RefusesWhatIsWrong) {
  StartFetching({"--fetch-private", "true", "--max-body-mb", "1", "--fetch-timeout", "2"});
  const auto url = [&](const std::string& path) { return Json{{"image_url", other_.url(path)}}; };
  Refused(kImages, url("/gone.png"), 422, "fetch_failed", "image_url", "answered with status 404");
  Refused(kImages, url("/large.png"), 422, "fetch_failed", "image_url", "larger than 1 MiB");
  Refused(kImages, url("/drip.png"), 422, "fetch_failed", "image_url", "longer than 2 s");
  Refused(kImages, url("/away.png"), 422, "fetch_host_not_allowed", "image_url", "redirects");
  Refused(kImages, url("/page.html"), 415, "image_type_unknown", "");
  Refused(kImages, url("/empty.png"), 422, "image_empty", "");
  Refused(kImages, {{"image_url", "http://evil.test/"}}, 422, "fetch_host_not_allowed",
          "image_url");
  for (const Json& wrong : std::vector<Json>{"", "x", "file:///etc/passwd", 7, true, Json::array(),
                                             "http://u@" + other_.host() + "/"}) {
    Refused(kImages, {{"image_url", wrong}}, 400, "invalid_parameter", "image_url");
  }
  Json both = url("/1.png");
  both["image"] = Base64Of(TestImage(1));
  Refused(kImages, both, 400, "invalid_parameter", "image_url", "cannot be combined");
  Json stored = url("/1.png");
  stored["image_id"] = "x";
  Refused(kSearch, stored, 400, "invalid_parameter", "image_id", "cannot be combined");
  Refused(kImages, {{"image_url", nullptr}}, 400, "missing_parameter", "image");
  const auto query = client_->Post(std::string(kImages) + "?image_url=http://a/", "{}", kJson);
  EXPECT_EQ(query->status, 400) << "it stands in the body alone";
  EXPECT_EQ(Json::parse(client_->Get("/v1/collections/default")->body)["images"], 0);
}

TEST_F(FetchTest, PrivateAddressesAreRefusedByDefault) {
  StartFetching({});
  Refused(kImages, {{"image_url", other_.url("/1.png")}}, 422, "fetch_host_not_allowed",
          "image_url", "no public address");
  EXPECT_EQ(other_.connections(), 0);
}

// A host that never answers holds neither the others nor the server's end.
TEST_F(FetchTest, AFetchHoldsNobodyElse) {
  StartFetching({"--fetch-private", "true", "--fetch-timeout", "60", "--http-threads", "8"});
  std::vector<std::thread> fetching;
  std::atomic<int> busy{0};
  std::atomic<int> stopped{0};
  for (int i = 0; i < 6; ++i) {
    fetching.emplace_back([&] {
      httplib::Client client("127.0.0.1", server_->port());
      client.set_read_timeout(60);
      const auto answer =
          client.Post(kSearch, Json{{"image_url", other_.url("/silent")}}.dump(), kJson);
      const std::string code = answer ? Json::parse(answer->body).value("code", "") : "";
      if (code == "busy") ++busy;
      if (code == "stopping") ++stopped;
    });
  }
  while (busy < 4) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  EXPECT_EQ(Upload(*client_, TestImage(1), "one")->status, 201);
  const auto begin = std::chrono::steady_clock::now();
  EXPECT_EQ(server_->Stop(), 0);
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(20));
  for (std::thread& thread : fetching) thread.join();
  EXPECT_EQ(busy, 4) << "a quarter of the threads may fetch";
  EXPECT_EQ(stopped, 2);
}

}  // namespace
}  // namespace pliant::testing
