// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Decoders of the real program: what they give, and what happens when they end.
#include "server/decoder/decoder_pool.h"

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "server/decoder/sandbox.h"
#include "tests/support/eventually.h"
#include "tests/unit/expect_error.h"
#include "tests/unit/image_files.h"

namespace pliant::server {
namespace {

using testing::CornerImage;
using testing::EncodeAs;
using testing::Eventually;
using testing::ExpectError;
using testing::FileBytes;
using testing::StateOf;
using Cause = DecoderEnded::Cause;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

class DecoderPoolTest : public ::testing::Test {
 protected:
  DecoderPool& Pool(DecoderOptions options = {}) {
    options.program = PLIANT_BINARY_DIR "/bin/pliant-server";
    pool_ = std::make_unique<DecoderPool>(options, [this](Cause cause) {
      const std::lock_guard lock(mutex_);
      causes_.push_back(cause);
    });
    return *pool_;
  }
  std::vector<Cause> Causes() {
    const std::lock_guard lock(mutex_);
    return causes_;
  }
  pid_t Stop() {  // the one decoder that waits
    const pid_t id = pool_->WaitingIds().at(0);
    kill(id, SIGSTOP);
    return id;
  }
  // Waits until the main thread waits for the answer of the decoder that Stop() has stopped.
  void AwaitImageAtDecoder() {
    EXPECT_TRUE(Eventually([this] { return pool_->WaitingIds().empty(); }));
    EXPECT_TRUE(
        Eventually([] { return StateOf("/proc/self/task/" + std::to_string(getpid())) == 'S'; }));
  }

 private:
  std::mutex mutex_;  // guards causes_
  std::vector<Cause> causes_;
  std::unique_ptr<DecoderPool> pool_;
};

// What became of a file, in one line; of an image all that callers see of it.
std::string Outcome(const ImageDecoder& decode, const FileBytes& file,
                    const DecodeOptions& options) {
  try {
    const DecodedImage decoded = decode(file, options);
    const Image& image = decoded.image;
    return MediaType(decoded.format) + " " + std::to_string(decoded.original_width) + " x " +
           std::to_string(decoded.original_height) + " scale " + std::to_string(decoded.scale) +
           " to " + std::to_string(image.width) + " x " + std::to_string(image.height) + " x " +
           std::to_string(image.channels) + ": " +
           std::string(image.pixels.begin(), image.pixels.end()) + " and " +
           std::to_string(decoded.thumbnail.width) + " x " +
           std::to_string(decoded.thumbnail.height) + ": " +
           std::string(decoded.thumbnail.pixels.begin(), decoded.thumbnail.pixels.end());
  } catch (const Error& error) {
    return error.reason() + ": " + error.what();
  }
}

TEST_F(DecoderPoolTest, GivesWhatDecodingInsideGives) {
  DecoderPool& pool = Pool();
  const ImageDecoder apart = [&](Bytes bytes, const DecodeOptions& options) {
    return pool.Decode(bytes, options);
  };
  for (const char* extension : {".jpg", ".png", ".webp", ".bmp", ".tiff"}) {
    const FileBytes file = EncodeAs(CornerImage(1501, 997), extension);
    for (const int max_side_px : {0, 97, 1024}) {
      for (const bool colour : {false, true}) {
        SCOPED_TRACE(extension + std::to_string(max_side_px));
        DecodeOptions options;
        options.max_side_px = max_side_px;
        options.colour = colour;
        options.thumbnail_side_px = colour ? 0 : 64;
        EXPECT_TRUE(Outcome(apart, file, options) == Outcome(DecodeImage, file, options));
      }
    }
  }
  EXPECT_THAT(Causes(), IsEmpty());
  EXPECT_EQ(pool.size(), 1U);
}

TEST_F(DecoderPoolTest, DoesWithEveryFoundFileWhatDecodingInsideDoes) {
  DecoderPool& pool = Pool();
  const ImageDecoder apart = [&](Bytes bytes, const DecodeOptions& options) {
    return pool.Decode(bytes, options);
  };
  std::size_t files = 0;
  for (const auto& entry :
       std::filesystem::directory_iterator(PLIANT_SOURCE_DIR "/tests/fuzz/corpus/image")) {
    std::ifstream stream(entry.path(), std::ios::binary);
    const FileBytes file((std::istreambuf_iterator<char>(stream)), {});
    for (const int side : {0, 48}) {
      const DecodeOptions options{.max_side_px = side,
                                  .max_decode_bytes = 256 << 20,  // what a decoder has memory for
                                  .min_side_px = 4,
                                  .colour = side == 0,
                                  .thumbnail_side_px = side};
      EXPECT_TRUE(Outcome(apart, file, options) == Outcome(DecodeImage, file, options))
          << entry.path();
    }
    ++files;
  }
  EXPECT_GT(files, 20U);
  EXPECT_THAT(Causes(), IsEmpty());
}

TEST_F(DecoderPoolTest, AFileThatIsTooLongIsRefused) {
  const DecodeOptions options{.max_bytes = 100};
  DecoderPool& pool = Pool();
  ExpectError(ErrorCode::kTooLarge, "image_too_large",
              [&] { pool.Decode(EncodeAs(CornerImage(), ".bmp"), options); });
}

TEST_F(DecoderPoolTest, OneThatIsKilledMidwayIsReplaced) {
  DecoderPool& pool = Pool();
  const FileBytes file = EncodeAs(CornerImage(), ".png");
  const pid_t id = Stop();  // it takes the image and does nothing with it
  std::thread killer([&] {
    AwaitImageAtDecoder();
    kill(id, SIGKILL);
  });
  EXPECT_EQ(pool.Decode(file, {}).image.width, CornerImage().cols)
      << "no image has a decoder killed: another one decodes it";
  killer.join();
  EXPECT_THAT(Causes(), ElementsAre(Cause::kKilled));
  EXPECT_EQ(kill(id, 0), -1) << "it is waited for";
}

TEST_F(DecoderPoolTest, ACrashIsNamed) {
  DecoderPool& pool = Pool();
  const pid_t id = Stop();
  std::thread killer([&] {
    AwaitImageAtDecoder();
    kill(id, SIGSEGV);
    kill(id, SIGCONT);
  });
  ExpectError(ErrorCode::kUnprocessable, "image_corrupt",
              [&] { pool.Decode(EncodeAs(CornerImage(), ".png"), {}); });
  killer.join();
  EXPECT_THAT(Causes(), ElementsAre(Cause::kCrashed));
}

TEST_F(DecoderPoolTest, OneThatDiedWhileItWaitedCostsNoImage) {
  DecoderPool& pool = Pool();
  const pid_t id = pool.WaitingIds().at(0);
  kill(id, SIGKILL);
  siginfo_t ended{};
  ASSERT_EQ(waitid(P_PID, static_cast<id_t>(id), &ended, WEXITED | WNOWAIT), 0);
  EXPECT_EQ(pool.Decode(EncodeAs(CornerImage(), ".png"), {}).image.width, CornerImage().cols);
  EXPECT_THAT(Causes(), ElementsAre(Cause::kKilled));
}

TEST_F(DecoderPoolTest, AnEndlessOneIsEndedAtTheDeadline) {
  DecoderOptions options;
  options.timeout = std::chrono::milliseconds(300);
  DecoderPool& pool = Pool(options);
  const pid_t id = Stop();
  // More than the socket holds: it must not wait for ever for room, either.
  const FileBytes file = EncodeAs(CornerImage(1200, 900), ".bmp");
  ExpectError(ErrorCode::kTooLarge, "image_too_large", [&] { pool.Decode(file, {}); });
  EXPECT_EQ(kill(id, 0), -1) << "it is gone";
  EXPECT_THAT(Causes(), ElementsAre(Cause::kTimeout));
  DecoderOptions patient;
  EXPECT_EQ(Pool(patient).Decode(file, {}).image.width, 1024);
}

TEST_F(DecoderPoolTest, HasNoMoreMemoryThanAllowed) {
  if (kSanitized) GTEST_SKIP() << "memory is not limited beside a sanitizer";
  DecoderOptions options;
  options.memory_bytes = 48 << 20;
  DecoderPool& pool = Pool(options);
  const FileBytes file = EncodeAs(CornerImage(6000, 5000), ".png");  // 90 MB of pixels
  DecodeOptions generous;
  generous.max_decode_bytes = std::int64_t{4} << 30;
  ExpectError(ErrorCode::kTooLarge, "image_too_large", [&] { pool.Decode(file, generous); });
  EXPECT_EQ(pool.Decode(EncodeAs(CornerImage(), ".png"), {}).image.width, CornerImage().cols);
  EXPECT_THAT(Causes(), IsEmpty()) << "it said so itself";
}

TEST_F(DecoderPoolTest, AWornOneIsReplaced) {
  DecoderOptions options;
  options.worn_after = std::chrono::milliseconds(1);  // its start takes more
  DecoderPool& pool = Pool(options);
  const pid_t id = pool.WaitingIds().at(0);
  const FileBytes file = EncodeAs(CornerImage(), ".png");
  EXPECT_NO_THROW(pool.Decode(file, {}));
  EXPECT_EQ(pool.size(), 0U);
  EXPECT_EQ(kill(id, 0), -1);
  EXPECT_NO_THROW(pool.Decode(file, {}));
  EXPECT_THAT(Causes(), IsEmpty());
}

TEST_F(DecoderPoolTest, StartsAsManyAsDecodeAtOnce) {
  DecoderPool& pool = Pool();
  const FileBytes file = EncodeAs(CornerImage(), ".png");
  const pid_t id = Stop();
  std::thread first([&] { EXPECT_NO_THROW(pool.Decode(file, {})); });
  while (!pool.WaitingIds().empty()) std::this_thread::yield();
  EXPECT_NO_THROW(pool.Decode(file, {})) << "by a second one";
  EXPECT_EQ(pool.size(), 2U);
  kill(id, SIGCONT);
  first.join();
  EXPECT_NO_THROW(pool.Decode(file, {}));
  EXPECT_EQ(pool.WaitingIds().size(), 2U) << "no third one";
}

TEST_F(DecoderPoolTest, ManyImagesAtOnce) {
  DecoderPool& pool = Pool();
  const FileBytes file = EncodeAs(CornerImage(640, 480), ".jpg");
  const std::string expected = Outcome(DecodeImage, file, {});
  std::vector<std::thread> threads;
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([&] {
      const ImageDecoder apart = [&](Bytes bytes, const DecodeOptions& options) {
        return pool.Decode(bytes, options);
      };
      for (int j = 0; j < 20; ++j) EXPECT_TRUE(Outcome(apart, file, {}) == expected);
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_LE(pool.size(), 4U);
  EXPECT_THAT(Causes(), IsEmpty());
}

TEST_F(DecoderPoolTest, DoesNotHearTheSignalsOfATerminal) {
  DecoderPool& pool = Pool();
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) kill(pool.WaitingIds().at(0), signal);
  EXPECT_NO_THROW(pool.Decode(EncodeAs(CornerImage(), ".png"), {}));
  EXPECT_THAT(Causes(), IsEmpty());
}

TEST(DecoderStart, SaysWhatFailed) {
  for (const char* program : {"/nowhere/pliant-server", "/bin/true", "/"}) {
    DecoderOptions options;
    options.program = program;
    ExpectError(ErrorCode::kUnavailable, "decoder_not_started", [&] { DecoderPool pool(options); });
  }
}

}  // namespace
}  // namespace pliant::server
