// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Features as arrays of a NumPy archive: `keypoints` float32 N x 6 (x, y, size, angle, response,
// octave), `descriptors` float32 or uint8 N x D, and `model_id` (text).
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "descriptor/features/features.h"
#include "index/files/npz_archive.h"

namespace pliant {

// N x 6, row-major.
std::vector<float> KeypointRows(const Features& features);

// The whole file of one image, with the single values `width` and `height` (int64), pixels of the
// upright image, beside.
std::string FeaturesNpz(const Features& features);

// What the arrays of several images will be.
struct FeatureTotals {
  std::int64_t images = 0;
  std::int64_t rows = 0;
  DescriptorKind kind = DescriptorKind::kFloat;
  int dim = 0;
  std::string model_id;
  std::size_t name_length = 1;    // characters of the longest
  std::size_t object_length = 0;  // likewise; 0: there are no objects

  void Count(std::string_view name, std::size_t keypoints);
};

// Features of several images: the rows of all, one image after the other; `names` (text) P;
// `objects` (text) P, if the totals say so; `starts` int64 P + 1, where image i has the rows
// starts[i] .. starts[i + 1]; `width` and `height` int64 P. Any number: nothing stays in memory.
class FeaturesArchive {
 public:
  FeaturesArchive(const FeatureTotals& totals, NpzArchive::Write write);

  std::uint64_t bytes() { return archive_.bytes(); }  // of the whole file
  // In all as many as the totals say, else kInternal "archive_incomplete".
  void Add(std::string_view name, std::string_view object, const Features& features);
  void Finish();

 private:
  void AddNumber(std::size_t array, std::int64_t value);

  const FeatureTotals totals_;
  NpzArchive archive_;
  std::int64_t rows_ = 0;  // so far
  std::size_t keypoints_, descriptors_, names_, objects_ = 0, starts_, width_, height_;
};

}  // namespace pliant
