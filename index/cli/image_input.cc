// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/cli/image_input.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cctype>
#include <cerrno>
#include <cstdio>
#include <optional>
#include <system_error>
#include <utility>

#include "descriptor/base/format_bytes.h"
#include "descriptor/base/parallel.h"
#include "descriptor/image/image.h"
#include "descriptor/simulation/texture.h"
#include "index/cli/engine_flags.h"
#include "index/cli/output.h"
#include "index/cli/progress.h"
#include "index/files/text.h"

namespace pliant::cli {
namespace {

namespace fs = std::filesystem;

std::vector<std::uint8_t> ReadStandardInput(std::int64_t max_bytes) {
  std::vector<std::uint8_t> bytes;
  std::array<std::uint8_t, 65536> piece{};
  std::size_t count = 0;
  while ((count = std::fread(piece.data(), 1, piece.size(), stdin)) > 0) {
    if (bytes.size() + count > static_cast<std::uint64_t>(max_bytes)) {
      throw Error(ErrorCode::kTooLarge, "image_too_large",
                  "standard input is larger than the limit, " +
                      FormatBytes(static_cast<std::uint64_t>(max_bytes)));
    }
    bytes.insert(bytes.end(), piece.begin(), piece.begin() + static_cast<std::ptrdiff_t>(count));
  }
  if (std::ferror(stdin) != 0) {
    throw Error(ErrorCode::kNotFound, "cannot_read",
                "standard input cannot be read: " + std::generic_category().message(errno));
  }
  return bytes;
}

// Converts binary PGM and PPM, the formats of HPatches and other data sets, to PNG: the library
// reads only formats of cameras and web sites.
std::vector<std::uint8_t> AsPng(std::vector<std::uint8_t> bytes) {
  const bool pnm = bytes.size() > 2 && bytes[0] == 'P' && (bytes[1] == '5' || bytes[1] == '6') &&
                   (std::isspace(bytes[2]) != 0 || bytes[2] == '#');
  return pnm ? EncodePng(simulation::DecodePnm(bytes)) : bytes;
}

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

ImageInput ReadImage(const fs::path& path, std::int64_t max_bytes) {
  const bool standard_input = path == "-";
  ImageInput image{standard_input ? "standard input" : PathText(path),
                   standard_input ? ReadStandardInput(max_bytes) : ReadFile(path, max_bytes)};
  image.bytes = Naming(image, [&] { return AsPng(std::move(image.bytes)); });
  return image;
}

FolderFeatures FindFolderImages(const std::vector<fs::path>& inputs) {
  FolderFeatures folder;
  ImageFiles files = FindImages(inputs, ObjectFrom::kNone);
  folder.root = RootOf(inputs);
  folder.skipped = std::move(files.skipped);
  for (SkippedFile& skipped : folder.skipped) skipped.file = NameBelow(folder.root, skipped.file);
  for (const ImageFile& file : files.images) {
    if (file.path.native().ends_with(".uv.png")) continue;  // a surface map of the simulator
    folder.images.push_back({file.path, NameBelow(folder.root, file.path), {}});
  }
  return folder;
}

void DescribeFolder(FolderFeatures& folder, const EngineOptions& engine, int threads,
                    const Interrupt& interrupt) {
  const FeatureExtractor extractor(NamedDescriptor(engine), engine.extraction);
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
    if (const auto& failure = failures[i]) {
      folder.skipped.push_back(*failure);
    } else {
      folder.images.push_back(std::move(images[i]));
    }
  }
}

}  // namespace pliant::cli
