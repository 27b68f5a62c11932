// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/cli/folder_features.h"

#include <algorithm>
#include <atomic>
#include <optional>
#include <utility>

#include "descriptor/base/parallel.h"
#include "index/cli/image_input.h"
#include "index/cli/output.h"
#include "index/cli/progress.h"
#include "index/files/text.h"

namespace pliant::cli {
namespace {

namespace fs = std::filesystem;

fs::path RootOf(const std::vector<fs::path>& inputs) {
  std::error_code error;
  if (inputs.size() == 1 && fs::is_directory(inputs[0], error)) return fs::canonical(inputs[0]);
  fs::path root = fs::weakly_canonical(fs::absolute(inputs[0])).parent_path();
  for (const fs::path& input : inputs) {
    const fs::path path = fs::weakly_canonical(fs::absolute(input));
    while (!IsInside(root, path)) root = root.parent_path();
  }
  return root;
}

// A link keeps its own name; the folders that it lies in are those of the root.
std::string NameBelow(const fs::path& root, const fs::path& path) {
  const fs::path lies_in = fs::weakly_canonical(fs::absolute(path).parent_path());
  return (lies_in / path.filename()).lexically_relative(root).generic_string();
}

bool IsSurfaceMap(const fs::path& path) {  // of the simulator
  return path.filename().string().ends_with(".uv.png");
}

// Why it cannot be described, if it cannot.
std::optional<SkippedFile> Describe(const FeatureExtractor& extractor, const EngineOptions& engine,
                                    int threads, FolderImage& image) {
  try {
    const std::vector<std::uint8_t> bytes =
        ReadImage(image.path, engine.extraction.decode.max_bytes).bytes;
    image.features = extractor.Extract(bytes, threads);
    image.exif_orientation = ReadImageHeader(bytes).exif_orientation;
    return std::nullopt;
  } catch (const Error& error) {
    if (!ConcernsOneImage(error.code()) && error.code() != ErrorCode::kNotFound) throw;
    return SkippedFile{ToDisplayText(image.name), error.reason(), ToDisplayText(error.what())};
  }
}

}  // namespace

FolderFeatures FindFolderImages(const std::vector<fs::path>& inputs) {
  FolderFeatures folder;
  ImageFiles files = FindImages(inputs, ObjectFrom::kNone);
  folder.root = RootOf(inputs);
  folder.skipped = std::move(files.skipped);
  for (SkippedFile& skipped : folder.skipped) skipped.file = NameBelow(folder.root, skipped.file);
  for (const ImageFile& file : files.images) {
    if (IsSurfaceMap(file.path)) continue;
    FolderImage image;
    image.path = file.path;
    image.name = NameBelow(folder.root, file.path);
    folder.images.push_back(std::move(image));
  }
  return folder;
}

void DescribeFolder(FolderFeatures& folder, const EngineOptions& engine, int threads,
                    const Interrupt& interrupt) {
  const std::string descriptor =
      engine.descriptor.empty() ? EngineOptions{}.descriptor : engine.descriptor;
  const FeatureExtractor extractor(MakeDescriptor(descriptor, engine.descriptor_options),
                                   engine.extraction);
  std::vector<FolderImage> images = std::move(folder.images);
  folder.images.clear();
  const int wanted = ResolveThreads(threads);
  const auto at_once =
      static_cast<int>(std::clamp<std::size_t>(images.size(), 1, static_cast<std::size_t>(wanted)));
  Progress progress("images");
  std::atomic<std::uint64_t> done{0};
  std::vector<std::optional<SkippedFile>> failures(images.size());
  ParallelFor(images.size(), wanted, [&](std::size_t i) {
    if (interrupt.requested()) return;
    failures[i] = Describe(extractor, engine, wanted / at_once, images[i]);
    progress.Count(++done, images.size());
  });
  if (interrupt.requested()) return;
  for (std::size_t i = 0; i < images.size(); ++i) {
    if (failures[i]) {
      folder.skipped.push_back(*failures[i]);
    } else {
      folder.images.push_back(std::move(images[i]));
    }
  }
}

void ReportSkipped(const std::vector<SkippedFile>& skipped) {
  for (const SkippedFile& s : skipped) Message("skipped " + s.file + ": " + s.reason);
}

Json SkippedJson(const std::vector<SkippedFile>& skipped) {
  Json list = Json::array();
  for (const SkippedFile& s : skipped) {
    list.push_back({{"file", s.file}, {"code", s.code}, {"reason", s.reason}});
  }
  return list;
}

}  // namespace pliant::cli
