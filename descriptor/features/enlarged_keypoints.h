// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Keypoints of an image above its usual size. Small prints have few keypoints, and most of them are
// too fine for a detector at the image's own size. So the image is enlarged first. Prints a fifth
// as wide as a street photo have many keypoints in a second pass at high resolution, which uses
// more of the photo's pixels.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "descriptor/features/keypoints.h"
#include "descriptor/image/image.h"

namespace pliant {

struct EnlargedKeypoints {
  Image image;                   // grey; empty when the given one is too large to be enlarged
  std::vector<Keypoint> inside;  // in pixels of `image`, where they are described
  std::vector<Keypoint> placed;  // the same ones in pixels of the given image
};

// Enlarges `grey` to twice its size, but not beyond 1024 pixels or `max_side_px` (0 = no such
// limit) on the longer side, and detects keypoints there, at most options.max_keypoints. Omits
// those that `known` (in pixels of `grey`) has already: duplicates break the ratio test of
// matching, in which the second nearest must be clearly farther away. Thread-safe.
EnlargedKeypoints DetectEnlarged(const Image& grey, std::span<const Keypoint> known,
                                 int max_side_px, const KeypointOptions& options, int threads = 1);

// From pixels of an image scaled by `scale` to pixels of the original: centres are at integers.
void ScaleToOriginal(std::vector<Keypoint>& keypoints, double scale);

// A part of an image in more of its own pixels than the whole image is decoded with.
struct PartView {
  DecodedImage decoded;  // of the part and a margin around it: `image`; the rest is of the whole
  Region inside;         // the part, in pixels of decoded.image
  double left = 0;       // of decoded.image in the whole image, in pixels of the original
  double top = 0;
};

// The size of the part inside an image of that size; 0 if it lies outside.
double LongerSide(const Region& part, int width, int height);

// Decodes the part so that its longer side has at most `side_px` pixels (0 = no limit), but the
// whole image at most 4096, or options.max_side_px where that is more. Never enlarges. The margin
// is the surroundings that descriptors use at the part's edge. Absent where the part lies outside
// the image. Throws what `decode` throws. Thread-safe as `decode` is.
std::optional<PartView> DecodePart(Bytes encoded, const Region& part, int side_px,
                                   const ImageDecoder& decode, const DecodeOptions& options);

// The longer side, in pixels, of an image in the second pass: three times `longer_side_px`, that of
// the original, but at most 1.5 times `max_side_px` (0 = 1024). Absent unless that is a quarter
// more than the sides used for its own keypoints and for DetectEnlarged.
std::optional<int> SecondPassSide(double longer_side_px, int max_side_px);

// Detects keypoints in `grey`, once it is `factor` (at least 1) times as large: the strongest
// options.max_keypoints of options.inside, without those that `known` has already. All places are
// in pixels of `grey`. The image comes in strips of the same size, which overlap, so that the
// description of a strip needs no more memory than that of an image of the usual size. A keypoint
// belongs to the strip in whose middle it lies. Thread-safe.
std::vector<EnlargedKeypoints> DetectAtHighResolution(const Image& grey,
                                                      std::span<const Keypoint> known,
                                                      double factor, const KeypointOptions& options,
                                                      int threads = 1);

}  // namespace pliant
