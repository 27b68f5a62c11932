// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/tracking/tracker.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <utility>

#include "descriptor/base/error.h"

namespace pliant {
namespace {

constexpr int kLeastSide = 16;
// Share of the box that is described around it, so that keypoints at its border have context.
constexpr double kMargin = 0.25;

PixelBox FindBox(const Image& reference, const TrackerOptions& options) {
  const Image& mask = options.mask;
  if (!mask.empty() &&
      (mask.channels != 1 || mask.width != reference.width || mask.height != reference.height)) {
    throw Error(ErrorCode::kInvalidArgument, "mask_invalid",
                "the mask must have the size of the template image, " +
                    std::to_string(reference.width) + " x " + std::to_string(reference.height));
  }
  PixelBox box{0, 0, reference.width, reference.height};
  if (options.region) {
    box = *options.region;
  } else if (!mask.empty()) {
    const std::optional<PixelBox> found = BoxOfMask(mask);
    if (!found) {
      throw Error(ErrorCode::kInvalidArgument, "mask_invalid",
                  "the mask is all black; paint the object white");
    }
    box = *found;
  }
  if (box.x < 0 || box.y < 0 || box.width < kLeastSide || box.height < kLeastSide ||
      box.x > reference.width - box.width || box.y > reference.height - box.height) {
    throw Error(ErrorCode::kInvalidArgument, "region_invalid",
                "the region must lie within the template image (" +
                    std::to_string(reference.width) + " x " + std::to_string(reference.height) +
                    " pixels) and be at least " + std::to_string(kLeastSide) +
                    " pixels wide and high");
  }
  return box;
}

PixelBox WithMargin(const PixelBox& box, const Image& reference) {
  const int margin = static_cast<int>(std::lround(kMargin * std::max(box.width, box.height)));
  const int left = std::max(0, box.x - margin);
  const int top = std::max(0, box.y - margin);
  return {left, top, std::min(reference.width, box.x + box.width + margin) - left,
          std::min(reference.height, box.y + box.height + margin) - top};
}

}  // namespace

std::optional<PixelBox> BoxOfMask(const Image& mask) {
  int left = mask.width, top = mask.height, right = -1, bottom = -1;
  for (int y = 0; y < mask.height; ++y) {
    for (int x = 0; x < mask.width; ++x) {
      if (mask.pixels[static_cast<std::size_t>(y) * mask.width + x] == 0) continue;
      left = std::min(left, x), right = std::max(right, x);
      top = std::min(top, y), bottom = y;
    }
  }
  if (right < 0) return std::nullopt;
  return PixelBox{left, top, right - left + 1, bottom - top + 1};
}

Features FeaturesInside(const Features& features, const PixelBox& box, const Image& mask,
                        std::size_t most) {
  std::size_t taken = 0;
  Features inside = Subset(features, [&](const Keypoint& k) {
    const auto x = static_cast<int>(std::lround(k.x));
    const auto y = static_cast<int>(std::lround(k.y));
    return taken < most && x >= box.x && y >= box.y && x < box.x + box.width &&
           y < box.y + box.height &&
           (mask.empty() || mask.pixels[static_cast<std::size_t>(y) * mask.width + x] != 0) &&
           ++taken > 0;
  });
  for (Keypoint& k : inside.keypoints) {
    k.x -= static_cast<float>(box.x);
    k.y -= static_cast<float>(box.y);
  }
  inside.width = box.width;
  inside.height = box.height;
  inside.colours = {};
  return inside;
}

Tracker::Tracker(std::shared_ptr<const Descriptor> descriptor, const Image& reference,
                 TrackerOptions options)
    : options_([&options] {
        options.extraction.colour_side = 0;  // tracking does not use them
        return std::move(options);
      }()),
      extractor_(std::move(descriptor), options_.extraction),
      box_(FindBox(reference, options_)) {
  Validate(options_.locate);
  image_ = CutOut(reference, box_);
  const PixelBox around = WithMargin(box_, reference);
  // Keypoints of the margin must not push out those of the region.
  ExtractionOptions extraction = options_.extraction;
  const int most = extraction.keypoints.max_keypoints;
  extraction.keypoints.max_keypoints = std::min(4 * most, 4096);
  const FeatureExtractor extractor(
      std::shared_ptr<const Descriptor>(std::shared_ptr<void>(), &extractor_.descriptor()),
      extraction);
  const Features found = extractor.ExtractFrom(CutOut(reference, around), options_.threads, nullptr,
                                               ImageRole::kReference);
  const Image mask = options_.mask.empty() ? Image{} : CutOut(options_.mask, around);
  features_ = FeaturesInside(found, {box_.x - around.x, box_.y - around.y, box_.width, box_.height},
                             mask, static_cast<std::size_t>(most));
  const auto least = static_cast<std::size_t>(options_.locate.min_inliers);
  if (features_.keypoints.size() < least) {
    throw Error(ErrorCode::kUnprocessable, "too_few_features",
                "the template's region has " + std::to_string(features_.keypoints.size()) +
                    " keypoints; at least " + std::to_string(least) +
                    " are needed. Choose a larger region, or one with more texture");
  }
}

Features Tracker::Describe(const Image& frame) const {
  return extractor_.ExtractFrom(frame, options_.threads);
}

Location Tracker::Find(const Features& frame) const {
  const Verifier verifier(frame, options_.locate.verification);
  return Locate(verifier, frame, features_, options_.locate);
}

}  // namespace pliant
