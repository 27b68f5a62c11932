// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/evaluation/dataset.h"

#include <algorithm>
#include <array>
#include <fstream>
#include <iterator>
#include <system_error>
#include <utility>

#include <opencv2/imgcodecs.hpp>

#include "descriptor/base/error.h"
#include "descriptor/evaluation/dataset_readers.h"
#include "descriptor/image/cv_image.h"

namespace pliant::evaluation {
namespace {

namespace fs = std::filesystem;

constexpr int kMaxDepth = 6;

constexpr std::array kLayouts = {
    std::pair{Layout::kAuto, "auto"}, std::pair{Layout::kTensors, "tensors"},
    std::pair{Layout::kFolders, "folders"}, std::pair{Layout::kHomography, "hpatches"},
    std::pair{Layout::kNonRigid, "nonrigid"}};

// What announces each layout, by name, below a folder.
struct Signs {
  std::vector<fs::path> tensors, scene_jsons, homography_folders, pair_lists;
};

void Look(const fs::path& folder, int depth, Signs& signs) {
  std::vector<fs::directory_entry> entries;
  std::error_code failed;
  for (fs::directory_iterator it(folder, failed), end; !failed && it != end; it.increment(failed))
    if (!it->path().filename().native().starts_with('.')) entries.push_back(*it);
  if (failed) {
    throw Error(ErrorCode::kNotFound, "dataset_unreadable",
                "cannot list " + folder.string() + ": " + failed.message());
  }
  std::sort(entries.begin(), entries.end());
  for (const fs::directory_entry& entry : entries) {
    const std::string name = entry.path().filename().string();
    if (entry.is_directory(failed)) {
      if (depth < kMaxDepth) Look(entry.path(), depth + 1, signs);
    } else if (name.starts_with("scene_") && name.ends_with(".safetensors")) {
      signs.tensors.push_back(entry.path());
    } else if (name == "scene.json") {
      signs.scene_jsons.push_back(entry.path());
    } else if (name == "H_1_2" || name == "H1to2p") {
      signs.homography_folders.push_back(folder);
    } else if (name == "selected_pairs.json") {
      signs.pair_lists.push_back(entry.path());
    }
  }
}

Layout Guess(const Signs& signs) {
  if (!signs.tensors.empty()) return Layout::kTensors;
  if (!signs.scene_jsons.empty()) return Layout::kFolders;
  if (!signs.pair_lists.empty()) return Layout::kNonRigid;
  if (!signs.homography_folders.empty()) return Layout::kHomography;
  return Layout::kAuto;
}

Dataset Open(Layout layout, const Signs& signs) {
  switch (layout) {
    case Layout::kTensors:
      return OpenTensorScenes(signs.tensors);
    case Layout::kFolders:
      return OpenFolderScenes(signs.scene_jsons);
    case Layout::kHomography:
      return OpenHomographies(signs.homography_folders);
    case Layout::kNonRigid:
      return OpenNonRigid(signs.pair_lists);
    case Layout::kAuto:
      break;
  }
  return {};
}

cv::Mat DecodeFile(const fs::path& file, int flags) {
  const std::string bytes = ReadTextFile(file);
  cv::Mat pixels;
  std::string why;
  try {
    if (!bytes.empty()) {
      pixels = cv::imdecode(cv::Mat(1, static_cast<int>(bytes.size()), CV_8UC1,
                                    const_cast<char*>(bytes.data())),  // imdecode only reads
                            flags | cv::IMREAD_IGNORE_ORIENTATION);
    }
  } catch (const cv::Exception& error) {
    why = " (" + error.err + ")";
  }
  if (pixels.empty()) FailDataset(file, "it is no image that can be decoded" + why);
  return pixels;
}

}  // namespace

Layout ParseLayout(const std::string& name) {
  std::string known;
  for (const auto& [layout, word] : kLayouts) {
    if (name == word) return layout;
    known += (known.empty() ? "" : ", ") + std::string(word);
  }
  throw Error(ErrorCode::kInvalidArgument, "layout_unknown",
              "there is no layout '" + name + "'; known are: " + known);
}

std::string ToString(Layout layout) {
  for (const auto& [value, word] : kLayouts) {
    if (value == layout) return word;
  }
  return "auto";
}

Dataset OpenDataset(const fs::path& folder, Layout layout) {
  std::error_code failed;
  if (!fs::is_directory(folder, failed)) {
    throw Error(ErrorCode::kNotFound, "dataset_not_found", folder.string() + " is not a folder");
  }
  Signs signs;
  Look(folder, 0, signs);
  if (layout == Layout::kAuto) layout = Guess(signs);
  Dataset dataset = Open(layout, signs);
  dataset.layout = layout;
  if (dataset.scenes.empty()) {
    throw Error(
        ErrorCode::kNotFound, "dataset_not_found",
        "there is nothing to match below " + folder.string() +
            ". Looked for scene_*.safetensors or scene.json (pliant simulate), H_1_2 beside "
            "1.ppm (HPatches), H1to2p beside img1.ppm, and selected_pairs.json (the "
            "non-rigid benchmark).");
  }
  return dataset;
}

std::unique_ptr<TruthScene> FindTruth(const fs::path& first, const fs::path& second) {
  std::error_code failed;
  const bool same_scene =
      fs::equivalent(fs::absolute(first).parent_path(), fs::absolute(second).parent_path(), failed);
  if (IsFolderView(first) && IsFolderView(second) && same_scene) {
    auto scene = std::make_unique<SurfaceScene>();
    AddFolderView(first, *scene);
    AddFolderView(second, *scene);
    return scene;
  }
  if (IsNonRigidView(first) && IsNonRigidView(second)) {
    auto scene = std::make_unique<SurfaceScene>(kNonRigidMaxDistance);
    AddNonRigidView(first, *scene);
    AddNonRigidView(second, *scene);
    return scene;
  }
  return nullptr;
}

void FailDataset(const fs::path& file, const std::string& fault) {
  throw Error(ErrorCode::kCorrupt, "dataset_corrupt", file.string() + ": " + fault);
}

std::string ReadTextFile(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::string text{std::istreambuf_iterator<char>(in), {}};
  if (!in.is_open() || in.bad()) {
    throw Error(ErrorCode::kNotFound, "file_unreadable",
                file.string() + " is missing or cannot be read");
  }
  return text;
}

Image ReadGreyImage(const fs::path& file) {
  return CopyFromMat(DecodeFile(file, cv::IMREAD_GRAYSCALE));
}

cv::Mat ReadUnchanged(const fs::path& file) { return DecodeFile(file, cv::IMREAD_UNCHANGED); }

}  // namespace pliant::evaluation
