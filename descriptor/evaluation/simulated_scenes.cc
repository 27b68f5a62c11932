// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The simulator's sets; see FORMAT in descriptor/simulation/README.md.
#include <algorithm>
#include <array>
#include <cstring>
#include <memory>
#include <system_error>
#include <utility>

#include <nlohmann/json.hpp>

#include "descriptor/base/error.h"
#include "descriptor/base/safetensors.h"
#include "descriptor/evaluation/dataset_readers.h"
#include "descriptor/simulation/scene_file.h"

namespace pliant::evaluation {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

constexpr const char* kFolderFormat = "pliant-scene-folder 1";
constexpr std::uint8_t kNoChart = 255;
constexpr float kFullScale = 65535.0F;

Json ParseJson(const fs::path& file, const std::string& text) {
  Json json = Json::parse(text, nullptr, /*allow_exceptions=*/false);
  if (json.is_discarded()) FailDataset(file, "it is not valid JSON");
  return json;
}

// The name of the preset's sweep; empty for other presets.
std::string SweepName(const std::string& preset) {
  if (preset == "rotation") return "rotation_deg";
  return preset == "scale" ? "scale" : "";
}

// Which views of a scene are compared: all with all; in a sweep or sequence view 0 with every
// other. `list`: the array of views as the simulator wrote it.
std::vector<ViewPair> SimulatedPairs(const std::string& preset, int views, const Json& list) {
  const std::string sweep = SweepName(preset);
  const bool from_reference = !sweep.empty() || preset == "sequence";
  std::vector<ViewPair> pairs;
  for (int a = 0; a < (from_reference ? 1 : views); ++a) {
    for (int b = a + 1; b < views; ++b) {
      ViewPair& pair = pairs.emplace_back(ViewPair{a, b, {}, {}});
      if (sweep.empty()) continue;
      const Json& view = list.at(static_cast<std::size_t>(b));
      const Json& framing =
          view.contains("parameters") ? view.at("parameters").at("framing") : view.at("framing");
      pair.sweep = framing.at(sweep == "scale" ? "scale" : "roll_deg").get<double>();
    }
  }
  return pairs;
}

SafetensorsHeader ReadHeader(const fs::path& file) {
  try {
    return ReadSafetensorsHeader(file);
  } catch (const Error& error) {
    throw Error(ErrorCode::kCorrupt, "dataset_corrupt", error.what());
  }
}

std::size_t Extent(const TensorInfo& tensor, std::size_t axis) {
  return static_cast<std::size_t>(tensor.shape[axis]);
}

const TensorInfo& Tensor(const SafetensorsFile& file, const char* name, const char* type,
                         std::size_t rank) {
  const auto found = file.tensors().find(name);
  if (found == file.tensors().end() || found->second.dtype != type ||
      found->second.shape.size() != rank) {
    FailDataset(file.name(), std::string("tensor '") + name + "' is missing or not " + type +
                                 " of rank " + std::to_string(rank));
  }
  return found->second;
}

// One view's truth: chart and u, v as the file has them, in the chart's physical units.
SurfaceMap TensorMap(const std::uint8_t* chart, const std::uint8_t* uv, int width, int height,
                     const std::vector<float>& chart_sizes) {
  SurfaceMap map{width, height, {}};
  map.points.resize(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  for (std::size_t i = 0; i < map.points.size(); ++i) {
    const std::size_t c = chart[i];
    if (c == kNoChart || 2 * c + 1 >= chart_sizes.size()) continue;
    std::array<std::uint16_t, 2> at{};
    std::memcpy(at.data(), uv + 4 * i, sizeof at);
    map.points[i] = {static_cast<std::uint32_t>(c + 1),
                     {static_cast<float>(at[0]) / kFullScale * chart_sizes[2 * c],
                      static_cast<float>(at[1]) / kFullScale * chart_sizes[2 * c + 1], 0.0F}};
  }
  return map;
}

std::unique_ptr<TruthScene> LoadTensorScene(const fs::path& path) {
  const SafetensorsFile file = SafetensorsFile::Open(path);
  const auto images_entry = file.tensors().find("images");
  const std::size_t rank =
      images_entry == file.tensors().end() ? 3 : images_entry->second.shape.size();
  const TensorInfo& images = Tensor(file, "images", "U8", rank == 4 ? 4 : 3);
  const TensorInfo& chart = Tensor(file, "chart", "U8", 3);
  const TensorInfo& uv = Tensor(file, "uv", "U16", 4);
  Tensor(file, "grid_size", "F32", 2);
  const std::size_t views = Extent(images, 0);
  const std::size_t height = Extent(images, 1);
  const std::size_t width = Extent(images, 2);
  const std::size_t channels = rank == 4 ? Extent(images, 3) : 1;
  const std::vector<std::int64_t> same{images.shape[0], images.shape[1], images.shape[2]};
  if (chart.shape != same || uv.shape[0] != same[0] || uv.shape[1] != same[1] ||
      uv.shape[2] != same[2] || uv.shape[3] != 2 || (channels != 1 && channels != 3)) {
    FailDataset(path, "images, chart and uv differ in shape");
  }
  const std::vector<float> sizes = file.Floats("grid_size");
  auto scene = std::make_unique<SurfaceScene>();
  const std::size_t pixels = width * height;
  for (std::size_t v = 0; v < views; ++v) {
    const int columns = static_cast<int>(width);
    const int rows = static_cast<int>(height);
    const auto view = file.Data(images).subspan(v * pixels * channels, pixels * channels);
    scene->Add(ToGrey({columns, rows, static_cast<int>(channels), {view.begin(), view.end()}}),
               TensorMap(file.Data(chart).data() + v * pixels,
                         file.Data(uv).data() + v * pixels * 4, columns, rows, sizes));
  }
  return scene;
}

SceneEntry TensorEntry(const fs::path& file, std::string& sweep) {
  const SafetensorsHeader header = ReadHeader(file);
  try {
    const Json metadata = header.metadata;
    if (metadata.at("format") != simulation::kSceneFormat) {
      FailDataset(file, "its format is " + metadata.at("format").dump() + ", not \"" +
                            simulation::kSceneFormat + "\"");
    }
    const auto preset = metadata.at("preset").get<std::string>();
    const auto images = header.tensors.find("images");
    if (images == header.tensors.end() || images->second.shape.empty())
      FailDataset(file, "it has no tensor 'images'");
    const auto views = static_cast<int>(images->second.shape[0]);
    const Json view_list = ParseJson(file, metadata.at("views").get<std::string>());
    sweep = SweepName(preset);
    return {file.stem().string(), SimulatedPairs(preset, views, view_list),
            [file] { return LoadTensorScene(file); }};
  } catch (const Json::exception& error) {
    FailDataset(file, std::string("its metadata lack something: ") + error.what());
  }
}

fs::path TruthFile(const fs::path& image) {
  return image.parent_path() / (image.stem().string() + ".uv.png");
}

Json ReadSceneJson(const fs::path& file) {
  Json json = ParseJson(file, ReadTextFile(file));
  if (!json.is_object() || json.value("format", "") != kFolderFormat) {
    FailDataset(file, std::string("it does not say \"format\": \"") + kFolderFormat + "\"");
  }
  return json;
}

// What `read` makes of a scene's JSON.
template <typename Read>
auto FromSceneJson(const fs::path& file, const Read& read) {
  try {
    return read(ReadSceneJson(file));
  } catch (const Json::exception& error) {
    FailDataset(file, std::string("it lacks something: ") + error.what());
  }
}

SceneEntry FolderEntry(const fs::path& scene_json, std::string& sweep) {
  const fs::path folder = scene_json.parent_path();
  return FromSceneJson(scene_json, [&](const Json& json) -> SceneEntry {
    const auto preset = json.at("preset").get<std::string>();
    std::vector<fs::path> images;
    for (const Json& view : json.at("views"))
      images.push_back(folder / view.at("image").get<std::string>());
    sweep = SweepName(preset);
    return {folder.filename().string(),
            SimulatedPairs(preset, static_cast<int>(images.size()), json.at("views")),
            [images]() -> std::unique_ptr<TruthScene> {
              auto scene = std::make_unique<SurfaceScene>();
              for (const fs::path& image : images) AddFolderView(image, *scene);
              return scene;
            },
            images};
  });
}

// All entries of a set must be of one sweep: a curve over a mixture would mean nothing.
template <typename Entry>
Dataset OpenScenes(const std::vector<fs::path>& files, const Entry& entry) {
  Dataset dataset;
  for (std::size_t i = 0; i < files.size(); ++i) {
    std::string sweep;
    dataset.scenes.push_back(entry(files[i], sweep));
    if (i > 0 && sweep != dataset.sweep) {
      FailDataset(files[i],
                  "it belongs to another preset than the scenes before it; evaluate a folder with "
                  "one preset at a time");
    }
    dataset.sweep = sweep;
  }
  return dataset;
}

}  // namespace

Dataset OpenTensorScenes(const std::vector<fs::path>& files) {
  return OpenScenes(files, TensorEntry);
}

Dataset OpenFolderScenes(const std::vector<fs::path>& scene_jsons) {
  return OpenScenes(scene_jsons, FolderEntry);
}

bool IsFolderView(const fs::path& image) {
  std::error_code failed;
  return fs::is_regular_file(TruthFile(image), failed) &&
         fs::is_regular_file(fs::absolute(image).parent_path() / "scene.json", failed);
}

void AddFolderView(const fs::path& image, SurfaceScene& scene) {
  std::vector<std::array<float, 2>> sizes;
  FromSceneJson(fs::absolute(image).parent_path() / "scene.json", [&](const Json& json) {
    for (const Json& chart : json.at("charts"))
      sizes.push_back({chart.at("width").get<float>(), chart.at("height").get<float>()});
  });
  Image grey = ReadGreyImage(image);
  const cv::Mat truth = ReadDeepPng(TruthFile(image));
  if (truth.type() != CV_16UC3 || truth.cols != grey.width || truth.rows != grey.height)
    FailDataset(TruthFile(image), "it is not a 16-bit colour image of the view's size");
  SurfaceMap map{grey.width, grey.height, {}};
  map.points.resize(truth.total());
  for (std::size_t i = 0; i < map.points.size(); ++i) {
    const auto& pixel = truth.at<cv::Vec3w>(static_cast<int>(i) / truth.cols,
                                            static_cast<int>(i) % truth.cols);  // B, G, R
    if (pixel[0] == 0 || pixel[0] > sizes.size()) continue;
    const std::array<float, 2>& size = sizes[pixel[0] - 1U];
    map.points[i] = {pixel[0],
                     {static_cast<float>(pixel[2]) / kFullScale * size[0],
                      static_cast<float>(pixel[1]) / kFullScale * size[1], 0.0F}};
  }
  scene.Add(std::move(grey), std::move(map));
}

}  // namespace pliant::evaluation
