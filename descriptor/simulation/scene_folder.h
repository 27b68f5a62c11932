// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Scenes as folders of images, for the matching benchmark and for retrieval. Part of the
// descriptor library, not of the simulator's core (PNG and JPEG need OpenCV).
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "descriptor/simulation/scene.h"

namespace pliant::simulation {

// "scene_000042": `digits` is the least number of digits.
std::string NumberedName(std::string_view stem, std::uint64_t number, int digits);

// view_NN.png, view_NN.uv.png and scene.json; see FORMAT in this folder's README. Written beside
// the target and renamed. Throws Error kNoSpace "file_unwritable".
void WriteSceneFolder(const std::filesystem::path& folder, const Scene& scene);

// view_NN.jpg, and view 0 as ref.jpg (omitted for distractors: `with_reference` false).
void WriteObjectFolder(const std::filesystem::path& folder, const Scene& scene,
                       bool with_reference);

}  // namespace pliant::simulation
