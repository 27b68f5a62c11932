// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The planes of a JPEG as the file keeps them, brightness and two of colour differences: one pass
// over the file gives grey values and colours. (A progressive file takes as long to decode to grey
// as to colours.) Internal to the descriptor library; callers use DecodeImage of image.h.
#pragma once

#include <optional>

#include <opencv2/core.hpp>

#include "descriptor/image/image.h"

namespace pliant {

// Planes of colour may be coarser than grey, as the file has them; they and `padded` (the size of
// grey as they count it) reach beyond the image, right and below, to whole samples of colour.
struct JpegPlanes {
  cv::Mat grey;     // Y, in the image's size divided by the reduction
  cv::Size padded;  // at least that size
  cv::Mat blue;     // Cb; empty in a grey JPEG
  cv::Mat red;      // Cr
  bool damaged;     // there are warnings: decoding to grey alone may give other values
};

// As the file has it, not turned upright. `reduction`: 1, 2, 4 or 8. Nothing for JPEGs that are
// neither grey nor of Y, Cb and Cr (CMYK, RGB), whose sampling is unusual, or that cannot be
// decoded to their end. Throws std::bad_alloc. Thread-safe.
std::optional<JpegPlanes> DecodeJpegPlanes(Bytes bytes, const ImageHeader& header, int reduction);

// Scaled to `size`, as B, G, R.
cv::Mat ThumbnailOf(const JpegPlanes& planes, cv::Size size);

}  // namespace pliant
