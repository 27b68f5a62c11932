// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Requests as widespread HTTP clients send them: each is an image that must be found or stored.
#include <gmock/gmock.h>

#include "tests/integration/server_fixture.h"

namespace pliant::testing {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

class ServerClientsTest : public ServerTest {
 protected:
  void SetUp() override { Start({"--auto-train", "false"}); }

  // Stores the body as the image of that id.
  httplib::Result Put(const std::string& id, const std::string& body, const std::string& type) {
    httplib::Request request;
    request.method = "PUT";
    request.path = std::string(kImages) + "/" + id;
    request.body = body;
    request.set_header("Content-Type", type);
    return client_->send(request);
  }
  Json Stored(const std::string& id, const std::string& body, const std::string& type) {
    if (!client_) client_ = std::make_unique<httplib::Client>(server_->Client());
    const auto answer = Put(id, body, type);
    EXPECT_TRUE(answer && answer->status == 201) << id << (answer ? answer->body : "no answer");
    return answer ? Json::parse(answer->body) : Json();
  }
  std::string Form(const std::string& disposition) const {
    return "--XX\r\nContent-Disposition: form-data; " + disposition +
           "\r\nContent-Type: image/jpeg\r\n\r\n" + image_ + "\r\n--XX--\r\n";
  }

  const std::string image_ = TestImage(1);
  std::unique_ptr<httplib::Client> client_;
};

TEST_F(ServerClientsTest, FormsOfAllClientsAreRead) {
  const std::string type = "multipart/form-data; boundary=XX";
  const std::string form = Form("name=\"image\"; filename=\"a.jpg\"");
  const std::string field = "--XX\r\nContent-Disposition: form-data; name=\"object\"\r\n";
  const auto source = [&](const std::string& id, const std::string& body, const std::string& kind) {
    return Stored(id, body, kind).value("source", "none");
  };
  EXPECT_EQ(source("curl", form, type), "a.jpg");
  EXPECT_EQ(source("dotnet", Form("name=image; filename=a.jpg; filename*=utf-8''a.jpg"),
                   "multipart/form-data; boundary=\"XX\""),
            "a.jpg");
  EXPECT_EQ(source("node18", form.substr(0, form.size() - 2), type), "a.jpg");
  EXPECT_EQ(source("order", Form("filename=\"a.jpg\"; name=\"image\""), type), "a.jpg");
  EXPECT_EQ(source("padding", "--XX \r\n" + form.substr(6, form.size() - 8) + " \r\n", type),
            "a.jpg");
  EXPECT_EQ(source("case", Form("Name=\"image\"; FileName=\"a.jpg\""),
                   "multipart/form-data; BOUNDARY=XX"),
            "a.jpg");
  EXPECT_EQ(source("apache", form, "multipart/form-data;boundary=XX;charset=utf-8"), "a.jpg");
  EXPECT_EQ(source("java",
                   field +
                       "Content-Type: text/plain; charset=UTF-8\r\nContent-Transfer-Encoding: "
                       "8bit\r\n\r\nmug\r\n" +
                       form,
                   type),
            "a.jpg");
  EXPECT_EQ(source("blank", field + "\r\n\r\n" + form, type), "a.jpg");
}

TEST_F(ServerClientsTest, FileNamesAreKept) {
  const auto source = [&](const std::string& id, const std::string& filename) {
    return Stored(id, Form("name=\"image\"; filename=\"" + filename + "\""),
                  "multipart/form-data; boundary=XX")
        .value("source", "none");
  };
  EXPECT_EQ(source("latin1", "caf\xe9.jpg"), "caf\\xe9.jpg");
  EXPECT_EQ(source("windows", "C:\\photos\\a.jpg"), "a.jpg");
  EXPECT_EQ(source("long", std::string(5000, 'a') + ".jpg"), std::string(1000, 'a') + "...");
}

TEST_F(ServerClientsTest, BodiesWithoutAUsefulTypeAreLookedAt) {
  for (const std::string type : {"application/x-www-form-urlencoded", "application/octet-stream"}) {
    EXPECT_EQ(Stored("raw" + std::to_string(type.size()), image_, type)["media_type"], "image/png");
  }
  const auto without_type = [&](const std::string& id, const std::string& body) {
    return server_->Talk("PUT " + std::string(kImages) + "/" + id +
                         " HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\nContent-Length: " +
                         std::to_string(body.size()) + "\r\n\r\n" + body);
  };
  EXPECT_THAT(without_type("none", image_), StartsWith("HTTP/1.1 201"));
  const std::string text = Base64Of(image_);
  const std::string json = R"({"image": ")" + text + "\"}";
  EXPECT_THAT(without_type("json", json), StartsWith("HTTP/1.1 201"));
  Stored("json-form", json, "application/x-www-form-urlencoded");
  std::string lines;
  for (std::size_t i = 0; i < text.size(); i += 76) lines += text.substr(i, 76) + "\\n";
  Stored("lines", R"({"image": ")" + lines + "\"}", "application/json");
  std::string url = text.substr(0, text.find('='));
  std::replace(url.begin(), url.end(), '+', '-');
  std::replace(url.begin(), url.end(), '/', '_');
  Stored("url", R"({"image": ")" + url + "\"}", "application/json");
}

TEST_F(ServerClientsTest, ClientsOfAProxySendTheWholeAddress) {
  const auto get = [&](const std::string& target, const std::string& host) {
    return server_->Talk("GET " + target + " HTTP/1.1\r\nHost: " + host +
                         "\r\nConnection: close\r\n\r\n");
  };
  EXPECT_THAT(get("http://localhost/livez", "localhost"), StartsWith("HTTP/1.1 200"));
  EXPECT_THAT(get("HTTP://localhost:80/v1/collections?x=1", "localhost"),
              HasSubstr("unknown_parameter"));
  EXPECT_THAT(get("http://localhost", "localhost"), HasSubstr("<title>"));
  EXPECT_THAT(get("http://evil.example/livez", "localhost"), StartsWith("HTTP/1.1 421"))
      << "the host of the address counts (RFC 9112, 3.2.2)";
  EXPECT_THAT(get("http://localhost/livez", "evil.example"), StartsWith("HTTP/1.1 200"));
}

}  // namespace
}  // namespace pliant::testing
