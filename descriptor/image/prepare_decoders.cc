// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/image/prepare_decoders.h"

#include <memory>
#include <vector>

#include <opencv2/core/utility.hpp>
#include <opencv2/core/utils/logger.hpp>
#include <webp/encode.h>

#include "descriptor/base/error.h"
#include "descriptor/image/image.h"

namespace pliant {
namespace {

constexpr int kWidth = 128;  // large enough to be decoded at an eighth of the size
constexpr int kHeight = 96;
constexpr int kSmallSidePx = 12;
constexpr float kWebpQuality = 50;

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
  Image colours = {kWidth, kHeight, 3, {}};
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      for (const int value : {x, y, x * y}) {
        colours.pixels.push_back(static_cast<std::uint8_t>(value));
      }
    }
  }
  const std::vector<std::uint16_t> deep(colours.pixels.begin(), colours.pixels.end());
  std::uint8_t* webp = nullptr;
  const std::size_t size =
      WebPEncodeRGB(colours.pixels.data(), kWidth, kHeight, 3 * kWidth, kWebpQuality, &webp);
  const std::unique_ptr<std::uint8_t, void (*)(void*)> owner(webp, WebPFree);
  for (const auto& file :
       {EncodeJpeg(colours), EncodePng(colours), EncodeDeepPng(kWidth, kHeight, deep),
        std::vector<std::uint8_t>(webp, webp + size)}) {
    DecodeInEveryWay(file);
    DecodeDamaged(file);
  }
}

}  // namespace pliant
