// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A part of a picture in more of its own pixels than the whole picture is decoded with.
#pragma once

#include <optional>

#include "descriptor/image/image.h"

namespace pliant {

struct PartView {
  DecodedImage decoded;  // of the part and a margin around it: `image`; the rest is of the whole
  Region inside;         // the part, in pixels of decoded.image
  double left = 0;       // of decoded.image in the whole picture, in pixels of the original
  double top = 0;
};

// Of what a picture of that size has of the part; 0 where it lies outside.
double LongerSide(const Region& part, int width, int height);

// Decodes the part so that its longer side has at most `side_px` pixels (0 = no limit), but the
// whole picture at most 4096, or options.max_side_px where that is more. Never enlarges. The margin
// is what descriptors see around key points at the part's edge. Absent where the part lies outside
// the picture. Throws what `decode` throws. Thread-safe as `decode` is.
std::optional<PartView> DecodePart(Bytes encoded, const Region& part, int side_px,
                                   const ImageDecoder& decode, const DecodeOptions& options);

}  // namespace pliant
