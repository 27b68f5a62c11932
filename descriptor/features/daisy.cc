// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// DAISY (Tola, Lepetit, Fua, PAMI 2010) at key points: a patch is turned by the key point's angle
// and scaled by its size; 25 Gaussian windows on three rings collect 8 gradient directions each.
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numbers>
#include <vector>

#include <Eigen/Core>
#include <opencv2/imgproc.hpp>

#include "descriptor/features/baselines.h"
#include "descriptor/image/cv_image.h"

namespace pliant {
namespace {

// The paper's layout: R = 15, Q = 3, T = 8, H = 8.
constexpr int kRadius = 15;
constexpr int kRings = 3;
constexpr int kPetals = 8;
constexpr int kBins = 8;
constexpr int kWindows = 1 + kRings * kPetals;
constexpr int kDim = kWindows * kBins;
constexpr int kSide = 2 * (kRadius + 15) + 1;  // of the patch: two standard deviations more
constexpr int kPixels = kSide * kSide;
// The outermost ring's radius over the key point's size (a diameter).
constexpr double kRadiusPerSize = 3.0;

using Bins = Eigen::Matrix<float, kPixels, kBins, Eigen::ColMajor>;
using Histograms = Eigen::Matrix<float, kWindows, kBins, Eigen::RowMajor>;

// Row w: the Gaussian of window w over the patch, sum 1. The centre's is as wide as the first
// ring's (paper, section 3).
Eigen::MatrixXf MakeWindows() {
  Eigen::MatrixXf windows(kWindows, kPixels);
  for (int w = 0; w < kWindows; ++w) {
    const int ring = w == 0 ? 0 : (w - 1) / kPetals + 1;
    const double turn = 2 * std::numbers::pi * ((w - 1) % kPetals) / kPetals;
    const double radius = static_cast<double>(kRadius) * ring / kRings;
    const double sigma = kRadius * std::max(ring, 1) / (2.0 * kRings);
    const double cx = kSide / 2 + radius * std::cos(turn);
    const double cy = kSide / 2 + radius * std::sin(turn);
    for (int i = 0; i < kPixels; ++i) {
      const double dx = i % kSide - cx;
      const double dy = i / kSide - cy;
      const double g = std::exp(-(dx * dx + dy * dy) / (2 * sigma * sigma));
      windows(w, i) = static_cast<float>(g < 1e-3 ? 0 : g);
    }
    windows.row(w) /= windows.row(w).sum();
  }
  return windows;
}

// The picture at half, a quarter, ... of its size: pixel x of level l lies at x * 2^l.
std::vector<cv::Mat> MakePyramid(const cv::Mat& grey) {
  std::vector<cv::Mat> levels(1);
  grey.convertTo(levels[0], CV_32F);
  while (std::min(levels.back().cols, levels.back().rows) > 8) {
    cv::Mat half;
    cv::pyrDown(levels.back(), half);
    levels.push_back(half);
  }
  return levels;
}

cv::Mat CutPatch(const std::vector<cv::Mat>& levels, const Keypoint& k) {
  const double step_px = std::max(k.size, 1.0F) * kRadiusPerSize / kRadius;  // a patch pixel
  const auto level = static_cast<std::size_t>(
      std::clamp(std::lround(std::log2(step_px)), 0L, static_cast<long>(levels.size()) - 1));
  const double scale = std::ldexp(1.0, -static_cast<int>(level));
  const double angle = k.angle * std::numbers::pi / 180;
  const double c = step_px * scale * std::cos(angle);
  const double s = step_px * scale * std::sin(angle);
  const int middle = kSide / 2;
  const cv::Matx23d from_patch(c, -s, k.x * scale - middle * (c - s),  //
                               s, c, k.y * scale - middle * (s + c));
  cv::Mat patch;
  cv::warpAffine(levels[level], patch, from_patch, {kSide, kSide},
                 cv::INTER_LINEAR | cv::WARP_INVERSE_MAP, cv::BORDER_REFLECT_101);
  return patch;
}

// Gradients of a patch, split into directions: what points away from a direction does not count.
void SplitGradients(const cv::Mat& patch, Bins& bins) {
  bins.setZero();
  std::array<float, kBins> cosines{}, sines{};
  for (std::size_t b = 0; b < kBins; ++b) {
    const double turn = 2 * std::numbers::pi * static_cast<double>(b) / kBins;
    cosines[b] = static_cast<float>(std::cos(turn));
    sines[b] = static_cast<float>(std::sin(turn));
  }
  for (int y = 1; y + 1 < kSide; ++y) {
    const auto* row = patch.ptr<float>(y);
    const auto* above = patch.ptr<float>(y - 1);
    const auto* below = patch.ptr<float>(y + 1);
    for (int x = 1; x + 1 < kSide; ++x) {
      const float dx = 0.5F * (row[x + 1] - row[x - 1]);
      const float dy = 0.5F * (below[x] - above[x]);
      for (std::size_t b = 0; b < kBins; ++b) {
        bins(y * kSide + x, static_cast<Eigen::Index>(b)) =
            std::max(0.0F, cosines[b] * dx + sines[b] * dy);
      }
    }
  }
}

class Daisy : public Descriptor {
 public:
  const DescriptorInfo& info() const override { return info_; }

  Descriptors Describe(const Image& grey, std::span<const Keypoint> keypoints,
                       int /*threads*/) const override {
    CheckGrey(grey);
    Descriptors result = Descriptors::Float(keypoints.size(), kDim);
    const std::vector<cv::Mat> levels = MakePyramid(ViewAsMat(grey));
    const auto bins = std::make_unique<Bins>();  // 119 kB: not for the stack
    for (std::size_t i = 0; i < keypoints.size(); ++i) {
      SplitGradients(CutPatch(levels, keypoints[i]), *bins);
      Histograms histograms = windows_ * *bins;
      for (int w = 0; w < kWindows; ++w)  // each window is normalised on its own
        histograms.row(w) /= std::max(histograms.row(w).norm(), 1e-3F);
      histograms /= std::sqrt(static_cast<float>(kWindows));
      std::copy_n(histograms.data(), kDim, result.floats.data() + i * kDim);
    }
    return result;
  }

 private:
  const Eigen::MatrixXf windows_ = MakeWindows();
  DescriptorInfo info_{
      .name = "daisy", .kind = DescriptorKind::kFloat, .dim = kDim, .model_id = "daisy:1"};
};

}  // namespace

std::shared_ptr<const Descriptor> MakeDaisy() { return std::make_shared<Daisy>(); }

}  // namespace pliant
