// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Reading what a picture file's header says, format by format, without decoding pixels.
// Internal to the descriptor library; callers use ReadImageHeader of image.h.
#pragma once

#include "descriptor/image/image.h"

namespace pliant {

// Type by content ("magic" bytes), never by name. kUnknown when no type fits.
ImageFormat SniffFormat(Bytes bytes);

// Throws Error "image_truncated" when the file ends before its own structure says it does:
// JPEG without an end marker, PNG without IEND, WebP/BMP/TIFF data beyond the end of the file.
void CheckComplete(Bytes bytes, ImageFormat format);

}  // namespace pliant
