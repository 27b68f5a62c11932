// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/simulation/scene_folder.h"

#include <array>
#include <cstdio>
#include <fstream>
#include <span>
#include <system_error>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "descriptor/base/error.h"
#include "descriptor/simulation/scene_file.h"

namespace pliant::simulation {
namespace {

namespace fs = std::filesystem;

constexpr int kPlainJpegQuality = 92;

[[noreturn]] void FailToWrite(const fs::path& path) {
  throw Error(ErrorCode::kNoSpace, "file_unwritable",
              "cannot write " + path.string() + "; is the folder writable and the disk not full?");
}

void WriteBytes(const fs::path& path, std::span<const std::uint8_t> bytes) {
  std::ofstream file(path, std::ios::binary | std::ios::trunc);
  file.write(reinterpret_cast<const char*>(bytes.data()),
             static_cast<std::streamsize>(bytes.size()));
  file.close();
  if (!file) FailToWrite(path);
}

// A folder that gets its real name when everything in it has been written.
class NewFolder {
 public:
  explicit NewFolder(fs::path target)
      : target_(std::move(target)),
        part_(target_.parent_path() / ("." + target_.filename().string() + ".part")) {
    std::error_code failed;
    fs::remove_all(part_, failed);
    if (!fs::create_directories(part_, failed) || failed) FailToWrite(part_);
  }
  NewFolder(const NewFolder&) = delete;
  NewFolder& operator=(const NewFolder&) = delete;
  ~NewFolder() {
    std::error_code ignored;
    if (!published_) fs::remove_all(part_, ignored);
  }
  fs::path operator/(const std::string& name) const { return part_ / name; }
  void Publish() {
    std::error_code failed;
    fs::rename(part_, target_, failed);
    if (failed) FailToWrite(target_);
    published_ = true;
  }

 private:
  fs::path target_, part_;
  bool published_ = false;
};

int DigitsOf(const Scene& scene) { return scene.views.size() > 100 ? 3 : 2; }

// Red = u, green = v, blue = chart + 1; 0 in blue = not the object's front.
std::vector<std::uint8_t> EncodeTruth(const View& view) {
  std::vector<std::uint16_t> truth(3 * view.chart.size());
  for (std::size_t i = 0; i < view.chart.size(); ++i) {
    if (view.chart[i] == kNoChart) continue;
    truth[3 * i] = view.uv[2 * i];
    truth[3 * i + 1] = view.uv[2 * i + 1];
    truth[3 * i + 2] = static_cast<std::uint16_t>(view.chart[i] + 1);
  }
  return EncodeDeepPng(view.image.width, view.image.height, truth);
}

std::string SceneJson(const Scene& scene) {
  using Json = nlohmann::ordered_json;
  Json charts = Json::array();
  for (std::size_t c = 0; c < scene.textures.size(); ++c) {
    charts.push_back({{"texture", scene.textures[c]},
                      {"width", scene.chart_sizes[c].x()},
                      {"height", scene.chart_sizes[c].y()}});
  }
  Json views = Json::array();
  for (std::size_t v = 0; v < scene.views.size(); ++v) {
    views.push_back({{"image", NumberedName("view", v, DigitsOf(scene)) + ".png"},
                     {"parameters", ViewJson(scene.views[v])}});
  }
  const Json json = {{"format", "pliant-scene-folder 1"},
                     {"preset", ToString(scene.preset)},
                     {"kind", ToString(scene.kind)},
                     {"seed", scene.seed},
                     {"scene", scene.index},
                     {"charts", std::move(charts)},
                     {"views", std::move(views)}};
  return JsonText(json, /*indented=*/true) + '\n';
}

}  // namespace

std::string NumberedName(std::string_view stem, std::uint64_t number, int digits) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "_%0*llu", digits,
                static_cast<unsigned long long>(number));
  return std::string(stem) + text.data();
}

void WriteSceneFolder(const fs::path& folder, const Scene& scene) {
  NewFolder target(folder);
  for (std::size_t v = 0; v < scene.views.size(); ++v) {
    const std::string name = NumberedName("view", v, DigitsOf(scene));
    WriteBytes(target / (name + ".png"), EncodePng(scene.views[v].image));
    WriteBytes(target / (name + ".uv.png"), EncodeTruth(scene.views[v]));
  }
  const std::string json = SceneJson(scene);
  WriteBytes(target / "scene.json",
             {reinterpret_cast<const std::uint8_t*>(json.data()), json.size()});
  target.Publish();
}

void WriteObjectFolder(const fs::path& folder, const Scene& scene, bool with_reference) {
  NewFolder target(folder);
  for (std::size_t v = 0; v < scene.views.size(); ++v) {
    if (v == 0 && !with_reference) continue;
    const View& view = scene.views[v];
    const std::string name = v == 0 ? "ref.jpg" : NumberedName("view", v, DigitsOf(scene)) + ".jpg";
    WriteBytes(target / name,
               EncodeJpeg(view.image, view.photo.jpeg_quality > 0 ? view.photo.jpeg_quality
                                                                  : kPlainJpegQuality));
  }
  target.Publish();
}

}  // namespace pliant::simulation
