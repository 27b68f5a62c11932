// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The classical descriptors with which Pliant is compared. Internal to the descriptor library;
// callers use MakeDescriptor.
#pragma once

#include <memory>

#include "descriptor/features/descriptor.h"

namespace pliant {

// SIFT (Lowe 2004), 128 floats of 0..255.
std::shared_ptr<const Descriptor> MakeSift();

// RootSIFT (Arandjelovic and Zisserman 2012): square root of the L1-normalised SIFT; unit length.
std::shared_ptr<const Descriptor> MakeRootSift();

// ORB (Rublee et al. 2011), 32 bytes, at given keypoints: each is described on the level of a
// scale pyramid that matches its size, rotated by its angle.
std::shared_ptr<const Descriptor> MakeOrb();

// BRISK (Leutenegger et al. 2011), 64 bytes; the pattern is scaled by the keypoint's size and
// rotated by its angle.
std::shared_ptr<const Descriptor> MakeBrisk();

// DAISY (Tola et al. 2010), 200 floats, normalised to unit length as a whole; patches are rotated
// and scaled in the same way.
std::shared_ptr<const Descriptor> MakeDaisy();

}  // namespace pliant
