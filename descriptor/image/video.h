// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Video files in and out, through OpenCV's videoio.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "descriptor/image/image.h"

namespace pliant {

struct VideoInfo {
  int width = 0;
  int height = 0;
  double frames_per_second = 0;  // 0 = unknown
  std::int64_t frames = 0;       // according to the file's header; 0 = unknown
};

// Not thread-safe. FFmpeg may write a line about damaged data to standard error.
class VideoReader {
 public:
  // Throws kNotFound "cannot_read" for a missing file, kUnprocessable "video_empty" for a file of
  // no bytes or without a frame, kUnsupportedMediaType "video_unreadable" for other files.
  explicit VideoReader(const std::filesystem::path& file);
  ~VideoReader();
  VideoReader(const VideoReader&) = delete;
  VideoReader& operator=(const VideoReader&) = delete;

  const VideoInfo& info() const { return info_; }

  // The next frame in colour; nullopt at the end, or where the data are damaged. Throws
  // kUnprocessable "frames_vary" when its size differs from the first one's.
  std::optional<Image> Next();
  // Skips a frame; false at the end.
  bool Skip();

 private:
  struct Capture;

  std::string name_;
  VideoInfo info_;
  std::unique_ptr<Capture> capture_;
};

// Whether VideoWriter writes files of this name: .mp4, .m4v, .mov, .mkv or .avi.
bool HasVideoName(const std::filesystem::path& file);

// Writes H.264 if the system's FFmpeg supports it, else MPEG-4 (Motion JPEG for .avi). The file
// gets its name when it is complete. Not thread-safe.
class VideoWriter {
 public:
  // Odd sizes are cropped by a pixel. Throws kInvalidArgument for a file name without a video
  // extension or a size below 2 x 2, kNoSpace "file_unwritable".
  VideoWriter(const std::filesystem::path& file, int width, int height, double frames_per_second);
  ~VideoWriter();  // without Close, no file is left
  VideoWriter(const VideoWriter&) = delete;
  VideoWriter& operator=(const VideoWriter&) = delete;

  // Grey or colour. Throws kInvalidArgument "frames_vary" for a size that differs from the
  // constructor's.
  void Write(const Image& frame);
  void Close();  // throws kNoSpace "file_unwritable"

 private:
  struct Output;

  std::filesystem::path file_;
  std::filesystem::path part_;
  int width_;
  int height_;
  std::unique_ptr<Output> output_;
};

}  // namespace pliant
