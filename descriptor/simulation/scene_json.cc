// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/simulation/scene_json.h"

#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <utility>

#include <nlohmann/json.hpp>

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

}  // namespace pliant::simulation
