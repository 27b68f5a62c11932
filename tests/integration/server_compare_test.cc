// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Two images compared, whichever way each of them comes: a file, base64, an address on the web.
#include <string>
#include <vector>

#include <gmock/gmock.h>

#include "tests/integration/fetch_fixture.h"

namespace pliant::testing {
namespace {

constexpr const char* kCompare = "/v1/compare";

httplib::MultipartFormData File(const std::string& image) {
  return {"image", image, "a.png", "image/png"};
}

Json Base64Image(const std::string& image) { return {{"image", Base64Of(image)}}; }

class CompareTest : public FetchTest {
 protected:
  httplib::Result Send(const httplib::MultipartFormDataItems& form, const std::string& query = "") {
    return client_->Post(kCompare + query, form);
  }
  void RefusedForm(const httplib::MultipartFormDataItems& form, int status, const std::string& code,
                   const std::string& parameter, const std::string& query = "") {
    const auto answer = Send(form, query);
    ASSERT_TRUE(answer);
    EXPECT_EQ(answer->status, status) << answer->body;
    const Json problem = Json::parse(answer->body);
    EXPECT_EQ(problem["code"], code) << problem;
    EXPECT_EQ(problem.value("parameter", ""), parameter) << problem;
  }
  // All that does not change from one time to the next.
  static Json Lasting(Json answer) {
    answer.erase("took_ms");
    answer.erase("timings");
    return answer;
  }
  Json Compared(const httplib::MultipartFormDataItems& form) {
    const auto answer = Send(form);
    EXPECT_TRUE(answer && answer->status == 200) << (answer ? answer->body : "no answer");
    return answer ? Lasting(Json::parse(answer->body)) : Json::object();
  }
  Json At(const std::string& path) const { return {{"image_url", other_.url(path)}}; }
};

TEST_F(CompareTest, TwoFiles) {
  StartFetching();
  auto answer = Send({File(TestImage(1, 0)), File(TestImage(1, 1))}, "?explain=true");
  ASSERT_EQ(answer->status, 200) << answer->body;
  const Json same = Json::parse(answer->body);
  EXPECT_EQ(same["verdict"], "found");
  EXPECT_GE(same["probability"], 0.99);
  EXPECT_GE(same["polygon"].size(), 3U);
  EXPECT_EQ(same["explain"]["pairs"].size(), same["inliers"]);
  EXPECT_GE(same["matches"], same["inliers"]);
  const Json other = Compared({File(TestImage(1, 0)), File(TestImage(2, 0))});
  EXPECT_EQ(other["verdict"], "not_found");
  EXPECT_LT(other["probability"], 0.5);
  EXPECT_FALSE(other.contains("explain"));
}

// A file, base64 and an address for either of the two: the answer is always the same.
TEST_F(CompareTest, EitherImageComesInAnyWay) {
  StartFetching();
  const std::string first = TestImage(1, 0);
  const std::string second = TestImage(1, 2);
  const Json expected = Compared({File(first), File(second)});
  ASSERT_EQ(expected["verdict"], "found");
  ASSERT_NE(expected["first"], expected["second"]) << "or their order would not be seen";
  const std::vector<Json> firsts = {Base64Image(first),
                                    At("/1.png"),
                                    At("/moved.png"),
                                    {{"image", "data:image/png;base64," + Base64Of(first)}}};
  const std::vector<Json> seconds = {Base64Image(second), At("/1view.png")};
  for (const Json& one : firsts) {
    for (const Json& two : seconds) {
      const Json body = {{"first", one}, {"second", two}};
      EXPECT_EQ(Lasting(Ask(kCompare, body, 200)), expected) << body.dump().substr(0, 100);
    }
    EXPECT_EQ(Compared({{"first", one.dump(), "", ""}, File(second)}), expected);
    EXPECT_EQ(Compared({File(second), {"first", one.dump(), "", "application/json"}}), expected);
  }
  for (const Json& two : seconds) {
    EXPECT_EQ(Compared({File(first), {"second", two.dump(), "", ""}}), expected);
  }
  const Json explained = {{"first", At("/1.png")}, {"second", At("/1view.png")}, {"explain", true}};
  EXPECT_TRUE(Ask(kCompare, explained, 200).contains("explain"));
  const auto query = client_->Post(std::string(kCompare) + "?second=" +
                                       httplib::detail::encode_query_param(At("/1view.png").dump()),
                                   httplib::MultipartFormDataItems{File(first)});
  EXPECT_EQ(Lasting(Json::parse(query->body)), expected) << "in the query, like any parameter";
}

TEST_F(CompareTest, WhatIsNotTwoImagesIsRefused) {
  StartFetching();
  const std::string image = TestImage(1);
  RefusedForm({File(image)}, 400, "missing_parameter", "image");
  RefusedForm({{"explain", "true", "", ""}}, 400, "missing_parameter", "image");
  RefusedForm({{"second", At("/1.png").dump(), "", ""}}, 400, "missing_parameter", "image");
  RefusedForm({File(image), File(image), File(image)}, 400, "duplicate_parameter", "image");
  RefusedForm({File(image), File(image), {"first", At("/1.png").dump(), "", ""}}, 400,
              "duplicate_parameter", "image");
  RefusedForm({File(image),
               {"second", At("/1.png").dump(), "", ""},
               {"second", At("/2.png").dump(), "", ""}},
              400, "duplicate_parameter", "second");
  RefusedForm({File(image), {"second", "{", "", ""}}, 400, "invalid_json", "second");
  RefusedForm({File(image), {"second", "[]", "", ""}}, 400, "invalid_json", "second");
  RefusedForm({File(image), {"second", "\xff", "", ""}}, 400, "invalid_parameter", "second");
  RefusedForm({File(image), {"image_url", other_.url("/1.png"), "", ""}}, 400, "unknown_parameter",
              "image_url");
  RefusedForm({File(image), {"second", std::string(70'000, 'x'), "", ""}}, 413, "body_too_large",
              "second");
  RefusedForm({File(image), File("no image")}, 415, "image_type_unknown", "");
  RefusedForm({File(image), File(image.substr(0, 500))}, 422, "image_truncated", "");
  EXPECT_EQ(client_->Post(kCompare, image, "image/png")->status, 415) << "it is one image";
  EXPECT_EQ(other_.connections(), 0) << "nothing is fetched before all is there";
}

TEST_F(CompareTest, WrongImagesInJsonAreRefusedByTheirName) {
  StartFetching({"--fetch-private", "true", "--max-body-mb", "1"});
  const Json good = Base64Image(TestImage(1));
  const auto refused = [&](const Json& second, int status, const std::string& code,
                           const std::string& words = "") {
    Refused(kCompare, {{"first", good}, {"second", second}}, status, code, "second", words);
  };
  Refused(kCompare, Json::object(), 400, "missing_parameter", "first");
  Refused(kCompare, {{"first", good}}, 400, "missing_parameter", "second");
  Refused(kCompare, {{"first", nullptr}, {"second", good}}, 400, "missing_parameter", "first");
  Refused(kCompare, {{"image", Base64Of("x")}, {"second", good}}, 400, "unknown_parameter",
          "image");
  for (const Json& wrong : std::vector<Json>{7, "text", true, Json::array({good})}) {
    refused(wrong, 400, "invalid_parameter", "must be an object");
  }
  refused(Json::object(), 400, "invalid_parameter", "needs an image");
  refused({{"image", nullptr}}, 400, "invalid_parameter", "needs an image");
  refused({{"image", 7}}, 400, "invalid_parameter", "second.image must be text");
  refused({{"image_url", {"x"}}}, 400, "invalid_parameter", "second.image_url must be text");
  refused({{"image", "*"}}, 400, "invalid_parameter", "base64");
  refused({{"image", Base64Of("x")}, {"image_url", "http://a/"}}, 400, "invalid_parameter",
          "cannot be combined");
  refused({{"image_url", "http://a/"}, {"path", "/etc/passwd"}}, 400, "invalid_parameter",
          "Unknown key \"path\"");
  refused({{"image_url", "file:///etc/passwd"}}, 400, "invalid_parameter", "http");
  EXPECT_EQ(other_.connections(), 0);
  refused(At("/gone.png"), 422, "fetch_failed", "answered with status 404");
  refused(At("/large.png"), 422, "fetch_failed", "larger than");
  refused(At("/away.png"), 422, "fetch_host_not_allowed", "redirects");
  refused({{"image_url", "http://evil.test/"}}, 422, "fetch_host_not_allowed");
  Refused(kCompare, {{"first", good}, {"second", At("/page.html")}}, 415, "image_type_unknown", "");
  Refused(kCompare, {{"first", good}, {"second", At("/broken.png")}}, 422, "image_truncated", "");
  Refused(kCompare, {{"first", good}, {"second", {{"image", ""}}}}, 422, "image_empty", "");
}

TEST_F(CompareTest, NothingIsFetchedUnlessTheOperatorAllowsIt) {
  Start();
  client_ = std::make_unique<httplib::Client>("127.0.0.1", server_->port());
  Refused(kCompare, {{"first", Base64Image(TestImage(1))}, {"second", At("/1.png")}}, 403,
          "fetch_off", "second");
  RefusedForm({File(TestImage(1)), {"second", At("/1.png").dump(), "", ""}}, 403, "fetch_off",
              "second");
  StartFetching({});
  Refused(kCompare, {{"first", At("/1.png")}, {"second", Base64Image(TestImage(1))}}, 422,
          "fetch_host_not_allowed", "first", "no public address");
  EXPECT_EQ(other_.connections(), 0);
}

// Where one image may be on its way, two of one request may be: or none would ever be answered.
TEST_F(CompareTest, BothImagesTakeOnePlace) {
  StartFetching({"--fetch-private", "true", "--http-threads", "4"});
  const Json body = {{"first", At("/1.png")}, {"second", At("/1view.png")}};
  for (int i = 0; i < 3; ++i) EXPECT_EQ(Ask(kCompare, body, 200)["verdict"], "found");
}

}  // namespace
}  // namespace pliant::testing
