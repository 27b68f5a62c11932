// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace pliant {

inline constexpr int kMostParts = 4096;

// The images of which a process holds the index: those whose id has a hash in this part of all
// hashes.
struct IndexShare {
  int part = 1;   // 1..parts
  int parts = 1;  // 1 = all images

  bool operator==(const IndexShare&) const = default;
};

}  // namespace pliant
