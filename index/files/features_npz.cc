// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/files/features_npz.h"

#include <array>
#include <cstdint>
#include <string_view>
#include <utility>

namespace pliant {
namespace {

template <typename Value>
std::string_view ViewOf(const std::vector<Value>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(Value)};
}

}  // namespace

std::vector<float> KeypointRows(const Features& features) {
  std::vector<float> rows;
  for (const Keypoint& k : features.keypoints) {
    rows.insert(rows.end(), {k.x, k.y, k.size, k.angle, k.response, static_cast<float>(k.octave)});
  }
  return rows;
}

void AddFeatures(NpzArchive& archive, const Features& features) {
  const Descriptors& d = features.descriptors;
  const bool is_float = d.kind == DescriptorKind::kFloat;
  const std::array<std::int64_t, 2> points = {static_cast<std::int64_t>(features.keypoints.size()),
                                              6};
  const std::array<std::int64_t, 2> rows = {static_cast<std::int64_t>(d.rows), d.dim};
  archive.Add("keypoints", "<f4", points, ViewOf(KeypointRows(features)));
  archive.Add("descriptors", is_float ? "<f4" : "|u1", rows,
              is_float ? ViewOf(d.floats) : ViewOf(d.bytes));
  archive.AddText("model_id", features.model_id);
}

std::string FeaturesNpz(const Features& features) {
  NpzArchive archive;
  AddFeatures(archive, features);
  for (const auto& [name, value] :
       {std::pair{"width", features.width}, {"height", features.height}}) {
    const std::vector<std::int64_t> single = {value};
    archive.Add(name, "<i8", {}, ViewOf(single));
  }
  return archive.Finish();
}

}  // namespace pliant
