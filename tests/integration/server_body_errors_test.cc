// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Bodies and parameters that are wrong: the status, the code and the named parameter are contracts,
// and the server goes on working.
#include <random>

#include <gmock/gmock.h>

#include "tests/integration/server_errors_fixture.h"

namespace pliant::testing {
namespace {

TEST_F(ServerErrorsTest, BodiesOfUploads) {
  const std::string images = kImages;
  const std::string form = "multipart/form-data; boundary=B";
  const auto field = [](const std::string& name, const std::string& value) {
    return "--B\r\nContent-Disposition: form-data; name=\"" + name + "\"\r\n\r\n" + value + "\r\n";
  };
  const std::string& p = image_;
  const std::string deep = std::string(100, '[') + std::string(100, ']');
  ExpectProblems({
      {"POST", images, "", "", 400, "missing_parameter", "image"},
      {"POST", images, p, "text/plain", 415, "unsupported_content_type"},
      {"POST", images, "no image", "", 415, "unsupported_content_type"},
      {"POST", images, "id=one", "application/x-www-form-urlencoded", 415,
       "unsupported_content_type"},
      {"POST", images, "{}", kJson, 400, "missing_parameter", "image"},
      {"POST", images, R"({"image": "?"})", kJson, 400, "invalid_parameter", "image"},
      {"POST", kVocabularies, p, kPng, 415, "unsupported_content_type"},
      {"POST", images, "hello", kPng, 415, "image_type_unknown"},
      {"POST", images, p.substr(0, p.size() / 2), kPng, 422, "image_truncated"},
      {"POST", images, TestImage(1, 0, 12, 12), kPng, 422, "image_too_small"},
      {"POST", images, TestImage(1, 0, 2000, 1500), kPng, 413, "image_too_large"},
      {"POST", images, std::string(1'200'000, 'x'), kPng, 413, "body_too_large"},
      {"POST", images, field("object", "x") + "--B--\r\n", form, 400, "missing_parameter", "image"},
      {"POST", images, field("image", p) + field("image", p) + "--B--\r\n", form, 400,
       "duplicate_parameter", "image"},
      {"POST", images, field("image", p) + field("objekt", "x") + "--B--\r\n", form, 400,
       "unknown_parameter", "objekt"},
      {"POST", images, field("image", p) + field("metadata", "{") + "--B--\r\n", form, 400,
       "invalid_json", "metadata"},
      {"POST", images, field("image", p) + field("metadata", "[1]") + "--B--\r\n", form, 400,
       "invalid_json", "metadata"},
      {"POST", images, field("image", p) + field("metadata", "{\"a\":" + deep + "}") + "--B--\r\n",
       form, 400, "invalid_json", "metadata"},
      {"POST", images, field("image", p) + field("object", std::string(70'000, 'x')) + "--B--\r\n",
       form, 413, "body_too_large", "object"},
      {"POST", images, field("image", p), form, 400, "bad_request"},
      {"POST", images, "nothing like a form", form, 400, "bad_request"},
      {"POST", images, field("image", p) + "--B--\r\n", "multipart/form-data", 400, "bad_request"},
      {"POST", images + "?object=a&object=b", p, kPng, 400, "duplicate_parameter", "object"},
      {"POST", images + "?object=a&object=a", p, kPng, 400, "duplicate_parameter", "object"},
      {"POST", images + "?=a", p, kPng, 400, "unknown_parameter"},
      {"POST", images + "?object=caf%e9", p, kPng, 400, "invalid_parameter", "object"},
      {"POST", images + "?caf%e9=x", p, kPng, 400, "unknown_parameter", "caf\\xe9"},
      {"POST", images + "?object=" + std::string(5000, 'x'), p, kPng, 400, "invalid_parameter",
       "object"},
      {"POST", images, field("image", p) + field("object", "caf\xe9") + "--B--\r\n", form, 400,
       "invalid_parameter", "object"},
      {"POST", images, field("image", p) + field("object", std::string(5000, 'x')) + "--B--\r\n",
       form, 400, "invalid_parameter", "object"},
  });
}

TEST_F(ServerErrorsTest, Parameters) {
  const std::string images = kImages;
  const std::string search = kSearch;
  const std::string& p = image_;
  ExpectProblems({
      {"GET", images + "?limit=0", "", "", 400, "invalid_parameter", "limit"},
      {"GET", images + "?limit=501", "", "", 400, "invalid_parameter", "limit"},
      {"GET", images + "?limit=1e2", "", "", 400, "invalid_parameter", "limit"},
      {"GET", images + "?limit=", "", "", 400, "invalid_parameter", "limit"},
      {"GET", images + "?cursor=x", "", "", 400, "invalid_cursor", "cursor"},
      {"GET", images + "?cursor=%ff", "", "", 400, "invalid_parameter", "cursor"},
      {"GET", images + "?page=2", "", "", 400, "unknown_parameter", "page"},
      {"GET", images + "/one?x=1", "", "", 400, "unknown_parameter", "x"},
      {"POST", search + "?limit=-1", p, kPng, 400, "invalid_parameter", "limit"},
      {"POST", search + "?limit=1001", p, kPng, 400, "invalid_parameter", "limit"},
      {"POST", search + "?offset=-1", p, kPng, 400, "invalid_parameter", "offset"},
      {"POST", search + "?group_by=colour", p, kPng, 400, "invalid_parameter", "group_by"},
      {"POST", search + "?rank=best", p, kPng, 400, "invalid_parameter", "rank"},
      {"POST", search + "?verify=yes", p, kPng, 400, "invalid_parameter", "verify"},
      {"POST", search + "?min_score=1.5", p, kPng, 400, "invalid_parameter", "min_score"},
      {"POST", search + "?min_score=nan", p, kPng, 400, "invalid_parameter", "min_score"},
      {"POST", search + "?region=1,2,3", p, kPng, 400, "invalid_parameter", "region"},
      {"POST", search + "?region=1,2,3,4,5", p, kPng, 400, "invalid_parameter", "region"},
      {"POST", search + "?region=0,0,0,5", p, kPng, 400, "invalid_parameter", "region"},
      {"POST", search + "?region=0,0,inf,5", p, kPng, 400, "invalid_parameter", "region"},
      {"POST", search + "?image_id=one", p, kPng, 400, "invalid_parameter", "image_id"},
      {"POST", search, "", "", 400, "missing_parameter", "image"},
      {"POST", search, "{}", kJson, 400, "missing_parameter", "image"},
      {"POST", search, "{", kJson, 400, "invalid_json", "body"},
      {"POST", search, "[]", kJson, 400, "invalid_json", "body"},
      {"POST", search, R"({"image_id": "one", "limit": 2.5})", kJson, 400, "invalid_parameter",
       "limit"},
      {"POST", search, R"({"image_id": "one", "region": [1, 2, "x", 4]})", kJson, 400,
       "invalid_parameter", "region"},
      {"POST", search, R"({"image_id": "one"})", kJson, 409, "no_vocabulary"},
      {"POST", kVocabularies, R"({"words": 1})", kJson, 400, "invalid_parameter", "words"},
      {"POST", kVocabularies, R"({"words": "many"})", kJson, 400, "invalid_parameter", "words"},
      {"POST", kVocabularies, R"({"activate": 1})", kJson, 400, "invalid_parameter", "activate"},
      {"POST", "/v1/qr", "{}", kJson, 400, "missing_parameter", "text"},
      {"POST", "/v1/qr", R"({"text": ")" + std::string(513, 'x') + "\"}", kJson, 400,
       "invalid_parameter", "text"},
  });
}

TEST_F(ServerErrorsTest, TheLongestTextIsAQrCodeOf97Modules) {
  const auto code =
      server_->Client().Post("/v1/qr", Json{{"text", std::string(512, 'x')}}.dump(), kJson);
  ASSERT_TRUE(code);
  ASSERT_EQ(code->status, 200) << code->body;
  EXPECT_EQ(code->get_header_value("Content-Type"), "image/svg+xml");
  EXPECT_EQ(code->get_header_value("Cache-Control"), "no-store");
  EXPECT_NE(code->body.find("viewBox=\"0 0 97 97\""), std::string::npos) << code->body;
}

TEST_F(ServerErrorsTest, AnImageInAnotherFieldIsToldWhereItBelongs) {
  const auto answer = server_->Client().Post(
      kImages, httplib::MultipartFormDataItems{
                   {"file", std::string(70'000, 'x'), "photo.jpg", "image/jpeg"}});
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->status, 400);
  const std::string detail = Json::parse(answer->body)["detail"];
  EXPECT_NE(detail.find("\"file\""), std::string::npos) << detail;
  EXPECT_NE(detail.find("did you mean the part \"image\"?"), std::string::npos) << detail;
}

TEST_F(ServerErrorsTest, ThousandRandomUploads) {
  constexpr unsigned kSeed = 20260131;
  std::mt19937 random(kSeed);
  const std::vector<std::string> magics = {"",
                                           "\xff\xd8\xff\xe0",
                                           "\x89PNG\r\n\x1a\n",
                                           "BM",
                                           std::string("II*\0", 4),
                                           std::string("MM\0*", 4),
                                           "RIFF\x10\x10\x00\x00WEBPVP8 "};
  auto client = server_->Client();
  for (int i = 0; i < 1000; ++i) {
    std::string bytes = magics[random() % magics.size()];
    const std::size_t size = 1 + random() % 3000;
    while (bytes.size() < size) bytes += static_cast<char>(random());
    const bool as_form = random() % 2 == 0;
    const auto answer =
        as_form
            ? client.Post(kImages,
                          httplib::MultipartFormDataItems{{"image", bytes, "x.png", "image/png"}})
            : client.Post(kImages, bytes, "image/jpeg");
    ASSERT_TRUE(answer) << "seed " << kSeed << " number " << i << "\n" << server_->Log();
    ASSERT_GE(answer->status, 400) << "seed " << kSeed << " number " << i;
    ASSERT_LT(answer->status, 500) << "seed " << kSeed << " number " << i << answer->body;
    ASSERT_FALSE(Json::parse(answer->body)["code"].get<std::string>().empty());
  }
  ExpectAlive();
  EXPECT_EQ(Json::parse(client.Get("/v1/collections/default")->body)["images"], 1);
}

}  // namespace
}  // namespace pliant::testing
