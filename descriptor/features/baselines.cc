// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/features/baselines.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>

#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

#include "descriptor/base/error.h"
#include "descriptor/features/cv_binary.h"
#include "descriptor/image/cv_image.h"

namespace pliant {
namespace {

class Sift : public Descriptor {
 public:
  explicit Sift(bool root) : root_(root) {
    info_ = {.name = root ? "rootsift" : "sift",
             .kind = DescriptorKind::kFloat,
             .dim = kDim,
             .model_id = root ? "rootsift:1" : "sift:1"};
  }

  const DescriptorInfo& info() const override { return info_; }

  Descriptors Describe(const Image& grey, std::span<const Keypoint> keypoints,
                       int /*threads*/) const override {
    CheckGrey(grey);
    Descriptors result = Descriptors::Float(keypoints.size(), kDim);
    if (keypoints.empty()) return result;
    std::vector<cv::KeyPoint> given;
    given.reserve(keypoints.size());
    for (const Keypoint& k : keypoints) {
      given.emplace_back(k.x, k.y, k.size, k.angle, k.response, k.octave);
    }
    cv::Mat rows;
    cv::SIFT::create()->compute(ViewAsMat(grey), given, rows);
    if (rows.rows != static_cast<int>(keypoints.size()) || !rows.isContinuous()) {
      throw Error(ErrorCode::kInternal, "sift_rows", "OpenCV's SIFT dropped key points");
    }
    std::memcpy(result.floats.data(), rows.data, result.floats.size() * sizeof(float));
    if (root_) {
      for (std::size_t i = 0; i < result.rows; ++i) TakeRoot(result.floats.data() + i * kDim);
    }
    return result;
  }

 private:
  static constexpr int kDim = 128;

  static void TakeRoot(float* row) {
    float sum = 0;
    for (int j = 0; j < kDim; ++j) sum += row[j];
    const float scale = 1 / std::max(sum, 1e-6F);
    for (int j = 0; j < kDim; ++j) row[j] = std::sqrt(row[j] * scale);
  }

  bool root_;
  DescriptorInfo info_;
};

class Orb : public Descriptor {
 public:
  const DescriptorInfo& info() const override { return info_; }

  Descriptors Describe(const Image& grey, std::span<const Keypoint> keypoints,
                       int /*threads*/) const override {
    CheckGrey(grey);
    Descriptors result = Descriptors::Binary(keypoints.size(), kDim);
    std::map<int, std::vector<std::size_t>> by_level;
    for (std::size_t i = 0; i < keypoints.size(); ++i) {
      by_level[PyramidLevel(keypoints[i].size)].push_back(i);
    }
    for (const auto& [level, rows] : by_level) DescribeLevel(grey, keypoints, level, rows, result);
    return result;
  }

 private:
  static constexpr int kDim = 32;
  static constexpr double kLevelScale = 1.2;
  static constexpr int kMaxLevel = 14;
  // The size that is described at full resolution; ORB's own patch is 31 pixels wide there.
  static constexpr float kBaseSize = 4.0F;
  // ORB drops key points nearer to the border than this, so each level is padded by it.
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
    cv::Mat picture = ViewAsMat(grey);
    if (level > 0) {
      cv::resize(picture, picture, {scaled(grey.width), scaled(grey.height)}, 0, 0, cv::INTER_AREA);
    }
    std::vector<cv::KeyPoint> given;
    given.reserve(rows.size());
    const float kx = static_cast<float>(picture.cols) / static_cast<float>(grey.width);
    const float ky = static_cast<float>(picture.rows) / static_cast<float>(grey.height);
    for (const std::size_t i : rows) {
      const Keypoint& k = keypoints[i];
      const cv::Point2f place = PlaceInside(k, grey);
      given.emplace_back((place.x + 0.5F) * kx - 0.5F + kBorder,
                         (place.y + 0.5F) * ky - 0.5F + kBorder, 31.0F, k.angle, k.response, 0,
                         static_cast<int>(i));
    }
    cv::Mat described;
    cv::ORB::create()->compute(WithBorder(picture, kBorder), given, described);
    TakeRows(described, given, result);
  }

  DescriptorInfo info_{
      .name = "orb", .kind = DescriptorKind::kBinary, .dim = kDim, .model_id = "orb:1"};
};

}  // namespace

void CheckGrey(const Image& grey) {
  if (grey.channels != 1 || grey.empty()) {
    throw Error(ErrorCode::kInvalidArgument, "not_grey",
                "Descriptors are computed on grey pictures with at least one pixel");
  }
}

std::shared_ptr<const Descriptor> MakeSift() { return std::make_shared<Sift>(false); }
std::shared_ptr<const Descriptor> MakeRootSift() { return std::make_shared<Sift>(true); }
std::shared_ptr<const Descriptor> MakeOrb() { return std::make_shared<Orb>(); }

}  // namespace pliant
