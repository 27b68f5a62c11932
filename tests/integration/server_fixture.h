// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A server of one's own for each test, and the requests that most tests send.
#pragma once

#include <cstdint>
#include <iostream>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include <gtest/gtest.h>

#include "server/decoder/sandbox.h"
#include "tests/integration/server_process.h"

namespace pliant::testing {

inline constexpr const char* kImages = "/v1/collections/default/images";
inline constexpr const char* kSearch = "/v1/collections/default/search";

inline httplib::Result Upload(httplib::Client& client, const std::string& image,
                              const std::string& object,
                              const std::string& collection = "default") {
  return client.Post("/v1/collections/" + collection + "/images",
                     httplib::MultipartFormDataItems{{"image", image, "photo.png", "image/png"},
                                                     {"object", object, "", ""}});
}

// Beside a sanitizer a server is so slow that it may say "come again"; elsewhere that is a fault.
inline constexpr int kMoreTries = server::kSanitized ? 20 : 0;

// Asks again while the first vocabulary is trained: a search waits for it, but not for ever.
inline httplib::Result PostPatiently(httplib::Client& client, const std::string& path,
                                     const std::string& body, const std::string& type) {
  auto answer = client.Post(path, body, type);
  for (int i = 0; i < kMoreTries && answer && answer->status == 409 &&
                  answer->body.find("training the first vocabulary") != std::string::npos;
       ++i) {
    answer = client.Post(path, body, type);
  }
  return answer;
}

inline Json SearchFor(httplib::Client& client, const std::string& image,
                      const std::string& query = "") {
  const auto answer = PostPatiently(client, kSearch + query, image, "image/png");
  EXPECT_TRUE(answer && answer->status == 200) << (answer ? answer->body : "no answer");
  return answer ? Json::parse(answer->body) : Json::object();
}

inline std::vector<std::string> ImageIds(const Json& hits) {
  std::vector<std::string> ids;
  for (const Json& hit : hits) ids.push_back(hit["image_id"]);
  return ids;
}

inline std::string Base64Of(const std::string& bytes) {
  constexpr const char* kDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t group = 0;
    for (std::size_t j = 0; j < 3; ++j) {
      group = group << 8 | (i + j < bytes.size() ? static_cast<unsigned char>(bytes[i + j]) : 0U);
    }
    for (std::size_t j = 0; j < 4; ++j) {
      text += i + j <= bytes.size() ? kDigits[group >> (18 - 6 * j) & 63] : '=';
    }
  }
  return text;
}

// The other way round, of what is base64.
inline std::string BytesOfBase64(const std::string& text) {
  constexpr std::string_view kDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string bytes;
  std::uint32_t group = 0;
  int bits = 0;
  for (const char c : text) {
    if (c == '=') break;
    group = group << 6 | static_cast<std::uint32_t>(kDigits.find(c));
    bits += 6;
    if (bits < 8) continue;
    bits -= 8;
    bytes += static_cast<char>(group >> bits & 255);
  }
  return bytes;
}

class ServerTest : public ::testing::Test {
 protected:
  void Start(const std::vector<std::string>& flags = {}) {
    server_ = std::make_unique<ServerProcess>(folder_.path() / "test.db", flags);
  }
  void TearDown() override {
    if (HasFailure() && server_) std::cerr << server_->Log();
  }

  TemporaryFolder folder_;
  std::unique_ptr<ServerProcess> server_;
};

}  // namespace pliant::testing
