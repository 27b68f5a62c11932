// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/cli/engine_flags.h"

#include "descriptor/base/strings.h"
#include "index/cli/output.h"
#include "index/usage/checks.h"

namespace pliant::cli {
namespace {

void AddSizeFlags(CLI::App& app, DescriptorOptions& descriptor, ExtractionOptions& extraction) {
  app.add_option("--model", descriptor.model_path, "weight file for deal and its variants")
      ->type_name("FILE");
  app.add_option("--max-keypoints", extraction.keypoints.max_keypoints,
                 "number of keypoints per image, strongest first")
      ->capture_default_str()
      ->check(Between(1, 4096));
  app.add_option("--max-side", extraction.decode.max_side_px,
                 "scale larger images down to this longer side in pixels; 0 = never")
      ->capture_default_str()
      ->check(AtLeast(0));
}

}  // namespace

void AddDatabaseFlag(CLI::App& app, EngineOptions& engine) {
  engine.warn = Message;
  app.add_option("--db", engine.database,
                 "the database: a file, or the URL of a PostgreSQL database")
      ->required()
      ->type_name("FILE");
}

void AddCollectionFlag(CLI::App& app, std::string& collection) {
  app.add_option("--collection", collection, "the collection in the database")
      ->default_val(kDefaultCollection)
      ->type_name("NAME");
}

void AddExtractionFlags(CLI::App& app, EngineOptions& engine) {
  engine.descriptor.clear();
  app.add_option("--descriptor", engine.descriptor,
                 "the descriptor: " + Join(DescriptorNames(), ", ") +
                     " (default: the database's own, deal for a new one)")
      ->check(OneOf(DescriptorNames()))
      ->type_name("NAME");
  app.add_option("--model", engine.descriptor_options.model_path,
                 "weight file for deal and its variants")
      ->type_name("FILE");
  app.add_option_function<int>(
         "--max-keypoints",
         [&engine](int value) {
           engine.max_keypoints = value;
           engine.extraction.keypoints.max_keypoints = value;
         },
         "number of keypoints per image, strongest first (default: the database's own, 1024 for "
         "a new one)")
      ->check(Between(1, 4096));
  app.add_option_function<int>(
         "--max-side",
         [&engine](int value) {
           engine.max_side_px = value;
           engine.extraction.decode.max_side_px = value;
         },
         "scale larger images down to this longer side in pixels (default: the database's own, "
         "1024 for a new one)")
      ->check(Between(16, 65536));
}

void AddDescriptorListFlags(CLI::App& app, std::vector<std::string>& names,
                            DescriptorOptions& descriptor, ExtractionOptions& extraction) {
  app.add_option("--descriptor,--descriptors", names,
                 "the descriptors, one or more of " + Join(DescriptorNames(), ", "))
      ->delimiter(',')
      ->check(OneOf(DescriptorNames()))
      ->allow_extra_args(false)
      ->capture_default_str()
      ->type_name("NAME,...");
  AddSizeFlags(app, descriptor, extraction);
}

void AddTrackingFlags(CLI::App& app, LocateOptions& locate) {
  VerificationOptions& verification = locate.verification;
  app.add_option("--iterations", verification.ransac.iterations,
                 "number of RANSAC samples per frame")
      ->capture_default_str()
      ->check(Between(1, 1'000'000));
  app.add_option("--max-ratio", verification.max_ratio,
                 "ratio test: keep a match if its distance is at most this times that of the "
                 "second nearest")
      ->capture_default_str();
  app.add_option("--tolerance", verification.tolerance,
                 "largest distance of a match from the warp, relative to the frame's longer side")
      ->capture_default_str();
  app.add_option("--regularization", verification.ransac.regularization,
                 "stiffness of the thin-plate spline; 0 = none")
      ->capture_default_str()
      ->check(AtLeast(0));
  app.add_option("--min-inliers", locate.min_inliers,
                 "with fewer inliers the object counts as lost")
      ->capture_default_str();
}

}  // namespace pliant::cli
