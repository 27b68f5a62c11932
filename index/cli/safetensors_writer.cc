// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/cli/safetensors_writer.h"

#include <array>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include "index/cli/write_file.h"

namespace pliant::cli {
namespace {

using Json = nlohmann::ordered_json;

Json Tensor(const char* type, std::size_t rows, std::size_t columns, std::size_t begin,
            std::size_t bytes) {
  return {{"dtype", type}, {"shape", {rows, columns}}, {"data_offsets", {begin, begin + bytes}}};
}

}  // namespace

void WriteSafetensors(const std::filesystem::path& path, const Features& features) {
  const Descriptors& d = features.descriptors;
  const bool is_float = d.kind == DescriptorKind::kFloat;
  std::vector<float> keypoints;
  for (const Keypoint& k : features.keypoints) {
    keypoints.insert(keypoints.end(),
                     {k.x, k.y, k.size, k.angle, k.response, static_cast<float>(k.octave)});
  }
  const std::size_t keypoint_bytes = keypoints.size() * sizeof(float);
  const char* data = is_float ? reinterpret_cast<const char*>(d.floats.data())
                              : reinterpret_cast<const char*>(d.bytes.data());
  const std::size_t data_bytes = is_float ? d.floats.size() * sizeof(float) : d.bytes.size();
  std::string header = Json{
      {"__metadata__",
       {{"model_id", features.model_id},
        {"width", std::to_string(features.width)},
        {"height", std::to_string(features.height)}}},
      {"keypoints", Tensor("F32", features.keypoints.size(), 6, 0, keypoint_bytes)},
      {"descriptors",
       Tensor(is_float ? "F32" : "U8", d.rows, static_cast<std::size_t>(d.dim), keypoint_bytes,
              data_bytes)}}.dump();
  header.resize((header.size() + 7) / 8 * 8, ' ');
  const std::uint64_t length = header.size();

  const std::array<std::string_view, 4> parts = {
      std::string_view(reinterpret_cast<const char*>(&length), sizeof(length)), header,
      std::string_view(reinterpret_cast<const char*>(keypoints.data()), keypoint_bytes),
      std::string_view(data, data_bytes)};
  WriteFile(path, parts);
}

}  // namespace pliant::cli
