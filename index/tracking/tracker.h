// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Tracks a region of a template image through frames while the object bends (Potje et al. 2021,
// section 4.3). Every frame is processed independently, so a lost object is found again.
#pragma once

#include <memory>
#include <optional>

#include "descriptor/features/descriptor.h"
#include "descriptor/image/image.h"
#include "index/verify/locate.h"

namespace pliant {

// The keypoints of `features` inside the box where `mask` (empty, or a grey image of the size of
// the features' image) is not 0, the first `most` of them, in pixels of the box.
Features FeaturesInside(const Features& features, const PixelBox& box, const Image& mask,
                        std::size_t most);

// The smallest box around the non-zero pixels of a grey image, if there are any.
std::optional<PixelBox> BoxOfMask(const Image& mask);

struct TrackerOptions {
  ExtractionOptions extraction;  // of the template's region and of each frame
  LocateOptions locate;
  std::optional<PixelBox> region;  // nullopt: the bounding box of the mask, or the whole image
  // Grey, of the template image's size, 0 outside the object; empty: the whole region.
  Image mask;
  int threads = 0;  // for the description of one frame; 0 = all cores
};

// Immutable and thread-safe.
class Tracker {
 public:
  // Describes the template. Throws kInvalidArgument "region_invalid" for a region that does not lie
  // within the image or is below 16 x 16, "mask_invalid", what Validate throws; kUnprocessable
  // "too_few_features" for a region without enough keypoints.
  Tracker(std::shared_ptr<const Descriptor> descriptor, const Image& reference,
          TrackerOptions options);

  // The template: the region's box. Locations map its pixels.
  const PixelBox& box() const { return box_; }
  const Image& image() const { return image_; }  // the cropped box
  const Features& features() const { return features_; }
  const TrackerOptions& options() const { return options_; }

  Features Describe(const Image& frame) const;
  Location Find(const Features& frame) const;

 private:
  TrackerOptions options_;
  FeatureExtractor extractor_;
  PixelBox box_;
  Image image_;
  Features features_;
};

}  // namespace pliant
