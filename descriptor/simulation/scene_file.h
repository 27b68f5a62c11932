// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Scenes on disk for training; see the section FORMAT of this folder's README.
#pragma once

#include <filesystem>
#include <string>

#include <nlohmann/json_fwd.hpp>

#include "descriptor/simulation/scene.h"

namespace pliant::simulation {

// Camera, lights, photo, framing, motion of one view as a JSON object.
nlohmann::ordered_json ViewJson(const View& view);

// On one line, or indented by two. Invalid UTF-8 (a texture's file name) is replaced by U+FFFD.
std::string JsonText(const nlohmann::ordered_json& json, bool indented = false);

inline constexpr const char* kSceneFormat = "pliant-scene 1";

// "scene_000042.safetensors".
std::string SceneFileName(std::uint64_t index);

// One safetensors file: images, chart, uv, grid_xy, grid_size and metadata. Colour images make
// `images` [V, H, W, 3]. Throws Error kNoSpace "file_unwritable".
void WriteSceneFile(const std::filesystem::path& path, const Scene& scene);

}  // namespace pliant::simulation
