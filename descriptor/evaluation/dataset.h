// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Data sets of images with known correspondence, in the common layouts.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "descriptor/evaluation/truth_scene.h"

namespace pliant::evaluation {

enum class Layout {
  kAuto,        // detected from the files
  kTensors,     // scene_*.safetensors of the simulator
  kFolders,     // scene_*/ with scene.json and view_NN.png of the simulator
  kHomography,  // HPatches: NAME/1.ppm .. 6.ppm, H_1_2 .. (or Oxford's: img1.ppm, H1to2p)
  kNonRigid,    // selected_pairs.json, rgba_*.png, uv_*.png, bgmask_*.png, segmentation_*.png
};
// Throws kInvalidArgument "layout_unknown"; the message lists the known ones.
Layout ParseLayout(const std::string& name);
std::string ToString(Layout layout);

// Two views of a scene to be matched.
struct ViewPair {
  int first = 0;
  int second = 0;
  std::string group;            // split or kind of the pair in the data set; may be empty
  std::optional<double> sweep;  // value of the swept parameter, if the set is a sweep
};

struct SceneEntry {
  std::string name;
  std::vector<ViewPair> pairs;  // all pairs of the set, in its own order
  // Reads images and truth. Thread-safe; throws kCorrupt, kNotFound, kUnprocessable.
  std::function<std::unique_ptr<TruthScene>()> load;
  std::vector<std::filesystem::path> images = {};  // by view; empty where no image files exist
};

struct Dataset {
  Layout layout = Layout::kAuto;
  std::string sweep;  // "", "rotation_deg" or "scale": the meaning of ViewPair::sweep
  std::vector<SceneEntry> scenes;
};

// Searches `folder` recursively, in the order of names. Throws kNotFound "dataset_not_found" (the
// message says what was searched for) and kCorrupt "dataset_corrupt" for files that contradict the
// layout.
Dataset OpenDataset(const std::filesystem::path& folder, Layout layout = Layout::kAuto);

// The truth between two images (views 0 and 1 of the result) that lie in a simulated scene's
// folder or belong to the non-rigid benchmark; nullptr when there is none.
std::unique_ptr<TruthScene> FindTruth(const std::filesystem::path& first,
                                      const std::filesystem::path& second);

// Nine numbers, row by row, that map the first image's pixels to the second's. Throws kNotFound,
// kCorrupt "homography_unreadable".
Homography ReadHomography(const std::filesystem::path& file);

}  // namespace pliant::evaluation
