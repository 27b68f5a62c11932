// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Videos and folders of frames: what is read, what is written, what is refused.
#include "index/tracking/frame_source.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "descriptor/base/error.h"
#include "descriptor/image/video.h"
#include "tests/unit/expect_error.h"
#include "tests/unit/index_test_images.h"

namespace pliant {
namespace {

using ::testing::ElementsAre;
using testing::ExpectError;
using testing::RandomImage;
using testing::RandomPng;
using testing::WriteBytes;
using testing::WriteText;

void WriteVideo(const std::filesystem::path& file, int frames, int width = 160, int height = 120) {
  VideoWriter writer(file, width, height, 10);
  for (int i = 0; i < frames; ++i) {
    writer.Write(RandomImage(static_cast<std::uint64_t>(i / 2), width, height));
  }
  writer.Close();
}

std::vector<std::int64_t> Numbers(FrameSource& source) {
  std::vector<std::int64_t> numbers;
  while (const auto frame = source.Next()) {
    EXPECT_EQ(frame->image.width, source.info().width);
    EXPECT_EQ(frame->image.channels, 3);
    numbers.push_back(frame->number);
  }
  return numbers;
}

double MeanDifference(const Image& colour, const Image& grey) {
  double sum = 0;
  for (std::size_t i = 0; i < grey.pixels.size(); ++i) {
    sum += std::abs(colour.pixels[3 * i + 1] - grey.pixels[i]);
  }
  return sum / static_cast<double>(grey.pixels.size());
}

class VideoNames : public ::testing::TestWithParam<const char*> {};

TEST_P(VideoNames, FramesComeBackAsTheyWereWritten) {
  const testing::TemporaryFolder folder;
  const auto file = folder / (std::string("clip") + GetParam());
  WriteVideo(file, 9);
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 1)
      << "nothing but the video is left";
  VideoReader reader(file);
  EXPECT_EQ(reader.info().width, 160);
  EXPECT_EQ(reader.info().height, 120);
  EXPECT_NEAR(reader.info().frames_per_second, 10, 0.1);
  for (int i = 0; i < 9; ++i) {
    const auto frame = reader.Next();
    ASSERT_TRUE(frame) << i;
    EXPECT_LT(MeanDifference(*frame, RandomImage(static_cast<std::uint64_t>(i / 2))), 12) << i;
  }
  EXPECT_FALSE(reader.Next());
}

INSTANTIATE_TEST_SUITE_P(Names, VideoNames, ::testing::Values(".mp4", ".avi", ".mkv"),
                         [](const auto& name) { return std::string(name.param).substr(1); });

TEST(VideoWriter, SaysWhatItCannotWrite) {
  const testing::TemporaryFolder folder;
  ExpectError(ErrorCode::kInvalidArgument, "bad_video_name",
              [&] { VideoWriter(folder / "a.gif", 10, 10, 10); });
  ExpectError(ErrorCode::kInvalidArgument, "bad_size",
              [&] { VideoWriter(folder / "a.mp4", 1, 10, 10); });
  ExpectError(ErrorCode::kNoSpace, "file_unwritable",
              [&] { VideoWriter(folder / "nowhere" / "a.mp4", 64, 64, 10); });
  VideoWriter writer(folder / "a.mp4", 63, 65, 10);  // odd sizes lose a pixel
  ExpectError(ErrorCode::kInvalidArgument, "frames_vary",
              [&] { writer.Write(RandomImage(1, 64, 65)); });
  writer.Write(RandomImage(1, 63, 65));
  writer.Close();
  EXPECT_EQ(VideoReader(folder / "a.mp4").info().width, 62);
  {
    const VideoWriter unfinished(folder / "b.mp4", 64, 64, 10);  // has no frame
  }
  EXPECT_FALSE(std::filesystem::exists(folder / "b.mp4"));
}

TEST(OpenFrames, VideosEveryFewFrames) {
  const testing::TemporaryFolder folder;
  WriteVideo(folder / "a.mp4", 10);
  const auto all = OpenFrames(folder / "a.mp4");
  EXPECT_EQ(Numbers(*all), (std::vector<std::int64_t>{0, 1, 2, 3, 4, 5, 6, 7, 8, 9}));
  const auto some = OpenFrames(folder / "a.mp4", {.every = 4, .decode = {}});
  EXPECT_EQ(some->info().frames, 3);
  const auto first = some->Next();
  ASSERT_TRUE(first && first->time_s);
  EXPECT_EQ(*first->time_s, 0);
  const auto second = some->Next();
  ASSERT_TRUE(second);
  EXPECT_EQ(second->number, 4);
  EXPECT_NEAR(*second->time_s, 0.4, 1e-6);
  EXPECT_LT(MeanDifference(second->image, RandomImage(2)), 12) << "the frames in between";
  EXPECT_THAT(Numbers(*some), ElementsAre(8));
  ExpectError(ErrorCode::kInvalidArgument, "bad_every",
              [&] { OpenFrames(folder / "a.mp4", {.every = 0, .decode = {}}); });
}

TEST(OpenFrames, RefusesWhatIsNoVideo) {
  const testing::TemporaryFolder folder;
  ExpectError(ErrorCode::kNotFound, "cannot_read", [&] { OpenFrames(folder / "none.mp4"); });
  WriteText(folder / "empty.mp4", "");
  ExpectError(ErrorCode::kUnprocessable, "video_empty", [&] { OpenFrames(folder / "empty.mp4"); });
  WriteText(folder / "text.mp4", "this is no video at all, whatever its name says");
  ExpectError(ErrorCode::kUnsupportedMediaType, "video_unreadable",
              [&] { OpenFrames(folder / "text.mp4"); });
  WriteVideo(folder / "one.mp4", 1);
  ExpectError(ErrorCode::kUnprocessable, "single_frame",
              [&] { Numbers(*OpenFrames(folder / "one.mp4")); });
  WriteVideo(folder / "cut.avi", 12);
  std::vector<std::uint8_t> bytes = testing::ReadBytes(folder / "cut.avi");
  bytes.resize(bytes.size() / 2);
  WriteBytes(folder / "cut.avi", bytes);
  const auto cut = Numbers(*OpenFrames(folder / "cut.avi"));
  EXPECT_GE(cut.size(), 2U);
  EXPECT_LT(cut.size(), 12U);
}

TEST(OpenFrames, FoldersInTheOrderOfTheirNumbers) {
  const testing::TemporaryFolder folder;
  for (const char* name : {"f10.png", "f2.png", "f1.png", ".f0.png", "f2.uv.png"}) {
    WriteBytes(folder / name, RandomPng(3));
  }
  WriteText(folder / "notes.txt", "nothing to see");
  std::filesystem::create_directory(folder / "f3.png");
  const auto source = OpenFrames(folder.path());
  EXPECT_EQ(source->info().frames, 3);
  std::vector<std::string> files;
  while (const auto frame = source->Next()) {
    files.push_back(frame->file);
    EXPECT_FALSE(frame->time_s);
  }
  EXPECT_THAT(files, ElementsAre("f1.png", "f2.png", "f10.png"));
  EXPECT_THAT(Numbers(*OpenFrames(folder.path(), {.every = 2, .decode = {}})), ElementsAre(0, 2));
}

TEST(OpenFrames, FoldersThatCannotBeTracked) {
  const testing::TemporaryFolder folder;
  ExpectError(ErrorCode::kUnprocessable, "no_frames", [&] { OpenFrames(folder.path()); });
  WriteText(folder / "notes.txt", "nothing to see");
  ExpectError(ErrorCode::kUnprocessable, "no_frames", [&] { OpenFrames(folder.path()); });
  WriteBytes(folder / "a.png", RandomPng(1));
  ExpectError(ErrorCode::kUnprocessable, "single_frame", [&] { OpenFrames(folder.path()); });
  WriteBytes(folder / "b.png", EncodePng(RandomImage(1, 161, 120)));
  try {
    OpenFrames(folder.path());
    ADD_FAILURE() << "sizes that differ were accepted";
  } catch (const Error& error) {
    EXPECT_EQ(error.reason(), "frames_vary");
    EXPECT_THAT(error.what(), ::testing::HasSubstr("161 x 120"));
    EXPECT_THAT(error.what(), ::testing::HasSubstr("b.png"));
  }
}

TEST(OpenFrames, DamagedImagesAreSkippedAndNamed) {
  const testing::TemporaryFolder folder;
  for (const char* name : {"a.png", "b.png", "c.png"}) WriteBytes(folder / name, RandomPng(1));
  std::vector<std::uint8_t> png = RandomPng(2);
  png.resize(png.size() / 2);
  WriteBytes(folder / "b.png", png);
  WriteText(folder / "d.jpg", "");
  const auto source = OpenFrames(folder.path());
  EXPECT_THAT(Numbers(*source), ElementsAre(0, 2));
  ASSERT_EQ(source->skipped().size(), 2U);
  EXPECT_EQ(source->skipped()[0].file, "d.jpg");
  EXPECT_EQ(source->skipped()[1].file, "b.png");
  EXPECT_FALSE(source->skipped()[1].reason.empty());
}

TEST(NaturalLess, OrdersNumbersByValue) {
  EXPECT_TRUE(NaturalLess("f2", "f10"));
  EXPECT_FALSE(NaturalLess("f10", "f2"));
  EXPECT_TRUE(NaturalLess("f2a10", "f2a11"));
  EXPECT_TRUE(NaturalLess("a", "b"));
  EXPECT_TRUE(NaturalLess("f", "f1"));
  EXPECT_TRUE(NaturalLess("f01", "f2"));
  EXPECT_TRUE(NaturalLess("f01", "f1") != NaturalLess("f1", "f01"));
  EXPECT_FALSE(NaturalLess("f1", "f1"));
  EXPECT_TRUE(NaturalLess("9", "99999999999999999999999999"));
}

}  // namespace
}  // namespace pliant
