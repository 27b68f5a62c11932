// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/tracking/frame_source.h"

#include <algorithm>
#include <system_error>
#include <utility>

#include "descriptor/base/error.h"
#include "descriptor/image/video.h"
#include "index/files/text.h"

namespace pliant {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void ThrowSingle(const fs::path& path, const char* what = "") {
  throw Error(
      ErrorCode::kUnprocessable, "single_frame",
      path.string() + what +
          " has a single frame; tracking needs a video or a folder with two frames or more. "
          "For one image use pliant match");
}

std::string Size(std::int64_t width, std::int64_t height) {
  return std::to_string(width) + " x " + std::to_string(height);
}

class VideoFrames : public FrameSource {
 public:
  VideoFrames(const fs::path& file, int every) : file_(file), every_(every), video_(file) {
    const VideoInfo& video = video_.info();
    info_ = {video.width, video.height, video.frames_per_second,
             (video.frames + every - 1) / every};
    if (video.frames == 1) ThrowSingle(file_);
  }

  std::optional<Frame> Next() override {
    for (int i = 1; i < every_ && number_ > 0; ++i, ++number_) {
      if (!video_.Skip()) return End();
    }
    std::optional<Image> image = video_.Next();
    if (!image) return End();
    Frame frame{number_++, {}, {}, std::move(*image)};
    if (info_.frames_per_second > 0) {
      frame.time_s = static_cast<double>(frame.number) / info_.frames_per_second;
    }
    return frame;
  }

 private:
  std::optional<Frame> End() const {
    if (number_ == 1) ThrowSingle(file_);  // whatever its header said
    return std::nullopt;
  }

  fs::path file_;
  int every_;
  VideoReader video_;
  std::int64_t number_ = 0;
};

class FolderFrames : public FrameSource {
 public:
  FolderFrames(const fs::path& folder, const FrameOptions& options) : options_(options) {
    options_.decode.colour = true;
    options_.decode.max_side_px = 0;
    Find(folder);
    if (files_.empty()) {
      const std::string first =
          skipped_.empty() ? "" : "; " + skipped_.front().file + ": " + skipped_.front().reason;
      throw Error(ErrorCode::kUnprocessable, "no_frames",
                  folder.string() + " holds no readable image" + first);
    }
    if (files_.size() == 1) ThrowSingle(folder);
    const auto every = static_cast<std::size_t>(options.every);
    info_.frames = static_cast<std::int64_t>((files_.size() + every - 1) / every);
  }

  std::optional<Frame> Next() override {
    while (at_ < files_.size()) {
      const std::size_t number = at_;
      const fs::path& file = files_[number];
      at_ += static_cast<std::size_t>(options_.every);
      try {
        return Frame{static_cast<std::int64_t>(number),
                     {},
                     ToDisplayText(file.filename().string()),
                     DecodeImage(ReadFile(file, options_.decode.max_bytes), options_.decode).image};
      } catch (const Error& error) {
        Skip(file, error);
      }
    }
    return std::nullopt;
  }

 private:
  void Skip(const fs::path& file, const Error& error) {
    skipped_.push_back(
        {ToDisplayText(file.filename().string()), error.reason(), ToDisplayText(error.what())});
  }

  void Find(const fs::path& folder) {
    std::vector<fs::path> candidates;
    for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
      const std::string name = entry.path().filename().string();
      if (name.starts_with('.') || name.ends_with(".uv.png") || !entry.is_regular_file()) continue;
      if (LooksLikeImage(entry.path())) candidates.push_back(entry.path());
    }
    std::sort(candidates.begin(), candidates.end(), [](const fs::path& a, const fs::path& b) {
      return NaturalLess(a.filename().string(), b.filename().string());
    });
    for (const fs::path& file : candidates) Add(file);
  }

  void Add(const fs::path& file) {
    ImageHeader header;
    try {
      header = ReadImageHeader(ReadFile(file, options_.decode.max_bytes));
    } catch (const Error& error) {
      if (error.code() != ErrorCode::kUnsupportedMediaType) Skip(file, error);
      return;
    }
    const bool turned = header.exif_orientation >= 5;
    const auto width = static_cast<int>(turned ? header.height : header.width);
    const auto height = static_cast<int>(turned ? header.width : header.height);
    if (files_.empty()) {
      info_.width = width;
      info_.height = height;
    } else if (width != info_.width || height != info_.height) {
      throw Error(ErrorCode::kUnprocessable, "frames_vary",
                  file.string() + " is " + Size(width, height) + " pixels, but " +
                      files_.front().filename().string() + " is " +
                      Size(info_.width, info_.height) + "; all frames must have one size");
    }
    files_.push_back(file);
  }

  FrameOptions options_;
  std::vector<fs::path> files_;
  std::size_t at_ = 0;
};

}  // namespace

bool NaturalLess(const std::string& a, const std::string& b) {
  return std::pair(NaturalKey(a), a) < std::pair(NaturalKey(b), b);
}

std::unique_ptr<FrameSource> OpenFrames(const fs::path& path, const FrameOptions& options) {
  if (options.every < 1) {
    throw Error(ErrorCode::kInvalidArgument, "bad_every", "every must be 1 or more");
  }
  std::error_code error;
  if (!fs::is_directory(path, error)) {
    if (fs::is_regular_file(path, error) && LooksLikeImage(path)) {
      ThrowSingle(path, " is an image: it");
    }
    return std::make_unique<VideoFrames>(path, options.every);
  }
  try {
    return std::make_unique<FolderFrames>(path, options);
  } catch (const fs::filesystem_error& failure) {
    throw Error(ErrorCode::kNotFound, "cannot_read",
                path.string() + " cannot be read: " + failure.code().message());
  }
}

}  // namespace pliant
