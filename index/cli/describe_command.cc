// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// pliant describe IMAGE|DIR --out FILE.npz
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "descriptor/base/error.h"
#include "descriptor/features/features.h"
#include "index/cli/command.h"
#include "index/cli/engine_flags.h"
#include "index/cli/image_input.h"
#include "index/cli/interrupt.h"
#include "index/cli/output.h"
#include "index/cli/write_file.h"
#include "index/engine/query_extraction.h"
#include "index/files/features_npz.h"
#include "index/files/text.h"

namespace pliant::cli {
namespace {

void WriteFolderFeatures(const std::filesystem::path& path,
                         const std::vector<FolderImage>& images) {
  FeatureTotals totals;
  for (const FolderImage& image : images) {
    const Features& features = image.features;
    totals.Count(ToDisplayText(image.name), features.keypoints.size());
    totals.kind = features.descriptors.kind;
    totals.dim = features.descriptors.dim;
    totals.model_id = features.model_id;
  }
  const auto write = [&](const auto& put) {
    FeaturesArchive archive(totals, put);
    for (const FolderImage& image : images) {
      archive.Add(ToDisplayText(image.name), "", image.features);
    }
    archive.Finish();
  };
  if (path == kStandardOutput) {  // which takes no offsets
    std::string whole;
    write(NpzArchive::ToMemory(&whole));
    return WriteFile(path, whole);
  }
  NewFile file(path);
  write([&file](std::uint64_t offset, std::string_view bytes) { file.Write(offset, bytes); });
  file.Publish();
}

struct Options {
  EngineOptions engine;  // only what concerns extraction
  std::filesystem::path image;
  std::filesystem::path out;
  int threads = 0;
  bool enlarge = false;
  bool json = false;
};

ExitStatus DescribeAll(const Options& options) {
  const Interrupt interrupt;
  FolderFeatures folder = FindFolderImages({options.image});
  DescribeFolder(folder, options.engine, options.threads, interrupt);
  if (interrupt.requested()) {
    Message("stopped on request; nothing was written");
    return ExitStatus::kFailed;
  }
  const std::string root = PathText(folder.root);
  const std::size_t images = folder.images.size();
  if (images == 0) {
    ReportSkipped(folder.skipped);
    throw Error(ErrorCode::kUnprocessable, "no_images",
                root + " contains no image that can be described");
  }
  WriteFolderFeatures(options.out, folder.images);
  std::size_t keypoints = 0;
  for (const FolderImage& image : folder.images) {
    keypoints += image.features.keypoints.size();
  }
  const Features& first = folder.images.front().features;
  if (!options.json) ReportSkipped(folder.skipped);
  Report(options.json,
         {{"file", PathText(options.out)},
          {"folder", root},
          {"images", images},
          {"keypoints", keypoints},
          {"dim", first.descriptors.dim},
          {"model_id", first.model_id},
          {"skipped", SkippedJson(folder.skipped)}},
         "wrote {}: {} keypoints of {} {} below {}, {}", PathText(options.out), keypoints, images,
         images == 1 ? "image" : "images", root, first.model_id);
  return folder.skipped.empty() ? ExitStatus::kDone : ExitStatus::kSomeSkipped;
}

ExitStatus Run(Options options) {
  if (options.out.extension() != ".npz" && options.out != kStandardOutput) {
    throw Error(
        ErrorCode::kInvalidArgument, "bad_features_name",
        PathText(options.out) +
            ": unknown type of output; end the name in .npz (NumPy), or give - for standard "
            "output");
  }
  CheckOutput(options.out, "--out", options.json);
  if (options.enlarge) options.engine.extraction = QueryExtraction(options.engine.extraction);
  std::error_code error;  // reading it says what is wrong
  if (std::filesystem::is_directory(options.image, error)) return DescribeAll(options);
  const ImageInput image = ReadImage(options.image, options.engine.extraction.decode.max_bytes);
  const FeatureExtractor extractor(NamedDescriptor(options.engine), options.engine.extraction);
  ExtractionTimings timings;
  const Features features =
      Naming(image, [&] { return extractor.Extract(image.bytes, options.threads, &timings); });
  WriteFile(options.out, FeaturesNpz(features));
  Report(options.json,
         {{"file", PathText(options.out)},
          {"keypoints", features.keypoints.size()},
          {"descriptor", DescriptorName(options.engine)},
          {"dim", features.descriptors.dim},
          {"model_id", features.model_id},
          {"width", features.width},
          {"height", features.height},
          {"timings",
           {{"decode_ms", timings.decode_ms},
            {"detect_ms", timings.detect_ms},
            {"describe_ms", timings.describe_ms}}}},
         "wrote {}: {} keypoints, {}, described in {:.0f} ms", PathText(options.out),
         features.keypoints.size(), features.model_id, timings.describe_ms);
  return ExitStatus::kDone;
}

}  // namespace

void AddDescribeCommand(CLI::App& program, ExitStatus& status) {
  auto options = std::make_shared<Options>();
  CLI::App* app = program.add_subcommand(
      "describe",
      "Write the keypoints and descriptors of an image, or of a folder's images, for NumPy");
  app->add_option("IMAGE|DIR", options->image,
                  "an image, or a folder to describe all its images; - = standard input")
      ->required();
  app->add_option("--out,-o", options->out,
                  "the file to write, as .npz (NumPy); - = standard output")
      ->required()
      ->type_name("FILE");
  AddExtractionFlags(*app, options->engine);
  app->add_flag("--enlarge", options->enlarge,
                "describe as a search describes its query: twice as many keypoints, also of low "
                "contrast, and as many again of the enlarged image");
  AddJobsFlag(*app, options->threads);
  AddJsonFlag(*app, options->json);
  app->footer(
      "Example:  pliant describe PHOTO.jpg --out photo.npz\n"
      "          pliant describe photos/ --out photos.npz");
  app->callback([options, &status] { status = Run(*options); });
}

}  // namespace pliant::cli
