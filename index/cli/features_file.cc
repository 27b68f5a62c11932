// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/cli/features_file.h"

#include <cstdint>
#include <cstring>
#include <string>
#include <system_error>
#include <vector>

#include "descriptor/base/error.h"
#include "descriptor/base/safetensors.h"

namespace pliant::cli {
namespace {

template <typename Value>
std::vector<std::uint8_t> BytesOf(const std::vector<Value>& values) {
  std::vector<std::uint8_t> bytes(values.size() * sizeof(Value));
  if (!bytes.empty()) std::memcpy(bytes.data(), values.data(), bytes.size());
  return bytes;
}

}  // namespace

void WriteFeatures(const std::filesystem::path& path, const Features& features) {
  const Descriptors& d = features.descriptors;
  const bool is_float = d.kind == DescriptorKind::kFloat;
  std::vector<float> keypoints;
  for (const Keypoint& k : features.keypoints) {
    keypoints.insert(keypoints.end(),
                     {k.x, k.y, k.size, k.angle, k.response, static_cast<float>(k.octave)});
  }
  const auto points = static_cast<std::int64_t>(features.keypoints.size());
  const auto rows = static_cast<std::int64_t>(d.rows);
  const std::error_code error =
      WriteSafetensors(path,
                       {{"keypoints", "F32", {points, 6}, BytesOf(keypoints)},
                        {"descriptors",
                         is_float ? "F32" : "U8",
                         {rows, d.dim},
                         is_float ? BytesOf(d.floats) : BytesOf(d.bytes)}},
                       {{"model_id", features.model_id},
                        {"width", std::to_string(features.width)},
                        {"height", std::to_string(features.height)}});
  if (error) {
    throw Error(ErrorCode::kNoSpace, "write_failed",
                path.string() + " could not be written: " + error.message());
  }
}

}  // namespace pliant::cli
