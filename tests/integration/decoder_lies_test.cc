// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Decoders that an image has taken over: this program is one when it is started as one, and the
// memory it is given says how it lies.
#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "server/decoder/decoder_main.h"
#include "server/decoder/decoder_pool.h"
#include "tests/unit/expect_error.h"

namespace pliant::server {
namespace {

using Cause = DecoderEnded::Cause;
using ::testing::ElementsAre;

constexpr int kWidth = 40;
constexpr int kHeight = 30;
constexpr std::int32_t kHuge = 1 << 30;

struct Lie {
  const char* name;
  std::function<void(DecodeAnswer& answer)> tell;
};

void Refuse(DecodeAnswer& answer, ErrorCode code, const char* reason) {
  answer.refused = 1;
  answer.error_code = static_cast<std::int32_t>(code);
  std::strncpy(answer.reason, reason, sizeof(answer.reason) - 1);
}

const std::vector<Lie>& Lies() {
  static const std::vector<Lie> lies = {
      {"truth", [](DecodeAnswer&) {}},
      {"huge", [](DecodeAnswer& a) { a.width = a.original_width = kHuge; }},
      {"huge_both",
       [](DecodeAnswer& a) { a.width = a.height = a.original_width = a.original_height = kHuge; }},
      {"negative", [](DecodeAnswer& a) { a.width = a.original_width = -kWidth; }},
      {"no_pixels", [](DecodeAnswer& a) { a.height = a.original_height = 0; }},
      {"not_scaled_as_said", [](DecodeAnswer& a) { a.width = kWidth + 1; }},
      {"larger_than_asked",
       [](DecodeAnswer& a) {
         a.width = a.original_width = 2000;
         a.height = a.original_height = 1500;
       }},
      {"colours", [](DecodeAnswer& a) { a.channels = 3; }},
      {"format", [](DecodeAnswer& a) { a.format = 77; }},
      {"unknown_format", [](DecodeAnswer& a) { a.format = 0; }},
      {"internal_error", [](DecodeAnswer& a) { Refuse(a, ErrorCode::kInternal, "image_corrupt"); }},
      {"strange_error", [](DecodeAnswer& a) { Refuse(a, ErrorCode::kUnprocessable, "root"); }},
      {"endless_text", [](DecodeAnswer& a) {
         Refuse(a, ErrorCode::kUnprocessable, "");
         std::memset(a.reason, 'x', sizeof(a.reason));
         std::memset(a.message, '\n', sizeof(a.message));
       }}};
  return lies;
}

void Say(const void* what, std::size_t bytes) {
  if (write(kDecoderSocket, what, bytes) != static_cast<ssize_t>(bytes)) _exit(1);
}

// As RunDecoder, but that it does not look at the image.
int RunLiar(const Lie& lie) {
  DecoderGreeting greeting;
  greeting.ready = 1;
  Say(&greeting, sizeof(greeting));
  DecodeRequest request;
  while (read(kDecoderSocket, &request, sizeof(request)) == sizeof(request)) {
    std::vector<char> file(request.bytes);
    if (read(kDecoderSocket, file.data(), file.size()) < 1) return 1;
    DecodeAnswer answer;
    answer.width = answer.original_width = kWidth;
    answer.height = answer.original_height = kHeight;
    answer.channels = 1;
    answer.format = static_cast<std::int32_t>(ImageFormat::kPng);
    lie.tell(answer);
    Say(&answer, sizeof(answer));
    if (answer.refused == 0) Say(std::string(kWidth * kHeight, 'x').data(), kWidth * kHeight);
  }
  return 0;
}

class Liar : public ::testing::TestWithParam<std::size_t> {};

TEST_P(Liar, IsNotBelieved) {
  std::vector<Cause> causes;
  DecoderOptions options;
  options.memory_bytes = static_cast<std::int64_t>(GetParam());
  DecoderPool pool(options, [&](Cause cause) { causes.push_back(cause); });
  const std::vector<std::uint8_t> file(100, 'x');
  const pid_t id = pool.WaitingIds().at(0);
  if (GetParam() == 0) {  // so that the others fail for what they say
    EXPECT_EQ(pool.Decode(file, {}).image.pixels, std::vector<std::uint8_t>(kWidth * kHeight, 'x'));
    return;
  }
  testing::ExpectError(ErrorCode::kUnprocessable, "image_corrupt", [&] { pool.Decode(file, {}); });
  EXPECT_THAT(causes, ElementsAre(Cause::kBroken));
  EXPECT_EQ(kill(id, 0), -1) << "it is killed";
}

INSTANTIATE_TEST_SUITE_P(Lies, Liar, ::testing::Range(std::size_t{0}, Lies().size()),
                         [](const auto& test) { return std::string(Lies()[test.param].name); });

}  // namespace
}  // namespace pliant::server

int main(int argc, char** argv) {
  if (pliant::server::IsDecoder(argc, argv)) {
    return pliant::server::RunLiar(
        pliant::server::Lies().at(static_cast<std::size_t>(std::atoll(argv[3]))));
  }
  ::testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
