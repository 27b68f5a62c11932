// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/simulation/scene_file.h"

#include <array>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <initializer_list>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "descriptor/base/error.h"
#include "descriptor/base/safetensors.h"
#include "descriptor/simulation/scene_json.h"

namespace pliant::simulation {
namespace {

template <typename Value>
void Append(std::vector<std::uint8_t>& bytes, const std::vector<Value>& values) {
  const std::size_t begin = bytes.size();
  bytes.resize(begin + values.size() * sizeof(Value));
  std::memcpy(bytes.data() + begin, values.data(), values.size() * sizeof(Value));
}

TensorShape Shape(std::initializer_list<std::size_t> extents) {
  TensorShape shape;
  for (const std::size_t extent : extents) shape.push_back(static_cast<std::int64_t>(extent));
  return shape;
}

}  // namespace

std::string SceneFileName(std::uint64_t index) {
  std::array<char, 48> name{};
  std::snprintf(name.data(), name.size(), "scene_%06llu.safetensors",
                static_cast<unsigned long long>(index));
  return name.data();
}

void WriteSceneFile(const std::filesystem::path& path, const Scene& scene) {
  const std::size_t views = scene.views.size();
  const auto height = static_cast<std::size_t>(scene.views.front().image.height);
  const auto width = static_cast<std::size_t>(scene.views.front().image.width);
  const std::size_t charts = scene.chart_sizes.size();
  Tensor images{"images", "U8", Shape({views, height, width}), {}};
  if (scene.views.front().image.channels == 3) images.shape.push_back(3);
  Tensor chart{"chart", "U8", Shape({views, height, width}), {}};
  Tensor uv{"uv", "U16", Shape({views, height, width, 2}), {}};
  Tensor grid{"grid_xy",
              "F32",
              Shape({views, charts, static_cast<std::size_t>(scene.grid_rows),
                     static_cast<std::size_t>(scene.grid_columns), 2}),
              {}};
  Tensor size{"grid_size", "F32", Shape({charts, 2}), {}};
  nlohmann::ordered_json view_list = nlohmann::ordered_json::array();
  for (const View& view : scene.views) {
    Append(images.bytes, view.image.pixels);
    Append(chart.bytes, view.chart);
    Append(uv.bytes, view.uv);
    Append(grid.bytes, view.grid);
    view_list.push_back(ViewJson(view));
  }
  Append(size.bytes, scene.chart_sizes);
  // The wide tensors first, so that every tensor is aligned to its type.
  const std::error_code error = WriteSafetensors(
      path, {std::move(grid), std::move(size), std::move(uv), std::move(images), std::move(chart)},
      {{"format", kSceneFormat},
       {"preset", ToString(scene.preset)},
       {"kind", ToString(scene.kind)},
       {"textures", JsonText(scene.textures)},
       {"seed", std::to_string(scene.seed)},
       {"scene", std::to_string(scene.index)},
       {"views", JsonText(view_list)}});
  if (error) {
    throw Error(ErrorCode::kNoSpace, "file_unwritable",
                "cannot write " + path.string() + " (" + error.message() +
                    "); is the folder writable and the disk not full?");
  }
}

}  // namespace pliant::simulation
