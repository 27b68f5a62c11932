// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// One reader per layout, and their common parts. Internal to this folder.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include "descriptor/evaluation/dataset.h"

namespace pliant::evaluation {

// Each takes the files that identify its layout (scene files, scene.json files, first homographies,
// lists of pairs).
Dataset OpenTensorScenes(const std::vector<std::filesystem::path>& files);
Dataset OpenFolderScenes(const std::vector<std::filesystem::path>& scene_jsons);
Dataset OpenHomographies(const std::vector<std::filesystem::path>& files);
Dataset OpenNonRigid(const std::vector<std::filesystem::path>& pair_lists);

// A view of the simulator's folders and of the non-rigid benchmark.
bool IsFolderView(const std::filesystem::path& image);
void AddFolderView(const std::filesystem::path& image, SurfaceScene& scene);
bool IsNonRigidView(const std::filesystem::path& image);
void AddNonRigidView(const std::filesystem::path& image, SurfaceScene& scene);
// The benchmark's own code treats surface points beyond this distance as not visible.
inline constexpr float kNonRigidMaxDistance = 300.0F;

[[noreturn]] void FailDataset(const std::filesystem::path& file, const std::string& fault);
std::string ReadTextFile(const std::filesystem::path& file);
// Any type that DecodeImage reads, PGM or PPM, at its original size. Throws kNotFound, kCorrupt.
Image ReadGreyImage(const std::filesystem::path& file);
cv::Mat ReadDeepPng(const std::filesystem::path& file);  // 8 or 16 bits, as the file has it

}  // namespace pliant::evaluation
