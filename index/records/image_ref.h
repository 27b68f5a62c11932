// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Names of what a store keeps. Plain values.
#pragma once

#include <cstdint>
#include <string>

namespace pliant {

// Of a collection, an object or a vocabulary; 0 = none.
using Key = std::int64_t;

// One state of one image. An image that is replaced keeps collection and id and gets a greater
// version; no two states of any images of a store share a version.
struct ImageRef {
  Key collection = 0;
  std::string id;
  std::int64_t version = 0;  // 0 = the present one, whichever that is
};

}  // namespace pliant
