// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/image/video.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>
#include <system_error>

#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>

#include "descriptor/base/error.h"
#include "descriptor/base/strings.h"
#include "descriptor/image/cv_image.h"

namespace pliant {
namespace {

namespace fs = std::filesystem;

constexpr std::array<std::string_view, 5> kVideoNames = {".mp4", ".m4v", ".mov", ".mkv", ".avi"};
constexpr double kPlausibleRate = 1000;  // frames a second; headers may say anything

std::string LowerExtension(const fs::path& file) { return Lower(file.extension().string()); }

void CheckFile(const fs::path& file) {
  std::error_code error;
  const fs::file_status status = fs::status(file, error);
  if (error || !fs::is_regular_file(status)) {
    throw Error(ErrorCode::kNotFound, "cannot_read",
                file.string() + " cannot be read: " +
                    (error ? error.message() : std::string("it is no regular file")));
  }
  if (fs::file_size(file, error) == 0 && !error) {
    throw Error(ErrorCode::kUnprocessable, "video_empty", file.string() + " is an empty file");
  }
}

std::string Size(int width, int height) {
  return std::to_string(width) + " x " + std::to_string(height);
}

}  // namespace

struct VideoReader::Capture {
  cv::VideoCapture video;
  cv::Mat first;  // read to know that there is one
  bool has_first = false;
};

VideoReader::VideoReader(const fs::path& file)
    : name_(file.string()), capture_(std::make_unique<Capture>()) {
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);  // errors are thrown
  CheckFile(file);
  // An absolute path is a file for sure, never an address or a pattern of names.
  const std::string path = fs::absolute(file).string();
  cv::VideoCapture& video = capture_->video;
  try {
    // FFmpeg only: the other readers take "%" in a name for a pattern, or look at cameras.
    video.open(path, cv::CAP_FFMPEG);
  } catch (const cv::Exception&) {
    video.release();  // said below
  }
  if (!video.isOpened()) {
    throw Error(ErrorCode::kUnsupportedMediaType, "video_unreadable",
                name_ +
                    " is no video that can be read; give a video file (MP4, AVI, MKV, ...) or "
                    "a folder of images");
  }
  capture_->has_first = video.read(capture_->first) && !capture_->first.empty();
  if (!capture_->has_first) {
    throw Error(ErrorCode::kUnprocessable, "video_empty",
                name_ + " has no frame that can be decoded");
  }
  info_.width = capture_->first.cols;
  info_.height = capture_->first.rows;
  const double rate = video.get(cv::CAP_PROP_FPS);
  if (std::isfinite(rate) && rate > 0 && rate <= kPlausibleRate) info_.frames_per_second = rate;
  const double frames = video.get(cv::CAP_PROP_FRAME_COUNT);
  if (std::isfinite(frames) && frames > 0 && frames < 1e12) {
    info_.frames = static_cast<std::int64_t>(frames);
  }
}

VideoReader::~VideoReader() = default;

std::optional<Image> VideoReader::Next() {
  cv::Mat frame;
  if (capture_->has_first) {
    frame = capture_->first;
    capture_->has_first = false;
    capture_->first.release();
  } else if (!capture_->video.read(frame) || frame.empty()) {
    return std::nullopt;
  }
  if (frame.cols != info_.width || frame.rows != info_.height) {
    throw Error(ErrorCode::kUnprocessable, "frames_vary",
                name_ + " changes its size from " + Size(info_.width, info_.height) + " to " +
                    Size(frame.cols, frame.rows) + "; frames of one size are needed");
  }
  cv::Mat rgb;
  cv::cvtColor(frame, rgb, frame.channels() == 1 ? cv::COLOR_GRAY2RGB : cv::COLOR_BGR2RGB);
  return CopyFromMat(rgb);
}

bool VideoReader::Skip() {
  if (!capture_->has_first) return capture_->video.grab();
  capture_->has_first = false;
  return true;
}

struct VideoWriter::Output {
  cv::VideoWriter video;
};

bool HasVideoName(const fs::path& file) {
  return std::find(kVideoNames.begin(), kVideoNames.end(), LowerExtension(file)) !=
         kVideoNames.end();
}

VideoWriter::VideoWriter(const fs::path& file, int width, int height, double frames_per_second)
    : file_(file), width_(width), height_(height), output_(std::make_unique<Output>()) {
  if (!HasVideoName(file)) {
    throw Error(ErrorCode::kInvalidArgument, "bad_video_name",
                file.string() + " must end in .mp4, .m4v, .mov, .mkv or .avi");
  }
  if (width < 2 || height < 2) {
    throw Error(ErrorCode::kInvalidArgument, "bad_size",
                "A video of " + Size(width, height) + " pixels cannot be written");
  }
  const fs::path folder = fs::absolute(file).parent_path();
  part_ = folder / ("." + file.stem().string() + ".part" + file.extension().string());
  const cv::Size size(width & ~1, height & ~1);  // H.264 halves the colour's resolution
  const bool avi = LowerExtension(file) == ".avi";
  std::error_code unmade;
  const bool writable = fs::is_directory(folder, unmade);
  for (const char* codec : {avi ? "MJPG" : "avc1", avi ? "XVID" : "mp4v"}) {
    if (!writable || output_->video.isOpened()) break;
    try {
      output_->video.open(part_.string(), cv::CAP_FFMPEG,
                          cv::VideoWriter::fourcc(codec[0], codec[1], codec[2], codec[3]),
                          frames_per_second, size);
    } catch (const cv::Exception&) {
      output_->video.release();  // the next codec, or the error below
    }
  }
  if (!output_->video.isOpened()) {
    throw Error(ErrorCode::kNoSpace, "file_unwritable",
                file.string() + " cannot be written; is the folder there and writable?");
  }
}

VideoWriter::~VideoWriter() {
  if (!output_) return;
  output_->video.release();
  std::error_code ignored;
  fs::remove(part_, ignored);
}

void VideoWriter::Write(const Image& frame) {
  if (frame.width != width_ || frame.height != height_) {
    throw Error(ErrorCode::kInvalidArgument, "frames_vary",
                "a frame of " + Size(frame.width, frame.height) + " pixels in a video of " +
                    Size(width_, height_));
  }
  cv::Mat bgr;
  cv::cvtColor(ViewAsMat(frame), bgr, frame.channels == 1 ? cv::COLOR_GRAY2BGR : cv::COLOR_RGB2BGR);
  output_->video.write(bgr(cv::Rect(0, 0, width_ & ~1, height_ & ~1)));
}

void VideoWriter::Close() {
  output_->video.release();  // does not say whether all could be written
  std::error_code failed;
  const std::uintmax_t bytes = fs::file_size(part_, failed);
  if (!failed && bytes > 0) fs::rename(part_, file_, failed);
  if (failed || bytes == 0) {
    throw Error(ErrorCode::kNoSpace, "file_unwritable",
                file_.string() + " could not be written" +
                    (failed ? ": " + failed.message() : "; is the disk full?"));
  }
  output_.reset();
}

}  // namespace pliant
