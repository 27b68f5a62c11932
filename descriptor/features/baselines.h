// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The classical descriptors Pliant is compared with. Internal to the descriptor library;
// callers use MakeDescriptor.
#pragma once

#include <memory>

#include "descriptor/features/descriptor.h"

namespace pliant {

// SIFT (Lowe 2004), 128 floats of 0..255.
std::shared_ptr<const Descriptor> MakeSift();

// RootSIFT (Arandjelovic and Zisserman 2012): square root of the L1-normalised SIFT; unit length.
std::shared_ptr<const Descriptor> MakeRootSift();

// ORB (Rublee et al. 2011), 32 bytes, at the key points given: each is described on the level of
// a scale pyramid that its size asks for, turned by its angle.
std::shared_ptr<const Descriptor> MakeOrb();

// BRISK (Leutenegger et al. 2011), 64 bytes; the pattern is scaled by the key point's size and
// turned by its angle.
std::shared_ptr<const Descriptor> MakeBrisk();

// DAISY (Tola et al. 2010), 200 floats of unit length in all, of patches turned and scaled alike.
std::shared_ptr<const Descriptor> MakeDaisy();

// Throws kInvalidArgument "not_grey".
void CheckGrey(const Image& grey);

}  // namespace pliant
