// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/simulation/scene_file.h"

#include <array>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <initializer_list>

#include "descriptor/simulation/tensor_file.h"

namespace pliant::simulation {
namespace {

template <typename Value>
void Append(std::vector<std::uint8_t>& bytes, const std::vector<Value>& values) {
  const std::size_t begin = bytes.size();
  bytes.resize(begin + values.size() * sizeof(Value));
  std::memcpy(bytes.data() + begin, values.data(), values.size() * sizeof(Value));
}

std::string Number(float value) {
  if (!std::isfinite(value)) return "null";
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.6g", static_cast<double>(value));
  return text.data();
}

std::string Numbers(const float* values, int count) {
  std::string out = "[";
  for (int i = 0; i < count; ++i) out.append(i > 0 ? "," : "").append(Number(values[i]));
  return out + ']';
}

std::string Fields(std::initializer_list<std::pair<const char*, float>> fields) {
  std::string out = "{";
  for (const auto& [name, value] : fields)
    out.append(out.size() > 1 ? "," : "").append(JsonQuote(name)).append(":").append(Number(value));
  return out + '}';
}

std::string CameraJson(const Camera& camera) {
  const Eigen::Matrix<float, 3, 3, Eigen::RowMajor> rotation = camera.rotation;
  return "{\"focal_px\":" + Number(camera.focal_px) + ",\"centre_px\":[" + Number(camera.centre_x) +
         ',' + Number(camera.centre_y) + "],\"rotation\":" + Numbers(rotation.data(), 9) +
         ",\"translation\":" + Numbers(camera.translation.data(), 3) + '}';
}

std::string LightingJson(const Lighting& lighting) {
  std::string out = "{\"ambient\":" + Numbers(lighting.ambient.data(), 3) + ",\"lights\":[";
  for (const Light& light : lighting.lights) {
    if (out.back() != '[') out += ',';
    out += "{\"position\":" + Numbers(light.position.data(), 3) +
           ",\"colour\":" + Numbers(light.colour.data(), 3) +
           ",\"near\":" + (light.near ? "true" : "false") + '}';
  }
  return out + "]}";
}

// Nothing where the photograph is as it was taken.
std::string DevelopJson(const View& view) {
  if (!view.develop) return "";
  const DevelopOptions& develop = *view.develop;
  return ",\"develop\":" + Fields({{"enlarge", develop.enlarge},
                                   {"contrast", develop.contrast},
                                   {"smear", develop.smear},
                                   {"sharpen", develop.sharpen},
                                   {"jpeg_quality", static_cast<float>(develop.jpeg_quality)}});
}

}  // namespace

std::string SceneFileName(std::uint64_t index) {
  std::array<char, 48> name{};
  std::snprintf(name.data(), name.size(), "scene_%06llu.safetensors",
                static_cast<unsigned long long>(index));
  return name.data();
}

std::string ViewJson(const View& view) {
  const Framing& framing = view.framing;
  const PhotoOptions& photo = view.photo;
  return "{\"motion\":" + JsonQuote(view.motion) + ",\"backdrop\":" + JsonQuote(view.backdrop) +
         ",\"stretch_p95\":" + Number(view.stretch_p95) + ",\"camera\":" + CameraJson(view.camera) +
         ",\"framing\":" +
         Fields({{"roll_deg", framing.roll_deg},
                 {"tilt_deg", framing.tilt_deg},
                 {"tilt_direction_deg", framing.tilt_direction_deg},
                 {"scale", framing.scale},
                 {"distance", framing.distance}}) +
         ",\"lighting\":" + LightingJson(view.lighting) + ",\"photo\":" +
         Fields({{"exposure", photo.exposure},
                 {"gamma", photo.gamma},
                 {"vignette", photo.vignette},
                 {"defocus_px", photo.defocus_px},
                 {"motion_px", photo.motion_px},
                 {"read_noise", photo.read_noise},
                 {"shot_noise", photo.shot_noise},
                 {"jpeg_quality", static_cast<float>(photo.jpeg_quality)}}) +
         DevelopJson(view) + '}';
}

void WriteSceneFile(const std::filesystem::path& path, const Scene& scene) {
  const std::size_t views = scene.views.size();
  const auto height = static_cast<std::size_t>(scene.views.front().image.height);
  const auto width = static_cast<std::size_t>(scene.views.front().image.width);
  const std::size_t charts = scene.chart_sizes.size();
  Tensor images{"images", "U8", {views, height, width}, {}};
  if (scene.views.front().image.channels == 3) images.shape.push_back(3);
  Tensor chart{"chart", "U8", {views, height, width}, {}};
  Tensor uv{"uv", "U16", {views, height, width, 2}, {}};
  Tensor grid{"grid_xy",
              "F32",
              {views, charts, static_cast<std::size_t>(scene.grid_rows),
               static_cast<std::size_t>(scene.grid_columns), 2},
              {}};
  Tensor size{"grid_size", "F32", {charts, 2}, {}};
  std::string view_list = "[";
  for (const View& view : scene.views) {
    Append(images.bytes, view.image.pixels);
    Append(chart.bytes, view.chart);
    Append(uv.bytes, view.uv);
    Append(grid.bytes, view.grid);
    view_list.append(view_list.size() > 1 ? "," : "").append(ViewJson(view));
  }
  Append(size.bytes, scene.chart_sizes);
  std::string textures = "[";
  for (const std::string& name : scene.textures)
    textures.append(textures.size() > 1 ? "," : "").append(JsonQuote(name));
  // The wide tensors first, so that every tensor is aligned to its type.
  WriteTensorFile(path, {grid, size, uv, images, chart},
                  {{"format", kSceneFormat},
                   {"preset", ToString(scene.preset)},
                   {"kind", ToString(scene.kind)},
                   {"textures", textures + ']'},
                   {"seed", std::to_string(scene.seed)},
                   {"scene", std::to_string(scene.index)},
                   {"views", view_list + ']'}});
}

}  // namespace pliant::simulation
