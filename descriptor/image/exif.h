// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// EXIF blocks, which have the form of a TIFF file (EXIF 2.3). Internal to the descriptor library.
#pragma once

#include "descriptor/image/image.h"

namespace pliant {

// The orientation (tag 0x0112), 1 to 8; 1 when it is not there or makes no sense. Takes time linear
// in the block's size.
int ReadOrientation(Bytes exif);

}  // namespace pliant
