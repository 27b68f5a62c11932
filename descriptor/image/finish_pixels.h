// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// From the pixels of a decoder to an Image. Internal to the descriptor library; callers use
// DecodeImage of image.h.
#pragma once

#include <opencv2/core.hpp>

#include "descriptor/image/image.h"

namespace pliant {

// B, G, R of B, G, R, A: transparent pixels become white, because the colour under them is
// arbitrary.
cv::Mat ComposeOnWhite(const cv::Mat& bgra);

// From grey or B, G, R, which may be changed: with the channels wanted, upright (by the orientation
// of EXIF 2.3, tag 0x0112), scaled down to `size`.
Image Finished(cv::Mat pixels, int orientation, const ScaledSize& size, bool colour);

}  // namespace pliant
