// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Everything that can be wrong with a request: the status, the code and the named parameter are
// contracts, and the server goes on working.
#include <random>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/integration/server_process.h"

namespace pliant::testing {
namespace {

constexpr const char* kImages = "/v1/collections/default/images";
constexpr const char* kSearch = "/v1/collections/default/search";
constexpr const char* kVocabularies = "/v1/collections/default/vocabularies";

// Shared by the cases: none of them changes anything.
class ServerErrorsTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TemporaryFolder>();
    server_ = std::make_unique<ServerProcess>(
        folder_->path() / "test.db",
        std::vector<std::string>{"--auto-train", "false", "--max-body-mb", "1", "--header-timeout",
                                 "1", "--body-timeout", "1", "--max-header-kb", "16",
                                 "--max-megapixels", "2"});
    picture_ = TestPicture(1);
    auto client = server_->Client();
    ASSERT_EQ(client.Put(std::string(kImages) + "/one?object=o", picture_, "image/png")->status,
              201);
  }
  static void TearDownTestSuite() {
    server_.reset();
    folder_.reset();
  }

  static void ExpectProblem(const httplib::Response& answer, int status, const std::string& code,
                            const std::string& parameter = "") {
    EXPECT_EQ(answer.status, status) << answer.body;
    EXPECT_EQ(answer.get_header_value("Content-Type"), "application/problem+json");
    const Json problem = Json::parse(answer.body, nullptr, false);
    ASSERT_TRUE(problem.is_object()) << answer.body;
    EXPECT_EQ(problem["status"], status);
    EXPECT_EQ(problem["code"], code) << answer.body;
    EXPECT_EQ(problem.value("parameter", ""), parameter) << answer.body;
    EXPECT_FALSE(problem["title"].get<std::string>().empty());
    EXPECT_FALSE(problem["detail"].get<std::string>().empty());
    EXPECT_EQ(problem["request_id"], answer.get_header_value("X-Request-Id"));
    EXPECT_FALSE(answer.get_header_value("X-Request-Id").empty());
  }

  static void ExpectAlive() {
    auto client = server_->Client();
    const auto answer = client.Put(std::string(kImages) + "/one?object=o", picture_, "image/png");
    ASSERT_TRUE(answer) << server_->Log();
    EXPECT_EQ(answer->status, 200) << answer->body;
  }

  inline static std::unique_ptr<TemporaryFolder> folder_;
  inline static std::unique_ptr<ServerProcess> server_;
  inline static std::string picture_;
};

struct ErrorCase {
  std::string method, path, body, type;
  int status;
  std::string code, parameter = {};
};

TEST_F(ServerErrorsTest, Table) {
  const std::string images = kImages;
  const std::string search = kSearch;
  const std::string png = "image/png";
  const std::string json = "application/json";
  const std::string form = "multipart/form-data; boundary=B";
  const auto field = [](const std::string& name, const std::string& value) {
    return "--B\r\nContent-Disposition: form-data; name=\"" + name + "\"\r\n\r\n" + value + "\r\n";
  };
  const std::string& p = picture_;
  const std::string deep = std::string(100, '[') + std::string(100, ']');
  const std::vector<ErrorCase> cases = {
      // Paths and methods
      {"GET", "/nothing", "", "", 404, "route_not_found"},
      {"GET", "/v1/collections/default/images/", "", "", 404, "route_not_found"},
      {"GET", "/../../etc/passwd", "", "", 404, "route_not_found"},
      {"GET", "/assets/..%2F..%2Fetc%2Fpasswd", "", "", 404, "route_not_found"},
      {"GET", "/v1/collections/d%ZZ", "", "", 400, "bad_request"},
      {"GET", "/v1/collections/%ff", "", "", 400, "bad_request"},
      {"GET", "/" + std::string(3000, 'a'), "", "", 414, "uri_too_long"},
      {"GET", "/" + std::string(9000, 'a'), "", "", 414, "uri_too_long"},
      {"POST", "/livez", "", "", 405, "method_not_allowed"},
      {"PUT", images, p, png, 405, "method_not_allowed"},
      {"DELETE", images, "", "", 405, "method_not_allowed"},
      {"GET", search, "", "", 405, "method_not_allowed"},
      {"PATCH", images + "/one", p, png, 405, "method_not_allowed"},
      {"OPTIONS", images, "", "", 405, "method_not_allowed"},
      // Unknown names
      {"GET", "/v1/collections/other", "", "", 404, "collection_not_found"},
      {"GET", "/v1/collections/other/images", "", "", 404, "collection_not_found"},
      {"POST", "/v1/collections/other/images", p, png, 404, "collection_not_found"},
      {"POST", "/v1/collections/other/search", p, png, 404, "collection_not_found"},
      {"GET", images + "/none", "", "", 404, "image_not_found"},
      {"GET", images + "/none/content", "", "", 404, "image_not_found"},
      {"GET", images + "/none/thumbnail", "", "", 404, "image_not_found"},
      {"GET", images + "/none/features", "", "", 404, "image_not_found"},
      {"DELETE", images + "/none", "", "", 404, "image_not_found"},
      {"GET", "/v1/collections/default/objects/none", "", "", 404, "object_not_found"},
      {"DELETE", "/v1/collections/default/objects/none", "", "", 404, "object_not_found"},
      {"GET", "/v1/jobs/none", "", "", 404, "job_not_found"},
      {"DELETE", "/v1/jobs/none", "", "", 404, "job_not_found"},
      {"PUT", std::string(kVocabularies) + "/77/active", "", "", 404, "vocabulary_not_found"},
      {"PUT", std::string(kVocabularies) + "/x/active", "", "", 404, "vocabulary_not_found"},
      {"POST", search, R"({"image_id": "none"})", json, 404, "image_not_found"},
      // Names that are not acceptable
      {"PUT", "/v1/collections/a%20b", "", "", 400, "invalid_parameter", "collection"},
      {"PUT", images + "/a%20b", p, png, 400, "invalid_parameter", "id"},
      {"PUT", images + "/..", p, png, 400, "invalid_parameter", "id"},
      {"PUT", images + "/a%00b", p, png, 400, "invalid_parameter", "id"},
      {"PUT", images + "/" + std::string(200, 'a'), p, png, 400, "invalid_parameter", "id"},
      {"PUT", images + "/x?object=" + std::string(600, 'a'), p, png, 400, "invalid_parameter",
       "object"},
      {"PUT", images + "/x?object=a%0Ab", p, png, 400, "invalid_parameter", "object"},
      {"PUT", images + "/x?object=%ff", p, png, 400, "invalid_parameter", "object"},
      // What a body is, and what it is not
      {"POST", images, "", "", 400, "missing_parameter", "image"},
      {"POST", images, p, "text/plain", 415, "unsupported_content_type"},
      {"POST", images, p, "", 415, "unsupported_content_type"},
      {"POST", images, "{}", json, 415, "unsupported_content_type"},
      {"POST", kVocabularies, p, png, 415, "unsupported_content_type"},
      {"POST", images, "hello", png, 415, "image_type_unknown"},
      {"POST", images, p.substr(0, p.size() / 2), png, 422, "image_truncated"},
      {"POST", images, TestPicture(1, 0, 12, 12), png, 422, "image_too_small"},
      {"POST", images, TestPicture(1, 0, 2000, 1500), png, 413, "image_too_large"},
      {"POST", images, std::string(1'200'000, 'x'), png, 413, "body_too_large"},
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
       form, 413, "body_too_large"},
      {"POST", images, field("image", p), form, 400, "bad_request"},
      {"POST", images, "nothing like a form", form, 400, "bad_request"},
      {"POST", images, field("image", p) + "--B--\r\n", "multipart/form-data", 400, "bad_request"},
      {"POST", images + "?object=a&object=b", p, png, 400, "duplicate_parameter", "object"},
      // Parameters
      {"GET", images + "?limit=0", "", "", 400, "invalid_parameter", "limit"},
      {"GET", images + "?limit=501", "", "", 400, "invalid_parameter", "limit"},
      {"GET", images + "?limit=1e2", "", "", 400, "invalid_parameter", "limit"},
      {"GET", images + "?limit=", "", "", 400, "invalid_parameter", "limit"},
      {"GET", images + "?cursor=x", "", "", 400, "invalid_cursor", "cursor"},
      {"GET", images + "?cursor=%ff", "", "", 400, "invalid_parameter", "cursor"},
      {"GET", images + "?page=2", "", "", 400, "unknown_parameter", "page"},
      {"GET", images + "/one?x=1", "", "", 400, "unknown_parameter", "x"},
      {"POST", search + "?limit=-1", p, png, 400, "invalid_parameter", "limit"},
      {"POST", search + "?limit=1001", p, png, 400, "invalid_parameter", "limit"},
      {"POST", search + "?offset=-1", p, png, 400, "invalid_parameter", "offset"},
      {"POST", search + "?group_by=colour", p, png, 400, "invalid_parameter", "group_by"},
      {"POST", search + "?rank=best", p, png, 400, "invalid_parameter", "rank"},
      {"POST", search + "?verify=yes", p, png, 400, "invalid_parameter", "verify"},
      {"POST", search + "?min_score=1.5", p, png, 400, "invalid_parameter", "min_score"},
      {"POST", search + "?min_score=nan", p, png, 400, "invalid_parameter", "min_score"},
      {"POST", search + "?region=1,2,3", p, png, 400, "invalid_parameter", "region"},
      {"POST", search + "?region=1,2,3,4,5", p, png, 400, "invalid_parameter", "region"},
      {"POST", search + "?region=0,0,0,5", p, png, 400, "invalid_parameter", "region"},
      {"POST", search + "?region=0,0,inf,5", p, png, 400, "invalid_parameter", "region"},
      {"POST", search + "?image_id=one", p, png, 400, "invalid_parameter", "image_id"},
      {"POST", search, "", "", 400, "missing_parameter", "image"},
      {"POST", search, "{}", json, 400, "missing_parameter", "image"},
      {"POST", search, "{", json, 400, "invalid_json", "body"},
      {"POST", search, "[]", json, 400, "invalid_json", "body"},
      {"POST", search, R"({"image_id": "one", "limit": 2.5})", json, 400, "invalid_parameter",
       "limit"},
      {"POST", search, R"({"image_id": "one", "region": [1, 2, "x", 4]})", json, 400,
       "invalid_parameter", "region"},
      {"POST", search, R"({"image_id": "one"})", json, 409, "no_vocabulary"},
      {"POST", kVocabularies, R"({"words": 1})", json, 400, "invalid_parameter", "words"},
      {"POST", kVocabularies, R"({"words": "many"})", json, 400, "invalid_parameter", "words"},
      {"POST", kVocabularies, R"({"activate": 1})", json, 400, "invalid_parameter", "activate"},
  };
  auto client = server_->Client();
  for (const ErrorCase& wrong : cases) {
    SCOPED_TRACE(wrong.method + " " + wrong.path.substr(0, 80) + " " + wrong.type + " " +
                 wrong.body.substr(0, 60));
    const auto answer = Send(client, wrong);
    ASSERT_TRUE(answer) << httplib::to_string(answer.error());
    ExpectProblem(*answer, wrong.status, wrong.code, wrong.parameter);
  }
  ExpectAlive();
}

TEST_F(ServerErrorsTest, MethodNotAllowedNamesThoseThatAre) {
  auto client = server_->Client();
  EXPECT_EQ(client.Patch(std::string(kImages) + "/one")->get_header_value("Allow"),
            "DELETE, GET, HEAD, PUT");
  EXPECT_EQ(client.Put(kImages)->get_header_value("Allow"), "GET, HEAD, POST");
  EXPECT_EQ(client.Get(kSearch)->get_header_value("Allow"), "POST");
}

TEST_F(ServerErrorsTest, PagesOfOtherSitesCannotChangeAnything) {
  auto client = server_->Client();
  const httplib::Headers other_site[] = {{{"Origin", "http://evil.example"}},
                                         {{"Origin", "null"}},
                                         {{"Sec-Fetch-Site", "cross-site"}}};
  for (const httplib::Headers& headers : other_site) {
    ExpectProblem(*client.Post(kImages, headers, picture_, "image/png"), 403, "cross_site");
    ExpectProblem(*client.Delete(std::string(kImages) + "/one", headers), 403, "cross_site");
  }
  const httplib::Headers own = {{"Origin", "http://127.0.0.1:" + std::to_string(server_->port())},
                                {"Sec-Fetch-Site", "same-origin"}};
  EXPECT_EQ(client.Post(kImages, own, picture_, "image/png")->status, 200);
}

TEST_F(ServerErrorsTest, BrokenHttp) {
  const std::string host = "Host: x\r\n";
  const std::string post =
      "POST " + std::string(kImages) + " HTTP/1.1\r\n" + host + "Content-Type: image/png\r\n";
  struct Case {
    const char* what;
    std::string bytes;
    int status;
    std::string code;
  };
  std::string many_headers = "GET /livez HTTP/1.1\r\n" + host;
  for (int i = 0; i < 3000; ++i) many_headers += "X-H" + std::to_string(i) + ": y\r\n";
  std::string ranges = "Range: bytes=0-0";
  for (int i = 0; i < 1300; ++i) ranges += ",0-0";
  const std::vector<Case> cases = {
      {"not HTTP", "hello\r\n\r\n", 400, "bad_request"},
      {"unknown method", "BREW / HTTP/1.1\r\n" + host + "\r\n", 400, "bad_request"},
      {"no Host", "GET /livez HTTP/1.1\r\n\r\n", 400, "bad_request"},
      {"two Hosts", "GET /livez HTTP/1.1\r\n" + host + host + "\r\n", 400, "bad_request"},
      {"no path", "GET livez HTTP/1.1\r\n" + host + "\r\n", 400, "bad_request"},
      {"bad range", "GET /livez HTTP/1.1\r\n" + host + "Range: x\r\n\r\n", 416,
       "range_not_satisfiable"},
      {"many headers", many_headers + "\r\n", 431, "headers_too_large"},
      {"long header",
       "GET /livez HTTP/1.1\r\n" + host + "X: " + std::string(9000, 'y') + "\r\n\r\n", 400,
       "bad_request"},
      {"long request line", "GET /" + std::string(20'000, 'a'), 431, "headers_too_large"},
      {"request line never ends", "GET /livez", 408, "request_timeout"},
      {"two lengths", post + "Content-Length: 1\r\nContent-Length: 2\r\n\r\nxx", 400,
       "bad_request"},
      {"length and chunks",
       post + "Content-Length: 3\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n", 400,
       "bad_request"},
      {"length no number", post + "Content-Length: 1x\r\n\r\nx", 400, "bad_request"},
      {"length negative", post + "Content-Length: -1\r\n\r\nx", 400, "bad_request"},
      {"length enormous", post + "Content-Length: 99999999999999999999999\r\n\r\n", 413,
       "body_too_large"},
      {"length too large", post + "Content-Length: 9999999999\r\n\r\n", 413, "body_too_large"},
      {"too large, asks first", post + "Expect: 100-continue\r\nContent-Length: 9999999999\r\n\r\n",
       413, "body_too_large"},
      {"odd encoding", post + "Transfer-Encoding: gzip\r\n\r\n", 501,
       "unsupported_transfer_encoding"},
      {"compressed", post + "Content-Encoding: gzip\r\nContent-Length: 2\r\n\r\nxx", 415,
       "unsupported_content_encoding"},
      {"chunks are not chunks", post + "Transfer-Encoding: chunked\r\n\r\nzz\r\n\r\n", 400,
       "bad_request"},
      {"endless chunk line",
       post + "Transfer-Encoding: chunked\r\n\r\n" + std::string(1'300'000, '1'), 413,
       "body_too_large"},
      {"body never ends", post + "Content-Length: 500\r\n\r\nxx", 408, "request_timeout"},
      {"headers never end", "GET /livez HTTP/1.1\r\n" + host, 408, "request_timeout"},
  };
  for (const Case& wrong : cases) {
    SCOPED_TRACE(wrong.what);
    const std::string answer = server_->Talk(wrong.bytes);
    EXPECT_THAT(answer, ::testing::StartsWith("HTTP/1.1 " + std::to_string(wrong.status) + " "));
    EXPECT_THAT(answer, ::testing::HasSubstr("\"code\":\"" + wrong.code + "\""));
    EXPECT_THAT(answer, ::testing::HasSubstr("X-Request-Id: "));
    EXPECT_THAT(answer, ::testing::HasSubstr("Connection: close"));
    EXPECT_THAT(answer, ::testing::HasSubstr("application/problem+json"));
  }
  // Many ranges are no way to make the answer grow.
  const std::string ranged =
      server_->Talk("GET / HTTP/1.1\r\n" + host + "Connection: close\r\n" + ranges + "\r\n\r\n");
  EXPECT_THAT(ranged, ::testing::StartsWith("HTTP/1.1 200 "));
  EXPECT_LT(ranged.size(), 20'000U);
  ExpectAlive();
}

TEST_F(ServerErrorsTest, ChunkedBodiesAndContinueWork) {
  const std::string head = "PUT " + std::string(kImages) +
                           "/one?object=o HTTP/1.1\r\nHost: x\r\nConnection: close\r\n"
                           "Content-Type: image/png\r\n";
  std::ostringstream chunked;
  chunked << head << "Transfer-Encoding: chunked\r\n\r\n"
          << std::hex << picture_.size() << "\r\n"
          << picture_ << "\r\n0\r\n\r\n";
  EXPECT_THAT(server_->Talk(chunked.str()), ::testing::StartsWith("HTTP/1.1 200 "));
  const std::string expecting =
      head + "Expect: 100-continue\r\nContent-Length: " + std::to_string(picture_.size()) +
      "\r\n\r\n" + picture_;
  const std::string answer = server_->Talk(expecting);
  EXPECT_THAT(answer, ::testing::StartsWith("HTTP/1.1 100 "));
  EXPECT_THAT(answer, ::testing::HasSubstr("HTTP/1.1 200 "));
}

// A client that sends byte by byte holds a thread no longer than the deadline allows, although each
// byte comes in good time.
TEST_F(ServerErrorsTest, SlowClientsAreCutOff) {
  const std::string post = "POST " + std::string(kImages) + " HTTP/1.1\r\nHost: x\r\n";
  const std::chrono::milliseconds patience(20'000);
  for (const std::string& head :
       {post + "Content-Type: image/png\r\nContent-Length: 1000\r\n\r\n", post + "X-Long: "}) {
    const auto start = std::chrono::steady_clock::now();
    EXPECT_THAT(server_->Talk(head, patience, true), ::testing::StartsWith("HTTP/1.1 408 "));
    EXPECT_LT(std::chrono::steady_clock::now() - start, patience) << "it was not cut off";
  }
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

TEST_F(ServerErrorsTest, CommandLine) {
  const auto run = [](const std::vector<std::string>& arguments) {
    return Program(arguments, {}, ServerPath()).Wait();
  };
  const std::string db = (folder_->path() / "other.db").string();
  const auto expect = [&](const std::vector<std::string>& arguments, int status,
                          const std::string& words) {
    const ProgramResult result = run(arguments);
    EXPECT_EQ(result.status, status);
    EXPECT_THAT(result.out + result.err, ::testing::HasSubstr(words));
  };
  expect({}, 2, "--db");
  expect({"--db", db, "--no-such-flag"}, 2, "--no-such-flag");
  expect({"--db", db, "--cores", "-1"}, 2, "--cores");
  expect({"--db", db, "--listen", "0.0.0.0:0"}, 1, "--allow-anonymous");
  expect({"--db", db, "--listen", "8080"}, 1, "--listen");
  expect({"--db", db, "--listen", "127.0.0.1:" + std::to_string(server_->port())}, 1,
         "cannot listen");
  expect({"--db", "/dev/null/x.db", "--listen", "127.0.0.1:0"}, 1, "/dev/null");
  expect({"--version"}, 0, "pliant-server ");
}

}  // namespace
}  // namespace pliant::testing
