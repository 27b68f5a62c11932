// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Searches with stored images, several at once, and as base64; answers drawn into the query, and
// with the query beside them.
#include <string>
#include <vector>

#include <gmock/gmock.h>

#include "descriptor/image/image.h"
#include "tests/integration/server_fixture.h"

namespace pliant::testing {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr const char* kBatch = "/v1/collections/default/search:batch";
constexpr const char* kJson = "application/json";

// So many times as large, each pixel repeated.
Image Enlarged(const Image& plain, int times) {
  Image large;
  large.width = plain.width * times;
  large.height = plain.height * times;
  large.channels = plain.channels;
  for (int y = 0; y < large.height; ++y) {
    for (int x = 0; x < large.width; ++x) {
      const std::uint8_t* from =
          plain.pixels.data() +
          (static_cast<std::size_t>(y / times) * plain.width + x / times) * plain.channels;
      large.pixels.insert(large.pixels.end(), from, from + plain.channels);
    }
  }
  return large;
}

class SimilarTest : public ServerTest {
 protected:
  void SetUp() override {
    Start();
    client_ = std::make_unique<httplib::Client>(server_->Client());
    for (std::uint64_t i = 0; i < 4; ++i) {
      for (std::uint64_t view = 0; view < 2; ++view) {
        const auto answer =
            client_->Put(MakeImage(i, view) + "?object=" + (i == 1 ? "Tasse%20%C3%9C" : "o") +
                             (i == 1 ? "" : std::to_string(i)),
                         TestImage(i, view), "image/png");
        ASSERT_TRUE(answer && answer->status == 201) << (answer ? answer->body : "no answer");
      }
    }
    SearchFor(*client_, TestImage(0, 2));  // waits for the vocabulary
  }
  static std::string Id(std::uint64_t i, std::uint64_t view) {
    return "p" + std::to_string(i) + "-" + std::to_string(view);
  }
  static std::string MakeImage(std::uint64_t i, std::uint64_t view) {
    return std::string(kImages) + "/" + Id(i, view);
  }
  Json Found(const Json& body) {
    const auto answer = client_->Post(kSearch, body.dump(), kJson);
    EXPECT_TRUE(answer && answer->status == 200) << (answer ? answer->body : "no answer");
    return answer ? Json::parse(answer->body) : Json::object();
  }
  void Refused(const Json& body, int status, const std::string& code,
               const std::string& parameter) {
    ExpectProblem(client_->Post(kSearch, body.dump(), kJson), status, code, parameter);
  }
  static void ExpectProblem(const httplib::Result& answer, int status, const std::string& code,
                            const std::string& parameter) {
    ASSERT_TRUE(answer);
    EXPECT_EQ(answer->status, status) << answer->body;
    const Json problem = Json::parse(answer->body);
    EXPECT_EQ(problem["code"], code) << answer->body;
    EXPECT_EQ(problem.value("parameter", ""), parameter) << answer->body;
  }

  std::unique_ptr<httplib::Client> client_;
};

TEST_F(SimilarTest, AStoredImageIsLeftOutUnlessAskedFor) {
  const Json others = Found({{"image_id", Id(1, 0)}, {"group_by", "image"}});
  EXPECT_EQ(others["hits"][0]["image_id"], Id(1, 1)) << "the other view";
  EXPECT_THAT(ImageIds(others["hits"]), Not(Contains(Id(1, 0))));
  EXPECT_EQ(others["total"], 7);
  const Json all = Found({{"image_id", Id(1, 0)}, {"group_by", "image"}, {"exclude_self", false}});
  EXPECT_EQ(all["hits"][0]["image_id"], Id(1, 0));
  EXPECT_EQ(all["total"], 8);
  EXPECT_EQ(Found({{"image_id", Id(1, 0)}})["hits"][0]["object"], "Tasse Ü") << "by its other view";
}

TEST_F(SimilarTest, SeveralExamples) {
  const Json found = Found({{"image_ids", {Id(1, 0), Id(2, 0)}}, {"group_by", "image"}});
  EXPECT_THAT(
      (std::vector<std::string>{found["hits"][0]["image_id"], found["hits"][1]["image_id"]}),
      ::testing::UnorderedElementsAre(Id(1, 1), Id(2, 1)));
  EXPECT_TRUE(found["query"].is_null());
  EXPECT_EQ(found["examples"].size(), 2U);
  EXPECT_GE(found["found"], 2);
  for (const Json& hit : found["hits"]) {
    EXPECT_THAT((std::vector<std::string>{Id(1, 0), Id(2, 0)}),
                Contains(hit["example"].get<std::string>()));
  }
  Refused({{"image_ids", Json::array()}}, 400, "invalid_parameter", "image_ids");
  Refused({{"image_ids", {1}}}, 400, "invalid_parameter", "image_ids");
  Refused({{"image_ids", {Id(1, 0), Id(1, 0)}}}, 400, "invalid_parameter", "image_ids");
  Refused({{"image_ids", std::vector<std::string>(17, "x")}}, 400, "invalid_parameter",
          "image_ids");
  Refused({{"image_ids", {Id(1, 0), "none"}}}, 404, "image_not_found", "");
  Refused({{"image_ids", {Id(1, 0)}}, {"image_id", Id(1, 0)}}, 400, "invalid_parameter",
          "image_ids");
  Refused({{"image_ids", {Id(1, 0)}}, {"region", {0, 0, 9, 9}}}, 400, "invalid_parameter",
          "region");
  Refused({{"image_ids", {Id(1, 0)}}, {"draw", true}}, 400, "invalid_parameter", "draw");
  Refused({{"image_ids", {Id(1, 0)}}, {"exclude_self", true}}, 400, "invalid_parameter",
          "exclude_self");
}

TEST_F(SimilarTest, ImagesAsBase64) {
  const std::string image = Base64Of(TestImage(3, 2));
  EXPECT_EQ(Found({{"image", image}})["hits"][0]["object"], "o3");
  EXPECT_EQ(Found({{"image", "data:image/png;base64," + image}})["hits"][0]["object"], "o3");
  Refused({{"image", "*" + image}}, 400, "invalid_parameter", "image");
  Refused({{"image", 7}}, 400, "invalid_parameter", "image");
  Refused({{"image", ""}}, 422, "image_empty", "");
  Refused({{"image", Base64Of("no image")}}, 415, "image_type_unknown", "");
  Refused({{"image", image}, {"image_id", Id(1, 0)}}, 400, "invalid_parameter", "image_id");
  Refused(Json::object(), 400, "missing_parameter", "image");
  // Uploads take it, too.
  const Json body = {
      {"image", Base64Of(TestImage(9))}, {"object", "json"}, {"metadata", {{"year", 2024}}}};
  auto answer = client_->Post(kImages, body.dump(), kJson);
  ASSERT_EQ(answer->status, 201) << answer->body;
  EXPECT_EQ(Json::parse(answer->body)["metadata"], (Json{{"year", 2024}}));
  EXPECT_EQ(client_->Get(answer->get_header_value("Location") + "/content")->body, TestImage(9));
  answer = client_->Put(std::string(kImages) + "/named", body.dump(), kJson);
  EXPECT_EQ(answer->status, 201) << answer->body;
  ExpectProblem(client_->Post(kImages, R"({"object": "x"})", kJson), 400, "missing_parameter",
                "image");
  ExpectProblem(client_->Post(kImages, R"({"image": )", kJson), 400, "invalid_json", "body");
}

TEST_F(SimilarTest, ABatchHasAResultForEachSearch) {
  const Json batch = {
      {"searches",
       {{{"image_id", Id(1, 0)}, {"limit", 1}},
        {{"image", Base64Of(TestImage(2, 2))}, {"filter", {{"n", {{"exists", false}}}}}},
        {{"image_id", "none"}},
        {{"image_id", Id(1, 0)}, {"limit", "many"}},
        {{"image_id", Id(1, 0)}, {"draw", true}},
        7,
        {{"image_ids", {Id(3, 0)}}, {"group_by", "image"}, {"limit", 2}}}}};
  const auto answer = client_->Post(kBatch, batch.dump(), kJson);
  ASSERT_EQ(answer->status, 207) << answer->body;
  const Json results = Json::parse(answer->body)["results"];
  EXPECT_EQ(Json::parse(answer->body)["failed"], 4);
  ASSERT_EQ(results.size(), 7U);
  EXPECT_EQ(results[0]["answer"]["hits"].size(), 1U);
  EXPECT_EQ(results[0]["answer"]["hits"][0]["object"], "Tasse Ü");
  EXPECT_EQ(results[1]["answer"]["hits"][0]["object"], "o2");
  EXPECT_EQ(results[2]["status"], 404);
  EXPECT_EQ(results[2]["problem"]["code"], "image_not_found");
  EXPECT_EQ(results[3]["problem"]["parameter"], "limit");
  EXPECT_EQ(results[4]["problem"]["code"], "unknown_parameter");
  EXPECT_EQ(results[5]["status"], 400);
  EXPECT_EQ(results[6]["answer"]["hits"][0]["image_id"], Id(3, 1));
  for (std::size_t i = 0; i < results.size(); ++i) EXPECT_EQ(results[i]["index"], i);
  const auto refused = [&](const Json& body, const std::string& code) {
    ExpectProblem(client_->Post(kBatch, body.dump(), kJson), 400, code, "searches");
  };
  refused(Json::object(), "missing_parameter");
  refused({{"searches", Json::array()}}, "invalid_parameter");
  refused({{"searches", std::vector<Json>(101, Json::object())}}, "invalid_parameter");
  EXPECT_EQ(client_->Post("/v1/collections/none/search:batch", batch.dump(), kJson)->status, 404);
}

TEST_F(SimilarTest, TheAnswerIsDrawnIntoTheQuery) {
  const std::string query = TestImage(1, 2);
  const auto decoded = [](const std::string& body) {
    DecodeOptions options;
    options.max_side_px = 0;
    options.colour = true;
    return DecodeImage({reinterpret_cast<const std::uint8_t*>(body.data()), body.size()}, options);
  };
  const Image plain = decoded(query).image;
  auto answer = client_->Post(std::string(kSearch) + "?draw=true", query, "image/png");
  ASSERT_EQ(answer->status, 200) << answer->body;
  EXPECT_EQ(answer->get_header_value("Content-Type"), "image/jpeg");
  EXPECT_EQ(decoded(answer->body).format, ImageFormat::kJpeg);
  answer = client_->Post(std::string(kSearch) + "?draw=true", {{"Accept", "image/png"}}, query,
                         "image/png");
  EXPECT_EQ(answer->get_header_value("Content-Type"), "image/png");
  const Image drawn = decoded(answer->body).image;
  ASSERT_EQ(drawn.width, plain.width);
  std::size_t different = 0;
  std::size_t coloured = 0;
  for (std::size_t i = 0; i < drawn.pixels.size(); i += 3) {
    if (drawn.pixels[i] != plain.pixels[i]) ++different;
    if (drawn.pixels[i] != drawn.pixels[i + 1] || drawn.pixels[i] != drawn.pixels[i + 2]) {
      ++coloured;
    }
  }
  EXPECT_GT(coloured, 500U) << "an outline and a name";
  EXPECT_LT(different, drawn.pixels.size() / 6) << "the image is still there";
  // Of a stored image, and where nothing is found.
  const Json stored = {{"image_id", Id(2, 0)}, {"draw", true}};
  EXPECT_EQ(client_->Post(kSearch, stored.dump(), kJson)->get_header_value("Content-Type"),
            "image/jpeg");
  EXPECT_EQ(client_->Post(std::string(kSearch) + "?draw=true", TestImage(77), "image/png")->status,
            200);
  ExpectProblem(client_->Post(std::string(kSearch) + "?draw=maybe", query, "image/png"), 400,
                "invalid_parameter", "draw");
}

TEST_F(SimilarTest, TheQueryComesBackToBeShown) {
  // Of an image that is larger than a preview.
  DecodeOptions options;
  options.max_side_px = 0;
  options.colour = true;
  const std::string query = TestImage(1, 2);
  const Image plain =
      DecodeImage({reinterpret_cast<const std::uint8_t*>(query.data()), query.size()}, options)
          .image;
  const Image large = Enlarged(plain, 5);
  const std::vector<std::uint8_t> png = EncodePng(large);
  const std::string sent(png.begin(), png.end());
  const auto preview_of = [&](const Json& answer) {
    const std::string prefix = "data:image/jpeg;base64,";
    const std::string url = answer["query"].value("preview", "");
    EXPECT_EQ(url.substr(0, prefix.size()), prefix);
    const std::string bytes = BytesOfBase64(url.substr(std::min(url.size(), prefix.size())));
    DecodedImage decoded =
        DecodeImage({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()}, options);
    EXPECT_EQ(decoded.format, ImageFormat::kJpeg);
    return std::move(decoded.image);
  };
  const Json answer = SearchFor(*client_, sent, "?preview=true&limit=1");
  EXPECT_EQ(answer["query"]["width"], large.width);
  const Image preview = preview_of(answer);
  EXPECT_EQ(std::max(preview.width, preview.height), 1280);
  EXPECT_NEAR(preview.height, 1280.0 * large.height / large.width, 1);
  double difference = 0;
  for (int y = 0; y < preview.height; y += 7) {
    for (int x = 0; x < preview.width; x += 7) {
      const int u = std::min(plain.width - 1, x * plain.width / preview.width);
      const int v = std::min(plain.height - 1, y * plain.height / preview.height);
      difference += std::abs(preview.pixels[(static_cast<std::size_t>(y) * preview.width + x) * 3] -
                             plain.pixels[(static_cast<std::size_t>(v) * plain.width + u) * 3]);
    }
  }
  EXPECT_LT(difference / (preview.width / 7 * (preview.height / 7)), 12) << "the same image";
  // Of a stored one, and where it is not asked for, or there is none.
  EXPECT_EQ(preview_of(Found({{"image_id", Id(2, 0)}, {"preview", true}})).width, plain.width);
  EXPECT_FALSE(Found({{"image_id", Id(2, 0)}})["query"].contains("preview"));
  Refused({{"image_ids", {Id(1, 0)}}, {"preview", true}}, 400, "invalid_parameter", "preview");
  Refused({{"image_id", Id(1, 0)}, {"preview", true}, {"draw", true}}, 400, "invalid_parameter",
          "preview");
  Refused({{"image_id", Id(1, 0)}, {"preview", "yes"}}, 400, "invalid_parameter", "preview");
}

}  // namespace
}  // namespace pliant::testing
