// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// pliant describe IMAGE --out FILE.npz|FILE.safetensors
#include <memory>

#include "index/cli/command.h"
#include "index/cli/engine_flags.h"
#include "index/cli/features_file.h"
#include "index/cli/output.h"
#include "index/cli/picture_input.h"
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

ExitStatus Run(const Options& options) {
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
  WriteFeatures(options.out, features);
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
    Print("wrote " + options.out.string() + ": " + std::to_string(features.keypoints.size()) +
          " key points, " + features.model_id + ", described in " +
          FormatFixed(timings.describe_ms, 0) + " ms");
  }
  return ExitStatus::kDone;
}

}  // namespace

void AddDescribeCommand(CLI::App& program, ExitStatus& status) {
  auto options = std::make_shared<Options>();
  CLI::App* app = program.add_subcommand(
      "describe", "Write a picture's key points and descriptors to a file for NumPy or PyTorch");
  app->add_option("IMAGE", options->image, "the picture; - = standard input")->required();
  app->add_option("--out,-o", options->out, "the file to write: .npz (NumPy) or .safetensors")
      ->required()
      ->type_name("FILE");
  AddExtractionFlags(*app, options->engine);
  app->add_option("--jobs,-j", options->threads, "threads; 0 = one per core")
      ->capture_default_str()
      ->check(Between(0, 1024));
  app->add_flag("--json", options->json, "print one JSON document");
  app->footer("Example:  pliant describe PHOTO.jpg --out photo.npz");
  app->callback([options, &status] { status = Run(*options); });
}

}  // namespace pliant::cli
