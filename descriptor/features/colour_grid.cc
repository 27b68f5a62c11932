// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/features/colour_grid.h"

#include <algorithm>

#include <opencv2/imgproc.hpp>

#include "descriptor/image/cv_image.h"

namespace pliant {

ColourGrid MakeColourGrid(const Image& picture) {
  if (picture.channels != 3 || picture.empty()) return {};
  const ScaledSize size = ScaleToFit(picture.width, picture.height, kColourGridSide);
  const Image cells = ResizeImage(picture, size.width, size.height);
  cv::Mat lab;
  cv::cvtColor(ViewAsMat(cells), lab, cv::COLOR_RGB2Lab);
  ColourGrid grid{size.width, size.height, {}};
  grid.chroma.reserve(2 * lab.total());
  bool grey = true;
  for (int y = 0; y < lab.rows; ++y) {
    for (int x = 0; x < lab.cols; ++x) {
      const auto& cell = lab.at<cv::Vec3b>(y, x);
      grid.chroma.push_back(cell[1]);
      grid.chroma.push_back(cell[2]);
      grey = grey && cell[1] == 128 && cell[2] == 128;
    }
  }
  if (grey) return {};
  return grid;
}

}  // namespace pliant
