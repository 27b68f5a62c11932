// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Public data sets: HPatches (Balntas et al., CVPR 2017), the Oxford set it follows (Mikolajczyk et
// al., IJCV 2005), and the Nonrigid Correspondence Benchmark of the DEAL paper's laboratory.
#include <algorithm>
#include <array>
#include <memory>
#include <sstream>
#include <system_error>
#include <utility>

#include <nlohmann/json.hpp>

#include "descriptor/base/error.h"
#include "descriptor/evaluation/dataset_readers.h"

namespace pliant::evaluation {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

constexpr std::array kExtensions = {".ppm", ".png", ".pgm", ".jpg", ".jpeg", ".bmp"};
constexpr Homography kIdentity = {1, 0, 0, 0, 1, 0, 0, 0, 1};

bool Exists(const fs::path& file) {
  std::error_code failed;
  return fs::is_regular_file(file, failed);
}

// NAME with whichever image extension is there; empty when there is none.
fs::path FindImage(const fs::path& folder, const std::string& name) {
  for (const char* extension : kExtensions) {
    if (Exists(folder / (name + extension))) return folder / (name + extension);
  }
  return {};
}

struct Sequence {
  std::vector<fs::path> images;
  std::vector<fs::path> homographies;  // from the first to the second, third, ...
};

Sequence FindSequence(const fs::path& folder) {
  const bool oxford = Exists(folder / "H1to2p");
  const std::string stem = oxford ? "img" : "";
  Sequence sequence;
  sequence.images.push_back(FindImage(folder, stem + "1"));
  if (sequence.images.front().empty())
    FailDataset(folder, "there is a homography, but no image " + stem + "1.ppm (or .png, .jpg)");
  for (int k = 2;; ++k) {
    const std::string number = std::to_string(k);
    const fs::path homography = folder / (oxford ? "H1to" + number + "p" : "H_1_" + number);
    if (!Exists(homography)) return sequence;
    sequence.images.push_back(FindImage(folder, stem + number));
    if (sequence.images.back().empty())
      FailDataset(homography, "its image " + stem + number + ".ppm is missing");
    sequence.homographies.push_back(homography);
  }
}

std::unique_ptr<TruthScene> LoadSequence(const Sequence& sequence) {
  std::vector<Image> images;
  std::vector<Homography> from_first = {kIdentity};
  for (const fs::path& image : sequence.images) images.push_back(ReadGreyImage(image));
  for (const fs::path& file : sequence.homographies) from_first.push_back(ReadHomography(file));
  return std::make_unique<HomographyScene>(std::move(images), from_first);
}

// HPatches names its sequences i_NAME (light changes) and v_NAME (the camera moves).
std::string GroupOf(const std::string& sequence) {
  if (sequence.starts_with("i_")) return "illumination";
  return sequence.starts_with("v_") ? "viewpoint" : "";
}

// The file beside an image rgba_NNNNN.png (or rgb_NNNNN.png) that holds something else about it.
fs::path Sibling(const fs::path& image, const std::string& what) {
  const std::string name = image.filename().string();
  const std::size_t underscore = name.find('_');
  const std::string rest = underscore == std::string::npos ? ".png" : name.substr(underscore);
  return image.parent_path() / (what + rest);
}

// A pixel's value as a small number; colours of a palette are folded.
std::uint32_t PixelValue(const cv::Mat& image, int x, int y) {
  if (image.type() == CV_16UC1) return image.at<std::uint16_t>(y, x);
  const std::uint8_t* p = image.ptr(y) + x * image.channels();
  return image.channels() == 1 ? p[0] : (p[0] + 256U * p[1] + 65536U * p[2]) % 65521U;
}

// An optional image of the given size; empty when the file is not there.
cv::Mat ReadLabels(const fs::path& file, const Image& like) {
  if (!Exists(file)) return {};
  cv::Mat labels = ReadDeepPng(file);
  const int type = labels.type();
  if (labels.cols != like.width || labels.rows != like.height ||
      (type != CV_8UC1 && type != CV_16UC1 && type != CV_8UC3 && type != CV_8UC4)) {
    FailDataset(file, "it is not an 8- or 16-bit image of the view's size");
  }
  return labels;
}

SceneEntry NonRigidEntry(const fs::path& root, const std::string& split, const Json& pair) {
  std::vector<fs::path> images;
  std::string name = split;
  for (std::size_t i = 0; i < 2; ++i) {
    std::string relative = pair.at(i).get<std::string>();
    relative.erase(0, relative.find_first_not_of('/'));  // some lists have a leading slash
    name += (i == 0 ? ":" : " ") + relative;
    images.push_back(root / relative);
  }
  return {name,
          {{0, 1, split, {}}},
          [images]() -> std::unique_ptr<TruthScene> {
            auto scene = std::make_unique<SurfaceScene>(kNonRigidMaxDistance);
            for (const fs::path& image : images) AddNonRigidView(image, *scene);
            return scene;
          },
          images};
}

}  // namespace

Homography ReadHomography(const fs::path& file) {
  std::istringstream in(ReadTextFile(file));
  Homography homography{};
  bool nine = true;
  for (double& value : homography) nine = nine && in >> value;
  if (std::string more; !nine || in >> more) {
    throw Error(ErrorCode::kCorrupt, "homography_unreadable",
                file.string() + " must hold nine numbers, row by row");
  }
  return homography;
}

Dataset OpenHomographies(const std::vector<fs::path>& files) {
  Dataset dataset;
  for (const fs::path& file : files) {
    const fs::path folder = file.parent_path();
    const Sequence sequence = FindSequence(folder);
    // "x/" has an empty file name; its parent's is the folder's own.
    const fs::path whole = fs::absolute(folder).lexically_normal();
    const std::string name =
        (whole.has_filename() ? whole : whole.parent_path()).filename().string();
    SceneEntry entry{name, {}, [sequence] { return LoadSequence(sequence); }, sequence.images};
    for (int k = 1; k < static_cast<int>(sequence.images.size()); ++k)
      entry.pairs.push_back({0, k, GroupOf(name), {}});
    dataset.scenes.push_back(std::move(entry));
  }
  return dataset;
}

Dataset OpenNonRigid(const std::vector<fs::path>& pair_lists) {
  Dataset dataset;
  for (const fs::path& list : pair_lists) {
    const Json json = Json::parse(ReadTextFile(list), nullptr, /*allow_exceptions=*/false);
    if (!json.is_object()) FailDataset(list, "it is not a JSON object of splits");
    try {
      for (const auto& [split, pairs] : json.items()) {
        for (const Json& pair : pairs)
          dataset.scenes.push_back(NonRigidEntry(list.parent_path(), split, pair));
      }
    } catch (const Json::exception& error) {
      FailDataset(list,
                  std::string("a split is not a list of pairs of file names: ") + error.what());
    }
  }
  return dataset;
}

bool IsNonRigidView(const fs::path& image) {
  return image.filename().string().starts_with("rgb") && Exists(Sibling(image, "uv"));
}

// The background mask says what is the object (above 0); the segmentation numbers the objects, the
// same in every image; the 16-bit "uv" image has three coordinates in the undeformed object.
void AddNonRigidView(const fs::path& image, SurfaceScene& scene) {
  Image grey = ReadGreyImage(image);
  const fs::path uv_file = Sibling(image, "uv");
  const cv::Mat uv = ReadDeepPng(uv_file);
  if (uv.depth() != CV_16U || uv.channels() < 2 || uv.channels() > 4 || uv.cols != grey.width ||
      uv.rows != grey.height) {
    FailDataset(uv_file, "it is not a 16-bit colour image of the view's size");
  }
  const cv::Mat mask = ReadLabels(Sibling(image, "bgmask"), grey);
  const cv::Mat segments = ReadLabels(Sibling(image, "segmentation"), grey);
  const int channels = std::min(uv.channels(), 3);
  SurfaceMap map{grey.width, grey.height, {}};
  map.points.reserve(uv.total());
  for (int y = 0; y < uv.rows; ++y) {
    const auto* row = uv.ptr<std::uint16_t>(y);
    for (int x = 0; x < uv.cols; ++x) {
      SurfacePoint point;
      for (int c = 0; c < channels; ++c)
        point.at[static_cast<std::size_t>(c)] = row[x * uv.channels() + c];
      const std::uint32_t segment = segments.empty() ? 0 : PixelValue(segments, x, y);
      const bool on = !mask.empty()       ? PixelValue(mask, x, y) > 0
                      : !segments.empty() ? segment > 1  // 0 and 1 are floor and background
                                          : point.at != std::array<float, 3>{};
      point.label = on ? segment + 1 : 0;
      map.points.push_back(point);
    }
  }
  scene.Add(std::move(grey), std::move(map));
}

}  // namespace pliant::evaluation
