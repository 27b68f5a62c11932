// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What a ranker knows of a picture. Plain values.
#pragma once

#include <cstdint>
#include <string>

#include "vocab/quantizer.h"

namespace pliant {

// Whatever else a ranker needs of a picture comes here, beside the words (codes of descriptors, for
// example): the change feed fills it, segments keep it.
struct IndexedPicture {
  std::int64_t key = 0;     // PictureRef::version: unique, never used twice
  std::int64_t object = 0;  // 0 = no object
  std::string id;           // breaks ties of the score
  Bow bow;
};

}  // namespace pliant
