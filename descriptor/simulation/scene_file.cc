// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/simulation/scene_file.h"

#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <initializer_list>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "descriptor/base/error.h"
#include "descriptor/base/safetensors.h"

namespace pliant::simulation {
namespace {

using Json = nlohmann::ordered_json;

// Six digits are as many as a float can promise; null where there is no number.
Json Number(float value) {
  if (!std::isfinite(value)) return nullptr;
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.6g", static_cast<double>(value));
  return std::strtod(text.data(), nullptr);
}

Json Numbers(const float* values, int count) {
  Json list = Json::array();
  for (int i = 0; i < count; ++i) list.push_back(Number(values[i]));
  return list;
}

Json CameraJson(const Camera& camera) {
  const Eigen::Matrix<float, 3, 3, Eigen::RowMajor> rotation = camera.rotation;
  return {{"focal_px", Number(camera.focal_px)},
          {"centre_px", Json::array({Number(camera.centre_x), Number(camera.centre_y)})},
          {"rotation", Numbers(rotation.data(), 9)},
          {"translation", Numbers(camera.translation.data(), 3)}};
}

Json LightingJson(const Lighting& lighting) {
  Json lights = Json::array();
  for (const Light& light : lighting.lights) {
    lights.push_back({{"position", Numbers(light.position.data(), 3)},
                      {"colour", Numbers(light.colour.data(), 3)},
                      {"near", light.near}});
  }
  return {{"ambient", Numbers(lighting.ambient.data(), 3)}, {"lights", std::move(lights)}};
}

Json FramingJson(const Framing& framing) {
  return {{"roll_deg", Number(framing.roll_deg)},
          {"tilt_deg", Number(framing.tilt_deg)},
          {"tilt_direction_deg", Number(framing.tilt_direction_deg)},
          {"scale", Number(framing.scale)},
          {"distance", Number(framing.distance)}};
}

Json PhotoJson(const PhotoOptions& photo) {
  return {{"exposure", Number(photo.exposure)},     {"gamma", Number(photo.gamma)},
          {"vignette", Number(photo.vignette)},     {"defocus_px", Number(photo.defocus_px)},
          {"motion_px", Number(photo.motion_px)},   {"read_noise", Number(photo.read_noise)},
          {"shot_noise", Number(photo.shot_noise)}, {"jpeg_quality", photo.jpeg_quality}};
}

Json DevelopJson(const DevelopOptions& develop) {
  return {{"enlarge", Number(develop.enlarge)},
          {"contrast", Number(develop.contrast)},
          {"smear", Number(develop.smear)},
          {"sharpen", Number(develop.sharpen)},
          {"jpeg_quality", develop.jpeg_quality}};
}

template <typename Value>
void Append(std::vector<std::uint8_t>& bytes, const std::vector<Value>& values) {
  const auto* raw = reinterpret_cast<const std::uint8_t*>(values.data());
  bytes.insert(bytes.end(), raw, raw + values.size() * sizeof(Value));
}

TensorShape Shape(std::initializer_list<std::size_t> extents) {
  TensorShape shape;
  for (const std::size_t extent : extents) shape.push_back(static_cast<std::int64_t>(extent));
  return shape;
}

}  // namespace

Json ViewJson(const View& view) {
  Json json = {{"motion", view.motion},
               {"backdrop", view.backdrop},
               {"stretch_p95", Number(view.stretch_p95)},
               {"camera", CameraJson(view.camera)},
               {"framing", FramingJson(view.framing)},
               {"lighting", LightingJson(view.lighting)},
               {"photo", PhotoJson(view.photo)}};
  if (view.develop) json["develop"] = DevelopJson(*view.develop);  // else it is as it was taken
  return json;
}

std::string JsonText(const Json& json, bool indented) {
  return json.dump(indented ? 2 : -1, ' ', false, Json::error_handler_t::replace);
}

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
