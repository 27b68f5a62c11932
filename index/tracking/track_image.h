// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Visualisation of tracking: the mesh over the frame, the flattened object beside it, and a contact
// sheet of many frames.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "descriptor/image/image.h"
#include "index/tracking/pipeline.h"

namespace pliant {

// The template as the frame shows it: un-warped, template.width x height, colour; crossed out when
// the object is lost.
Image DrawUnwarped(const Image& frame, const Location& location, const PixelBox& box);

// "frame 12  3.4 s  inliers 120/210" or "frame 12  3.4 s  lost: too few keypoints match".
std::string Caption(const TrackedFrame& tracked);

// The frame with the mesh (where it is trusted), the outline and the caption, and DrawUnwarped at
// the same height beside it. All images of one tracker have one size.
Image DrawTracked(const TrackedFrame& tracked, const PixelBox& box);

// Collects any number of frames and shows a few of them.
class ContactSheet {
 public:
  // `reference` is the template's cut-out image. At most `cells` frames will be shown.
  ContactSheet(Image reference, int cells = 12);

  void Add(const TrackedFrame& tracked, const PixelBox& box);
  // The template first, then frames at equal intervals, each with the flattened object beside it.
  // At least one frame must have been added: kInvalidArgument otherwise.
  Image Draw(const std::string& title) const;

 private:
  struct Cell {
    Image image;
    std::string caption;
  };

  Image reference_;
  std::size_t cells_;
  std::int64_t seen_ = 0;
  std::int64_t step_ = 1;   // every step_-th frame is kept
  std::vector<Cell> kept_;  // at most twice as many as are shown
};

}  // namespace pliant
