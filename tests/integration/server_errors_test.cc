// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Addresses, names and command lines that are wrong: the status, the code and the named parameter
// are contracts, and the server goes on working.
#include <gmock/gmock.h>

#include "tests/integration/server_errors_fixture.h"

namespace pliant::testing {
namespace {

TEST_F(ServerErrorsTest, AddressesAndUnknownNames) {
  const std::string images = kImages;
  const std::string search = kSearch;
  const std::string& p = image_;
  ExpectProblems({
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
      {"PUT", images, p, kPng, 405, "method_not_allowed"},
      {"PUT", images, "", "", 405, "method_not_allowed"},
      {"GET", search, "", "", 405, "method_not_allowed"},
      {"PATCH", images, p, kPng, 405, "method_not_allowed"},
      {"OPTIONS", images, "", "", 405, "method_not_allowed"},
      // Unknown names
      {"GET", "/v1/collections/other", "", "", 404, "collection_not_found"},
      {"GET", "/v1/collections/other/images", "", "", 404, "collection_not_found"},
      {"POST", "/v1/collections/other/images", p, kPng, 404, "collection_not_found"},
      {"POST", "/v1/collections/other/search", p, kPng, 404, "collection_not_found"},
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
      {"POST", search, R"({"image_id": "none"})", kJson, 404, "image_not_found"},
  });
}

TEST_F(ServerErrorsTest, UnacceptableNames) {
  const std::string images = kImages;
  const std::string& p = image_;
  ExpectProblems({
      {"PUT", "/v1/collections/a%20b", "", "", 400, "invalid_parameter", "collection"},
      {"PUT", images + "/a%20b", p, kPng, 400, "invalid_parameter", "id"},
      {"PUT", images + "/..", p, kPng, 400, "invalid_parameter", "id"},
      {"PUT", images + "/a%00b", p, kPng, 400, "invalid_parameter", "id"},
      {"PUT", images + "/" + std::string(200, 'a'), p, kPng, 400, "invalid_parameter", "id"},
      {"PUT", images + "/x?object=" + std::string(600, 'a'), p, kPng, 400, "invalid_parameter",
       "object"},
      {"PUT", images + "/x?object=a%0Ab", p, kPng, 400, "invalid_parameter", "object"},
      {"PUT", images + "/x?object=%ff", p, kPng, 400, "invalid_parameter", "object"},
  });
}

TEST_F(ServerErrorsTest, MethodNotAllowedNamesThoseThatAre) {
  auto client = server_->Client();
  EXPECT_EQ(client.Post(std::string(kImages) + "/one")->get_header_value("Allow"),
            "DELETE, GET, HEAD, PATCH, PUT");
  EXPECT_EQ(client.Put(kImages)->get_header_value("Allow"), "DELETE, GET, HEAD, POST");
  EXPECT_EQ(client.Get(kSearch)->get_header_value("Allow"), "POST");
}

TEST_F(ServerErrorsTest, PagesOfOtherSitesCannotChangeAnything) {
  auto client = server_->Client();
  const httplib::Headers other_site[] = {{{"Origin", "http://evil.example"}},
                                         {{"Origin", "null"}},
                                         {{"Sec-Fetch-Site", "cross-site"}}};
  for (const httplib::Headers& headers : other_site) {
    ExpectProblem(*client.Post(kImages, headers, image_, "image/png"), 403, "cross_site");
    ExpectProblem(*client.Delete(std::string(kImages) + "/one", headers), 403, "cross_site");
  }
  const httplib::Headers own = {{"Origin", "http://127.0.0.1:" + std::to_string(server_->port())},
                                {"Sec-Fetch-Site", "same-origin"}};
  EXPECT_EQ(client.Post(kImages, own, image_, "image/png")->status, 200);
}

// DNS rebinding: the browser takes the server for evil.example, so Origin and Host agree.
TEST_F(ServerErrorsTest, NamesOfOtherSitesAreRefused) {
  auto client = server_->Client();
  const std::string port = ":" + std::to_string(server_->port());
  const httplib::Headers rebound = {{"Host", "evil.example" + port},
                                    {"Origin", "http://evil.example" + port},
                                    {"Sec-Fetch-Site", "same-origin"}};
  const std::string target = std::string(kImages) + "/rebound";
  ExpectProblem(*client.Put(target, rebound, image_, "image/png"), 421, "host_not_allowed");
  ExpectProblem(*client.Delete(target, rebound), 421, "host_not_allowed");
  ExpectProblem(*client.Get(kImages, rebound), 421, "host_not_allowed");
  EXPECT_EQ(client.Get(target)->status, 404);
  for (const std::string host : {"localhost", "LOCALHOST.", "127.0.0.1", "[::1]"}) {
    const httplib::Headers own = {{"Host", host + port}, {"Origin", "http://" + host + port}};
    EXPECT_EQ(client.Post(kImages, own, image_, "image/png")->status, 200) << host;
  }
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
  expect({"--db", db, "--listen", "0.0.0.0:0"}, 2, "--allow-anonymous");
  expect({"--db", db, "--listen", "8080"}, 2, "--listen");
  expect({"--db", db, "--listen", "127.0.0.1:" + std::to_string(server_->port())}, 1,
         "cannot listen");
  expect({"--db", "/dev/null/x.db", "--listen", "127.0.0.1:0"}, 1, "/dev/null");
  expect({"--version"}, 0, "pliant-server ");
}

}  // namespace
}  // namespace pliant::testing
