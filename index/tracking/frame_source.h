// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Input frames of the tracker: a video file, or the images of a folder.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "descriptor/image/image.h"
#include "index/files/image_files.h"

namespace pliant {

struct Frame {
  std::int64_t number = 0;       // among all frames, from 0
  std::optional<double> time_s;  // since the first; unknown for folders
  std::string file;              // name of the image; empty for videos
  Image image;                   // colour
};

struct FrameSourceInfo {
  int width = 0;
  int height = 0;
  double frames_per_second = 0;  // 0 = unknown
  std::int64_t frames = 0;       // expected number of frames from Next; 0 = unknown
};

// Not thread-safe.
class FrameSource {
 public:
  virtual ~FrameSource() = default;
  // nullopt after the last frame. Throws kUnprocessable "frames_vary".
  virtual std::optional<Frame> Next() = 0;
  const FrameSourceInfo& info() const { return info_; }
  // Images that could not be decoded so far.
  const std::vector<SkippedFile>& skipped() const { return skipped_; }

 protected:
  FrameSourceInfo info_;
  std::vector<SkippedFile> skipped_;
};

struct FrameOptions {
  int every = 1;         // only frames 0, every, 2 every, ...
  DecodeOptions decode;  // limits of a folder's images; frames keep their size
};

// The images of a folder come in natural order of their names (2 before 10); hidden files, files
// that are not images, and the simulator's NAME.uv.png are ignored. All sizes are compared before
// the first frame is returned. Throws kNotFound "cannot_read", kInvalidArgument for
// options, kUnprocessable "no_frames" (an empty folder), "single_frame", "frames_vary", and what
// VideoReader throws.
std::unique_ptr<FrameSource> OpenFrames(const std::filesystem::path& path,
                                        const FrameOptions& options = {});

// Whether `a` comes before `b`: runs of digits compare by value.
bool NaturalLess(const std::string& a, const std::string& b);

}  // namespace pliant
