// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/cli/track_output.h"

#include <array>
#include <cctype>
#include <cstdio>
#include <system_error>

#include "descriptor/base/error.h"
#include "index/cli/write_picture.h"
#include "index/files/text.h"

namespace pliant::cli {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void FailToWrite(const fs::path& path) {
  throw Error(ErrorCode::kNoSpace, "file_unwritable",
              path.string() + " cannot be written; is the folder there and writable?");
}

}  // namespace

void CheckTrackOutName(const fs::path& out) {
  std::error_code ignored;
  if (HasVideoName(out)) {
    if (!fs::is_directory(fs::absolute(out).parent_path(), ignored)) FailToWrite(out);
    return;
  }
  // "run.2" may be meant; "o.gif" is not.
  const std::string extension = out.extension().string();
  const bool promises =
      extension.size() > 1 && std::isalpha(static_cast<unsigned char>(extension[1])) != 0;
  if (!promises || fs::is_directory(out, ignored)) return;
  throw Error(ErrorCode::kInvalidArgument, "bad_video_name",
              ToDisplayText(out.string()) + ": " + ToDisplayText(extension) +
                  " files are not written. Name a video (.mp4, .m4v, .mov, .mkv, .avi), or a "
                  "folder for pictures; to a folder of this name add a slash");
}

TrackOutput::TrackOutput(const fs::path& out, double frames_per_second)
    : out_(out), frames_per_second_(frames_per_second), video_(HasVideoName(out)) {
  if (video_) return;
  std::error_code failed;
  fs::create_directories(out, failed);
  if (failed || !fs::is_directory(out)) FailToWrite(out);
}

void TrackOutput::Write(const TrackedFrame& tracked, const PixelBox& box) {
  const Image picture = DrawTracked(tracked, box);
  if (video_) {
    if (!writer_) {
      writer_ =
          std::make_unique<VideoWriter>(out_, picture.width, picture.height, frames_per_second_);
    }
    writer_->Write(picture);
    return;
  }
  std::array<char, 48> name{};
  std::snprintf(name.data(), name.size(), "frame_%06lld.jpg",
                static_cast<long long>(tracked.frame.number));
  WritePicture(out_ / name.data(), picture);
}

void TrackOutput::Close() {
  if (writer_) writer_->Close();
}

}  // namespace pliant::cli
