// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <memory>

#include <opencv2/features2d.hpp>

#include "descriptor/base/error.h"
#include "descriptor/features/baselines.h"
#include "descriptor/features/cv_binary.h"
#include "descriptor/image/cv_image.h"

namespace pliant {
namespace {

class Brisk : public Descriptor {
 public:
  const DescriptorInfo& info() const override { return info_; }

  Descriptors Describe(const Image& grey, std::span<const Keypoint> keypoints,
                       int /*threads*/) const override {
    CheckGrey(grey);
    Descriptors result = Descriptors::Binary(keypoints.size(), kDim);
    if (keypoints.empty()) return result;
    float largest = 0;
    for (const Keypoint& k : keypoints) largest = std::max(largest, k.size);
    // OpenCV drops key points whose pattern does not fit in: the picture gets a border.
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
      throw Error(ErrorCode::kInternal, "brisk_rows", "OpenCV's BRISK dropped key points");
    }
    TakeRows(described, given, result);
    return result;
  }

 private:
  static constexpr int kDim = 64;
  // BRISK's size over SIFT's: the pattern then covers 4.6 times the key point's size around it, as
  // SIFT's and ORB's do.
  static constexpr float kSizeFactor = 3.0F;
  static constexpr float kPatternRadius = 1.6F;  // of the pattern, times BRISK's size
  static constexpr float kLargestSize = 210.0F;  // BRISK's patterns do not grow beyond it

  DescriptorInfo info_{
      .name = "brisk", .kind = DescriptorKind::kBinary, .dim = kDim, .model_id = "brisk:1"};
};

}  // namespace

std::shared_ptr<const Descriptor> MakeBrisk() { return std::make_shared<Brisk>(); }

}  // namespace pliant
