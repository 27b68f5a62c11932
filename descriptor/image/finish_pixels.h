// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// From the pixels that a decoder gives to an Image. Internal to the descriptor library; callers use
// DecodeImage of image.h.
#pragma once

#include <opencv2/core.hpp>

#include "descriptor/image/image.h"

namespace pliant {

// To 8 bits, without transparency (what is under it becomes white): grey, or B, G, R.
cv::Mat Simplified(cv::Mat pixels);

// From what Simplified gave, which may be changed: with the channels wanted, upright (by the
// orientation of EXIF 2.3, tag 0x0112), scaled down to `size`.
Image Finished(cv::Mat pixels, int orientation, const ScaledSize& size, bool colour);

}  // namespace pliant
