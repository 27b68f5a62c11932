// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/image/prepare_decoders.h"

#include <utility>
#include <vector>

#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "descriptor/base/error.h"
#include "descriptor/image/image.h"

namespace pliant {
namespace {

constexpr int kWidth = 128;  // large enough to be decoded at an eighth of the size
constexpr int kHeight = 96;
constexpr int kSmallSidePx = 12;
constexpr int kWebpQuality = 50;  // without it OpenCV encodes without loss, which takes long

void DecodeInEveryWay(const std::vector<std::uint8_t>& file) {
  for (const int max_side_px : {0, kSmallSidePx}) {
    for (const bool colour : {false, true}) {
      for (const int thumbnail_side_px : {0, kSmallSidePx}) {
        DecodeOptions options;
        options.max_side_px = max_side_px;
        options.colour = colour;
        options.thumbnail_side_px = thumbnail_side_px;
        DecodeImage(file, options);
      }
    }
  }
}

// The ways on which decoders report what is wrong.
void DecodeDamaged(std::vector<std::uint8_t> file) {
  for (std::size_t i = file.size() / 2; i < file.size() / 2 + 16 && i < file.size(); ++i) {
    file[i] ^= 0x5A;
  }
  try {
    DecodeImage(file);
  } catch (const Error&) {
    return;  // as it should be; some formats do not notice
  }
}

}  // namespace

void QuietDecoders() { cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT); }

void PrepareDecoders() {
  cv::setNumThreads(1);
  cv::Mat colours(kHeight, kWidth, CV_8UC3);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      colours.at<cv::Vec3b>(y, x) = {static_cast<std::uint8_t>(x), static_cast<std::uint8_t>(y),
                                     static_cast<std::uint8_t>(x * y)};
    }
  }
  cv::Mat transparent;
  cv::Mat deep;
  cv::cvtColor(colours, transparent, cv::COLOR_BGR2BGRA);
  colours.convertTo(deep, CV_16U, 257);
  using Example = std::pair<const char*, const cv::Mat&>;
  for (const auto& [extension, image] :
       {Example{".jpg", colours}, Example{".png", colours}, Example{".png", transparent},
        Example{".png", deep}, Example{".webp", colours}, Example{".bmp", colours},
        Example{".tiff", colours}, Example{".tiff", deep}}) {
    std::vector<std::uint8_t> file;
    cv::imencode(extension, image, file, {cv::IMWRITE_WEBP_QUALITY, kWebpQuality});
    DecodeInEveryWay(file);
    DecodeDamaged(file);
  }
}

}  // namespace pliant
