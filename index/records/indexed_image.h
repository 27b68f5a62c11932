// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What a ranker knows of an image. Plain values.
#pragma once

#include <cstdint>
#include <string>

#include "vocab/quantizer.h"

namespace pliant {

// Whatever else a ranker needs of an image comes here, beside the words (codes of descriptors, for
// example): the change feed fills it, segments keep it.
struct IndexedImage {
  std::int64_t key = 0;     // ImageRef::version: unique, never used twice
  std::int64_t object = 0;  // 0 = no object
  std::string id;           // breaks ties of the score
  Bow bow;
};

}  // namespace pliant
