// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/evaluation/dataset.h"

#include <algorithm>
#include <array>
#include <fstream>
#include <iterator>
#include <string_view>
#include <system_error>
#include <utility>

#include "descriptor/base/error.h"
#include "descriptor/evaluation/dataset_readers.h"
#include "descriptor/image/image_header.h"
#include "descriptor/simulation/texture.h"

namespace pliant::evaluation {
namespace {

namespace fs = std::filesystem;

constexpr int kMaxDepth = 6;

// The layouts, in the order in which files decide: the files that announce each, by name, and its
// reader, which takes them.
struct Reader {
  Layout layout;
  const char* name;
  bool (*announces)(std::string_view file_name);
  Dataset (*open)(const std::vector<fs::path>& files);
};
constexpr std::array kReaders = {
    Reader{Layout::kTensors, "tensors",
           [](std::string_view name) {
             return name.starts_with("scene_") && name.ends_with(".safetensors");
           },
           OpenTensorScenes},
    Reader{Layout::kFolders, "folders", [](std::string_view name) { return name == "scene.json"; },
           OpenFolderScenes},
    Reader{Layout::kNonRigid, "nonrigid",
           [](std::string_view name) { return name == "selected_pairs.json"; }, OpenNonRigid},
    Reader{Layout::kHomography, "hpatches",
           [](std::string_view name) { return name == "H_1_2" || name == "H1to2p"; },
           OpenHomographies}};

using Files = std::array<std::vector<fs::path>, kReaders.size()>;  // that announce each layout

void Look(const fs::path& folder, int depth, Files& files) {
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
    if (entry.is_directory(failed)) {
      if (depth < kMaxDepth) Look(entry.path(), depth + 1, files);
      continue;
    }
    const std::string name = entry.path().filename().string();
    for (std::size_t i = 0; i < kReaders.size(); ++i) {
      if (kReaders[i].announces(name)) files[i].push_back(entry.path());
    }
  }
}

// `decode` on the file's bytes.
template <typename Decode>
auto DecodeFile(const fs::path& file, Decode&& decode) {
  const std::string text = ReadTextFile(file);
  try {
    return decode(Bytes(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()));
  } catch (const Error& error) {
    FailDataset(file, std::string("it is no image that can be decoded: ") + error.what());
  }
}

}  // namespace

Layout ParseLayout(const std::string& name) {
  if (name == "auto") return Layout::kAuto;
  std::string known = "auto";
  for (const Reader& reader : kReaders) {
    if (name == reader.name) return reader.layout;
    known += std::string(", ") + reader.name;
  }
  throw Error(ErrorCode::kInvalidArgument, "layout_unknown",
              "there is no layout '" + name + "'; known are: " + known);
}

std::string ToString(Layout layout) {
  for (const Reader& reader : kReaders) {
    if (reader.layout == layout) return reader.name;
  }
  return "auto";
}

Dataset OpenDataset(const fs::path& folder, Layout layout) {
  std::error_code failed;
  if (!fs::is_directory(folder, failed)) {
    throw Error(ErrorCode::kNotFound, "dataset_not_found", folder.string() + " is not a folder");
  }
  Files files;
  Look(folder, 0, files);
  Dataset dataset;
  for (std::size_t i = 0; i < kReaders.size(); ++i) {
    const bool chosen = layout == Layout::kAuto ? !files[i].empty() : layout == kReaders[i].layout;
    if (!chosen) continue;
    dataset = kReaders[i].open(files[i]);
    dataset.layout = kReaders[i].layout;
    break;
  }
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
  return DecodeFile(file, [](Bytes bytes) {
    if (bytes.size() > 1 && bytes[0] == 'P') return ToGrey(simulation::DecodePnm(bytes));
    return DecodeImage(bytes, {.max_side_px = 0, .min_side_px = 1}).image;
  });
}

cv::Mat ReadDeepPng(const fs::path& file) { return DecodeFile(file, DecodeDeepPng); }

}  // namespace pliant::evaluation
