// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/features/baselines.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <map>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

#include "descriptor/base/error.h"
#include "descriptor/features/features.h"
#include "descriptor/image/cv_image.h"
#include "descriptor/image/image.h"

namespace pliant {
namespace {

// Adds `border` reflected pixels on each side.
cv::Mat WithBorder(const cv::Mat& image, int border) {
  cv::Mat padded;
  cv::copyMakeBorder(image, padded, border, border, border, border, cv::BORDER_REFLECT_101);
  return padded;
}

// The keypoint's position, clamped to the image.
cv::Point2f PlaceInside(const Keypoint& keypoint, const Image& image) {
  return {std::clamp(keypoint.x, 0.0F, static_cast<float>(image.width - 1)),
          std::clamp(keypoint.y, 0.0F, static_cast<float>(image.height - 1))};
}

// Copies row j of `described`, the descriptor of given[j], to row given[j].class_id of `result`.
void TakeRows(const cv::Mat& described, const std::vector<cv::KeyPoint>& given,
              Descriptors& result) {
  const auto bytes = static_cast<std::size_t>(result.dim);
  for (std::size_t j = 0; j < given.size(); ++j) {
    std::memcpy(result.bytes.data() + static_cast<std::size_t>(given[j].class_id) * bytes,
                described.ptr(static_cast<int>(j)), bytes);
  }
}

// What the baselines share. They use one thread.
class Baseline : public Descriptor {
 public:
  Baseline(const char* name, DescriptorKind kind, int dim)
      : info_{.name = name, .kind = kind, .dim = dim, .model_id = std::string(name) + ":1"} {}

  const DescriptorInfo& info() const final { return info_; }

  Descriptors Describe(const Image& grey, std::span<const Keypoint> keypoints,
                       int /*threads*/) const final {
    if (grey.channels != 1 || grey.empty()) {
      throw Error(ErrorCode::kInvalidArgument, "not_grey",
                  "Descriptors are computed on grey images with at least one pixel");
    }
    Descriptors result = Descriptors::Of(info_.kind, keypoints.size(), info_.dim);
    if (!keypoints.empty()) Fill(grey, keypoints, result);
    return result;
  }

 private:
  // Row i of `result` describes keypoints[i].
  virtual void Fill(const Image& grey, std::span<const Keypoint> keypoints,
                    Descriptors& result) const = 0;

  DescriptorInfo info_;
};

class Brisk final : public Baseline {
 public:
  Brisk() : Baseline("brisk", DescriptorKind::kBinary, kDim) {}

 private:
  void Fill(const Image& grey, std::span<const Keypoint> keypoints,
            Descriptors& result) const override {
    float largest = 0;
    for (const Keypoint& k : keypoints) largest = std::max(largest, k.size);
    // OpenCV drops keypoints whose pattern does not fit in: the image gets a border.
    const int border = static_cast<int>(std::ceil(kPatternRadius *
                                                  std::min(kSizeFactor * largest, kLargestSize))) +
                       4;
    std::vector<cv::KeyPoint> given;
    given.reserve(keypoints.size());
    for (std::size_t i = 0; i < keypoints.size(); ++i) {
      const Keypoint& k = keypoints[i];
      const cv::Point2f place = PlaceInside(k, grey);
      given.emplace_back(place.x + static_cast<float>(border), place.y + static_cast<float>(border),
                         std::min(kSizeFactor * k.size, kLargestSize), k.angle, k.response, 0,
                         static_cast<int>(i));
    }
    cv::Mat described;
    cv::BRISK::create()->compute(WithBorder(ViewAsMat(grey), border), given, described);
    if (given.size() != keypoints.size() || described.cols != kDim) {
      throw Error(ErrorCode::kInternal, "brisk_rows", "OpenCV's BRISK dropped keypoints");
    }
    TakeRows(described, given, result);
  }

  static constexpr int kDim = 64;
  // BRISK's size over SIFT's: the pattern then covers 4.6 times the keypoint's size around it, as
  // SIFT's and ORB's do.
  static constexpr float kSizeFactor = 3.0F;
  static constexpr float kPatternRadius = 1.6F;  // of the pattern, times BRISK's size
  static constexpr float kLargestSize = 210.0F;  // BRISK's patterns do not grow beyond it
};

// The paper's layout: R = 15, Q = 3, T = 8, H = 8.
constexpr int kRadius = 15;
constexpr int kRings = 3;
constexpr int kPetals = 8;
constexpr int kBins = 8;
constexpr int kWindows = 1 + kRings * kPetals;
constexpr int kDim = kWindows * kBins;
constexpr int kSide = 2 * (kRadius + 15) + 1;  // of the patch: two standard deviations more
constexpr int kPixels = kSide * kSide;
// The outermost ring's radius over the keypoint's size (a diameter).
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

// The image at half, a quarter, ... of its size: pixel x of level l lies at x * 2^l.
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

class Daisy final : public Baseline {
 public:
  Daisy() : Baseline("daisy", DescriptorKind::kFloat, kDim) {}

 private:
  void Fill(const Image& grey, std::span<const Keypoint> keypoints,
            Descriptors& result) const override {
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
  }

  const Eigen::MatrixXf windows_ = MakeWindows();
};

class Sift final : public Baseline {
 public:
  explicit Sift(bool root)
      : Baseline(root ? "rootsift" : "sift", DescriptorKind::kFloat, kDim), root_(root) {}

 private:
  void Fill(const Image& grey, std::span<const Keypoint> keypoints,
            Descriptors& result) const override {
    std::vector<cv::KeyPoint> given;
    given.reserve(keypoints.size());
    for (const Keypoint& k : keypoints) {
      given.emplace_back(k.x, k.y, k.size, k.angle, k.response, k.octave);
    }
    cv::Mat rows;
    cv::SIFT::create()->compute(ViewAsMat(grey), given, rows);
    if (rows.rows != static_cast<int>(keypoints.size()) || !rows.isContinuous()) {
      throw Error(ErrorCode::kInternal, "sift_rows", "OpenCV's SIFT dropped keypoints");
    }
    std::memcpy(result.floats.data(), rows.data, result.floats.size() * sizeof(float));
    if (root_) {
      for (std::size_t i = 0; i < result.rows; ++i) TakeRoot(result.floats.data() + i * kDim);
    }
  }

  static constexpr int kDim = 128;

  static void TakeRoot(float* row) {
    float sum = 0;
    for (int j = 0; j < kDim; ++j) sum += row[j];
    const float scale = 1 / std::max(sum, 1e-6F);
    for (int j = 0; j < kDim; ++j) row[j] = std::sqrt(row[j] * scale);
  }

  bool root_;
};

class Orb final : public Baseline {
 public:
  Orb() : Baseline("orb", DescriptorKind::kBinary, kDim) {}

 private:
  void Fill(const Image& grey, std::span<const Keypoint> keypoints,
            Descriptors& result) const override {
    std::map<int, std::vector<std::size_t>> by_level;
    for (std::size_t i = 0; i < keypoints.size(); ++i) {
      by_level[PyramidLevel(keypoints[i].size)].push_back(i);
    }
    for (const auto& [level, rows] : by_level) DescribeLevel(grey, keypoints, level, rows, result);
  }

  static constexpr int kDim = 32;
  static constexpr double kLevelScale = 1.2;
  static constexpr int kMaxLevel = 14;
  // The size that is described at full resolution; ORB's own patch is 31 pixels wide there.
  static constexpr float kBaseSize = 4.0F;
  // ORB drops keypoints nearer to the border than this, so each level is padded by it.
  static constexpr int kBorder = 40;

  static int PyramidLevel(float size) {
    const double octaves = std::log2(std::max(size, 1.0F) / kBaseSize);
    const double level = std::round(octaves / std::log2(kLevelScale));
    return static_cast<int>(std::clamp(level, 0.0, static_cast<double>(kMaxLevel)));
  }

  static void DescribeLevel(const Image& grey, std::span<const Keypoint> keypoints, int level,
                            const std::vector<std::size_t>& rows, Descriptors& result) {
    const double scale = std::pow(kLevelScale, -level);
    const auto scaled = [&](int side) {
      return std::max(1, static_cast<int>(std::lround(side * scale)));
    };
    cv::Mat image = ViewAsMat(grey);
    if (level > 0) {
      cv::resize(image, image, {scaled(grey.width), scaled(grey.height)}, 0, 0, cv::INTER_AREA);
    }
    std::vector<cv::KeyPoint> given;
    given.reserve(rows.size());
    const float kx = static_cast<float>(image.cols) / static_cast<float>(grey.width);
    const float ky = static_cast<float>(image.rows) / static_cast<float>(grey.height);
    for (const std::size_t i : rows) {
      const Keypoint& k = keypoints[i];
      const cv::Point2f place = PlaceInside(k, grey);
      given.emplace_back((place.x + 0.5F) * kx - 0.5F + kBorder,
                         (place.y + 0.5F) * ky - 0.5F + kBorder, 31.0F, k.angle, k.response, 0,
                         static_cast<int>(i));
    }
    cv::Mat described;
    cv::ORB::create()->compute(WithBorder(image, kBorder), given, described);
    TakeRows(described, given, result);
  }
};

}  // namespace

std::shared_ptr<const Descriptor> MakeSift() { return std::make_shared<Sift>(false); }
std::shared_ptr<const Descriptor> MakeRootSift() { return std::make_shared<Sift>(true); }
std::shared_ptr<const Descriptor> MakeOrb() { return std::make_shared<Orb>(); }
std::shared_ptr<const Descriptor> MakeBrisk() { return std::make_shared<Brisk>(); }
std::shared_ptr<const Descriptor> MakeDaisy() { return std::make_shared<Daisy>(); }

}  // namespace pliant
