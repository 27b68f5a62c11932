// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Keypoints that a closer look at an image finds: in more of its pixels than it is described with
// otherwise, or enlarged further. Prints that take up a fifth of a street photograph have many of
// theirs there.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "descriptor/features/enlarged_keypoints.h"
#include "descriptor/features/keypoints.h"
#include "descriptor/image/image.h"

namespace pliant {

// A part of an image in more of its own pixels than the whole image is decoded with.
struct PartView {
  DecodedImage decoded;  // of the part and a margin around it: `image`; the rest is of the whole
  Region inside;         // the part, in pixels of decoded.image
  double left = 0;       // of decoded.image in the whole image, in pixels of the original
  double top = 0;
};

// Of what an image of that size has of the part; 0 where it lies outside.
double LongerSide(const Region& part, int width, int height);

// Decodes the part so that its longer side has at most `side_px` pixels (0 = no limit), but the
// whole image at most 4096, or options.max_side_px where that is more. Never enlarges. The margin
// is what descriptors see around keypoints at the part's edge. Absent where the part lies outside
// the image. Throws what `decode` throws. Thread-safe as `decode` is.
std::optional<PartView> DecodePart(Bytes encoded, const Region& part, int side_px,
                                   const ImageDecoder& decode, const DecodeOptions& options);

// The longer side, in pixels, at which an image is looked at more closely than by its own keypoints
//  and those of DetectEnlarged: three times `longer_side_px`, that of the original, but not
// beyond 1.5 times `max_side_px` (0 = 1024). Absent where that is not a quarter more.
std::optional<int> CloserSide(double longer_side_px, int max_side_px);

// Detects keypoints in `grey`, which shows the original scaled by `scale`, once it is `factor`
// (at least 1) times as large: the strongest options.max_keypoints of options.inside (in pixels of
// `grey`), without those that `known` has already.
// `known` and EnlargedKeypoints::placed are in pixels of the original. The image comes in strips
// of the same size, which overlap, so that neither OpenCV's pyramid (230 bytes a pixel) nor what
// describes the strip takes more memory than for an image of the usual size; a keypoint is
// listed with the strip whose middle it lies in. Thread-safe.
std::vector<EnlargedKeypoints> DetectCloser(const Image& grey, double scale,
                                            std::span<const Keypoint> known, double factor,
                                            const KeypointOptions& options);

}  // namespace pliant
