// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The output pictures of `pliant track`.
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "descriptor/image/video.h"
#include "index/tracking/track_picture.h"

namespace pliant::cli {

// To be called before the work whose result is written. Throws kInvalidArgument "bad_video_name"
// for a name that promises a file of another type (.gif), kNoSpace "file_unwritable" where a
// video's folder is not there.
void CheckTrackOutName(const std::filesystem::path& out);

// A video, or a folder of JPEG files frame_NNNNNN.jpg, depending on the name of `out`.
class TrackOutput {
 public:
  // `frames_per_second` of the written frames. Throws kNoSpace "file_unwritable".
  TrackOutput(const std::filesystem::path& out, double frames_per_second);

  void Write(const TrackedFrame& tracked, const PixelBox& box);
  void Close();

 private:
  std::filesystem::path out_;
  double frames_per_second_;
  bool video_;
  std::unique_ptr<VideoWriter> writer_;  // made with the first frame, when the size is known
};

}  // namespace pliant::cli
