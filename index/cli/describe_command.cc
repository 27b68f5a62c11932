// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// pliant describe IMAGE|DIR --out FILE.npz|FILE.h5|FILE.safetensors
#include <memory>

#include "index/cli/command.h"
#include "index/cli/engine_flags.h"
#include "index/cli/features_file.h"
#include "index/cli/interrupt.h"
#include "index/cli/output.h"
#include "index/cli/picture_input.h"
#include "index/cli/write_file.h"
#include "index/files/text.h"

namespace pliant::cli {
namespace {

struct Options {
  EngineOptions engine;  // only what concerns extraction
  std::filesystem::path image;
  std::filesystem::path out;
  int threads = 0;
  bool json = false;
};

// What was written of a folder.
struct Written {
  std::size_t images = 0;
  std::size_t keypoints = 0;
  int dim = 0;
  std::string model_id;
};

ExitStatus DescribeAll(const Options& options) {
  const Interrupt interrupt;
  const std::unique_ptr<FolderFeaturesFile> out = OpenFolderFeatures(options.out);
  FolderFeatures folder = FindFolderPictures({options.image});
  Written written;
  DescribeEach(folder, options.engine, options.threads, interrupt, [&](FolderPicture picture) {
    const Features& features = picture.features;
    Written more{written.images + 1, written.keypoints + features.keypoints.size(),
                 features.descriptors.dim, features.model_id};
    const std::string name = ToDisplayText(picture.name);
    if (out->Add(std::move(picture))) {
      written = std::move(more);
    } else {
      folder.skipped.push_back(
          {name, "name_taken", "another picture, or a folder, is called like this in the file"});
    }
  });
  if (interrupt.requested()) {
    Message("stopped on request; nothing was written");
    return ExitStatus::kFailed;
  }
  const std::string root = ToDisplayText(folder.root.string());
  if (written.images == 0) {
    ReportSkipped(folder.skipped);
    throw Error(ErrorCode::kUnprocessable, "no_pictures",
                root + " holds no picture that can be described");
  }
  out->Publish();
  const std::string file = ToDisplayText(options.out.string());
  if (options.json) {
    PrintJson({{"file", file},
               {"folder", root},
               {"images", written.images},
               {"keypoints", written.keypoints},
               {"dim", written.dim},
               {"model_id", written.model_id},
               {"skipped", SkippedJson(folder.skipped)}});
  } else {
    ReportSkipped(folder.skipped);
    Print("wrote " + file + ": " + std::to_string(written.keypoints) + " key points of " +
          std::to_string(written.images) + (written.images == 1 ? " picture" : " pictures") +
          " below " + root + ", " + written.model_id);
  }
  return folder.skipped.empty() ? ExitStatus::kDone : ExitStatus::kSomeSkipped;
}

ExitStatus Run(const Options& options) {
  if (options.out == kStandardOutput) ClaimStandardOutput("--out", options.json);
  std::error_code error;  // reading it says what is wrong
  if (std::filesystem::is_directory(options.image, error)) return DescribeAll(options);
  CheckFeaturesName(options.out);
  const PictureInput picture =
      ReadPicture(options.image, options.engine.extraction.decode.max_bytes);
  const std::string name =
      options.engine.descriptor.empty() ? EngineOptions{}.descriptor : options.engine.descriptor;
  const FeatureExtractor extractor(MakeDescriptor(name, options.engine.descriptor_options),
                                   options.engine.extraction);
  ExtractionTimings timings;
  const Features features =
      Naming(picture, [&] { return extractor.Extract(picture.bytes, options.threads, &timings); });
  WriteFeatures(options.out, options.image == "-" ? "stdin" : options.image.filename().string(),
                features);
  if (options.json) {
    PrintJson({{"file", ToDisplayText(options.out.string())},
               {"keypoints", features.keypoints.size()},
               {"descriptor", name},
               {"dim", features.descriptors.dim},
               {"model_id", features.model_id},
               {"width", features.width},
               {"height", features.height},
               {"timings",
                {{"decode_ms", timings.decode_ms},
                 {"detect_ms", timings.detect_ms},
                 {"describe_ms", timings.describe_ms}}}});
  } else {
    Print("wrote " + ToDisplayText(options.out.string()) + ": " +
          std::to_string(features.keypoints.size()) + " key points, " + features.model_id +
          ", described in " + FormatFixed(timings.describe_ms, 0) + " ms");
  }
  return ExitStatus::kDone;
}

}  // namespace

void AddDescribeCommand(CLI::App& program, ExitStatus& status) {
  auto options = std::make_shared<Options>();
  CLI::App* app = program.add_subcommand(
      "describe",
      "Write the key points and descriptors of a picture, or of a folder's, to a file for NumPy, "
      "hloc or PyTorch");
  app->add_option("IMAGE|DIR", options->image,
                  "the picture; - = standard input; or a folder, of which all pictures are "
                  "described")
      ->required();
  app->add_option(
         "--out,-o", options->out,
         "the file to write: .npz (NumPy), .h5 (HDF5, as hloc reads it) or .safetensors; - = "
         "standard output, as .npz")
      ->required()
      ->type_name("FILE");
  AddExtractionFlags(*app, options->engine);
  app->add_option("--jobs,-j", options->threads, "threads; 0 = one per core")
      ->capture_default_str()
      ->check(Between(0, 1024));
  app->add_flag("--json", options->json, "print one JSON document");
  app->footer(
      "Example:  pliant describe PHOTO.jpg --out photo.npz\n"
      "          pliant describe photos/ --out photos.npz\n"
      "          pliant describe photos/ --out photos.h5");
  app->callback([options, &status] { status = Run(*options); });
}

}  // namespace pliant::cli
