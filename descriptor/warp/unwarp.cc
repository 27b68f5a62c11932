// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/warp/unwarp.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include <opencv2/imgproc.hpp>

#include "descriptor/base/error.h"
#include "descriptor/image/cv_image.h"

namespace pliant {
namespace {

constexpr int kStep = 4;

// The spline on a lattice with kStep pixels between, and anywhere by interpolation.
class Lattice {
 public:
  Lattice(const ThinPlateSpline& warp, int width, int height) : columns_((width - 1) / kStep + 2) {
    const int rows = (height - 1) / kStep + 2;
    points_.reserve(static_cast<std::size_t>(columns_) * rows);
    for (int r = 0; r < rows; ++r) {
      for (int c = 0; c < columns_; ++c) {
        points_.push_back(warp({static_cast<double>(c * kStep), static_cast<double>(r * kStep)}));
      }
    }
  }
  Vec2 At(int x, int y) const {
    const int c = x / kStep;
    const int r = y / kStep;
    const double fx = static_cast<double>(x % kStep) / kStep;
    const double fy = static_cast<double>(y % kStep) / kStep;
    const Vec2* upper = points_.data() + static_cast<std::size_t>(r) * columns_ + c;
    const Vec2* lower = upper + columns_;
    const auto mix = [&](double a, double b, double d, double e) {
      return (1 - fy) * ((1 - fx) * a + fx * b) + fy * ((1 - fx) * d + fx * e);
    };
    return {mix(upper[0].x, upper[1].x, lower[0].x, lower[1].x),
            mix(upper[0].y, upper[1].y, lower[0].y, lower[1].y)};
  }

 private:
  int columns_;
  std::vector<Vec2> points_;
};

void Sample(const Image& frame, Vec2 p, std::uint8_t* out) {
  const int x = std::min(static_cast<int>(p.x), frame.width - 1);
  const int y = std::min(static_cast<int>(p.y), frame.height - 1);
  const int right = x + 1 < frame.width ? frame.channels : 0;
  const int below = y + 1 < frame.height ? frame.width * frame.channels : 0;
  const double fx = p.x - x;
  const double fy = p.y - y;
  const std::uint8_t* at =
      frame.pixels.data() +
      (static_cast<std::size_t>(y) * frame.width + static_cast<std::size_t>(x)) * frame.channels;
  for (int c = 0; c < frame.channels; ++c) {
    const double upper = (1 - fx) * at[c] + fx * at[c + right];
    const double lower = (1 - fx) * at[c + below] + fx * at[c + below + right];
    out[c] = static_cast<std::uint8_t>(std::lround((1 - fy) * upper + fy * lower));
  }
}

cv::Mat Smooth(const cv::Mat& values) {
  cv::Mat smooth;
  cv::GaussianBlur(values, smooth, {11, 11}, 1.5, 1.5, cv::BORDER_REFLECT_101);
  return smooth;
}

}  // namespace

UnwarpedImage Unwarp(const Image& frame, const ThinPlateSpline& frame_from_template, int width,
                     int height) {
  if (frame.empty() || width < 1 || height < 1) {
    throw Error(ErrorCode::kInvalidArgument, "bad_size",
                "Un-warping needs a frame with pixels and a template of 1 x 1 or more");
  }
  UnwarpedImage result;
  const auto pixels = static_cast<std::size_t>(width) * height;
  result.image = {width, height, frame.channels, {}};
  result.image.pixels.assign(pixels * frame.channels, 0);
  result.known.assign(pixels, false);
  const Lattice lattice(frame_from_template, width, height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const Vec2 p = lattice.At(x, y);
      // Pixels reach half a pixel around their centres.
      if (!(p.x >= -0.5 && p.y >= -0.5 && p.x <= frame.width - 0.5 && p.y <= frame.height - 0.5)) {
        continue;
      }
      const std::size_t at = static_cast<std::size_t>(y) * width + x;
      result.known[at] = true;
      const Vec2 inside{std::clamp(p.x, 0.0, frame.width - 1.0),
                        std::clamp(p.y, 0.0, frame.height - 1.0)};
      Sample(frame, inside, result.image.pixels.data() + at * frame.channels);
    }
  }
  return result;
}

std::vector<float> SsimMap(const Image& a, const Image& b) {
  if (a.channels != 1 || b.channels != 1 || a.empty() || a.width != b.width ||
      a.height != b.height) {
    throw Error(ErrorCode::kInvalidArgument, "not_comparable",
                "SSIM compares two grey images of one size");
  }
  constexpr double kC1 = (0.01 * 255) * (0.01 * 255);
  constexpr double kC2 = (0.03 * 255) * (0.03 * 255);
  cv::Mat x;
  cv::Mat y;
  ViewAsMat(a).convertTo(x, CV_32F);
  ViewAsMat(b).convertTo(y, CV_32F);
  const cv::Mat mx = Smooth(x);
  const cv::Mat my = Smooth(y);
  const cv::Mat vx = Smooth(x.mul(x)) - mx.mul(mx);
  const cv::Mat vy = Smooth(y.mul(y)) - my.mul(my);
  const cv::Mat vxy = Smooth(x.mul(y)) - mx.mul(my);
  const cv::Mat above = (2 * mx.mul(my) + kC1).mul(2 * vxy + kC2);
  const cv::Mat below = (mx.mul(mx) + my.mul(my) + kC1).mul(vx + vy + kC2);
  const cv::Mat ssim = above / below;
  return {ssim.ptr<float>(), ssim.ptr<float>() + ssim.total()};
}

}  // namespace pliant
