// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// pliant track REFERENCE VIDEO|DIR
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <system_error>

#include "descriptor/base/error.h"
#include "descriptor/image/video.h"
#include "index/cli/command.h"
#include "index/cli/engine_flags.h"
#include "index/cli/image_input.h"
#include "index/cli/interrupt.h"
#include "index/cli/output.h"
#include "index/cli/progress.h"
#include "index/cli/write_file.h"
#include "index/files/text.h"
#include "index/json/result_json.h"
#include "index/tracking/pipeline.h"
#include "index/tracking/track_image.h"

namespace pliant::cli {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void FailToWrite(const fs::path& path) {
  throw Error(ErrorCode::kNoSpace, "file_unwritable",
              path.string() + " cannot be written; check that the folder exists and is writable");
}

// Call it before the work whose result is written. Throws what CheckFolderName throws, and kNoSpace
// "file_unwritable" if a video's folder does not exist.
void CheckTrackOutName(const fs::path& out) {
  std::error_code ignored;
  if (!HasVideoName(out)) return CheckFolderName(out, "a video (.mp4, .m4v, .mov, .mkv, .avi)");
  if (!fs::is_directory(fs::absolute(out).parent_path(), ignored)) FailToWrite(out);
}

// The output of `pliant track`: a video, or a folder of JPEG files frame_NNNNNN.jpg, depending on
// the name of `out`.
class TrackOutput {
 public:
  // `frames_per_second` of the written frames. Throws kNoSpace "file_unwritable".
  TrackOutput(const fs::path& out, double frames_per_second)
      : out_(out), frames_per_second_(frames_per_second) {
    if (HasVideoName(out)) return;
    std::error_code failed;
    fs::create_directories(out, failed);
    if (failed || !fs::is_directory(out)) FailToWrite(out);
  }

  void Write(const TrackedFrame& tracked, const PixelBox& box) {
    const Image image = DrawTracked(tracked, box);
    if (!HasVideoName(out_)) {
      return WriteImage(out_ / fmt::format("frame_{:06}.jpg", tracked.frame.number), image);
    }
    if (!writer_) {
      writer_ = std::make_unique<VideoWriter>(out_, image.width, image.height, frames_per_second_);
    }
    writer_->Write(image);
  }
  void Close() {
    if (writer_) writer_->Close();
  }

 private:
  fs::path out_;
  double frames_per_second_;
  std::unique_ptr<VideoWriter> writer_;  // of a video; made with the first frame, whose size it has
};

constexpr double kFolderRate = 25;  // frames a second of a video made of a folder's images

struct Options {
  EngineOptions engine;  // only what concerns extraction
  TrackerOptions tracker;
  FrameOptions frames;
  std::filesystem::path reference;
  std::filesystem::path input;
  std::vector<int> region;
  std::filesystem::path mask;
  std::filesystem::path out;
  std::filesystem::path sheet;
  bool json = false;
};

Image Decode(const std::filesystem::path& file, DecodeOptions decode, bool colour) {
  decode.colour = colour;
  decode.max_side_px = 0;  // the region is in the image's own pixels
  const ImageInput image = ReadImage(file, decode.max_bytes);
  return Naming(image, [&] { return DecodeImage(image.bytes, decode).image; });
}

Tracker MakeTracker(Options& options) {
  if (!options.region.empty()) {
    options.tracker.region =
        PixelBox{options.region[0], options.region[1], options.region[2], options.region[3]};
  }
  options.tracker.extraction = options.engine.extraction;
  const DecodeOptions& decode = options.engine.extraction.decode;
  const Image reference = Decode(options.reference, decode, true);
  if (!options.mask.empty()) options.tracker.mask = Decode(options.mask, decode, false);
  return {NamedDescriptor(options.engine), reference, options.tracker};
}

Json FrameJson(const TrackedFrame& tracked) {
  Json json = {{"frame", tracked.frame.number}};
  if (tracked.frame.time_s) json["time_s"] = *tracked.frame.time_s;
  if (!tracked.frame.file.empty()) json["file"] = tracked.frame.file;
  json.update(LocationJson(tracked.location));
  json["describe_ms"] = tracked.describe_ms;
  json["verify_ms"] = tracked.verify_ms;
  return json;
}

void PrintFrame(const TrackedFrame& tracked, bool as_json) {
  if (as_json) {
    PrintJson(FrameJson(tracked));
    FlushOutput();  // a line a frame, as they come
    return;
  }
  const double rate = 100 * tracked.location.inlier_rate();
  Print(Caption(tracked) + (tracked.location.found ? fmt::format("  {:.0f} %", rate) : ""));
}

void PrintSummary(const Options& options, const Tracker& tracker, const TrackSummary& summary,
                  const FrameSource& source, bool interrupted) {
  ReportSkipped(source.skipped());
  const PixelBox& box = tracker.box();
  Report(options.json,
         {{"summary",
           {{"frames", summary.frames},
            {"found", summary.found},
            {"inlier_rate", summary.inlier_rate},
            {"frames_per_second", summary.frames_per_second},
            {"seconds", summary.seconds},
            {"model_id", tracker.features().model_id},
            {"template",
             {{"region", {box.x, box.y, box.width, box.height}},
              {"keypoints", tracker.features().keypoints.size()}}},
            {"interrupted", interrupted},
            {"skipped", SkippedJson(source.skipped())}}}},
         "found in {} of {} frames; inlier rate {:.1f} %; {:.2f} frames/s{}", summary.found,
         summary.frames, 100 * summary.inlier_rate, summary.frames_per_second,
         interrupted ? "; interrupted" : "");
}

ExitStatus Run(Options& options) {
  const Interrupt interrupt;
  if (!options.out.empty()) CheckTrackOutName(options.out);
  for (const std::filesystem::path& written : {options.out, options.sheet})
    CheckNotInput(written, {options.reference, options.input, options.mask});
  CheckImageOutput(options.sheet, "--sheet", options.json);
  const Tracker tracker = MakeTracker(options);
  options.frames.decode = options.engine.extraction.decode;
  const auto source = OpenFrames(options.input, options.frames);
  const double rate = source->info().frames_per_second;
  std::optional<TrackOutput> output;
  if (!options.out.empty()) {
    output.emplace(options.out, (rate > 0 ? rate : kFolderRate) / options.frames.every);
  }
  std::optional<ContactSheet> sheet;
  if (!options.sheet.empty()) sheet.emplace(tracker.image());

  Progress progress("frames");
  std::uint64_t done = 0;
  const TrackSummary summary = TrackFrames(*source, tracker, [&](const TrackedFrame& tracked) {
    PrintFrame(tracked, options.json);
    if (output) output->Write(tracked, tracker.box());
    if (sheet) sheet->Add(tracked, tracker.box());
    progress.Count(++done, static_cast<std::uint64_t>(source->info().frames));
    return !interrupt.requested();
  });
  if (summary.frames == 0) {
    throw Error(ErrorCode::kUnprocessable, "no_frames",
                options.input.string() + " contains no readable image");
  }
  if (output) output->Close();
  if (sheet) {
    WriteImage(options.sheet, sheet->Draw(PathText(options.input.filename()) + ", " +
                                          tracker.features().model_id));
  }
  PrintSummary(options, tracker, summary, *source, interrupt.requested());
  if (interrupt.requested()) return ExitStatus::kFailed;
  return source->skipped().empty() ? ExitStatus::kDone : ExitStatus::kSomeSkipped;
}

}  // namespace

void AddTrackCommand(CLI::App& program, ExitStatus& status) {
  auto options = std::make_shared<Options>();
  CLI::App* app = program.add_subcommand("track", kTrack);
  app->add_option("REFERENCE", options->reference, "image of the object, nearly flat")->required();
  app->add_option("VIDEO|DIR", options->input, "video file, or folder of frames")->required();
  app->add_option("--region", options->region,
                  "the object in REFERENCE, in its pixels (default: the whole image)")
      ->delimiter(',')
      ->expected(4)
      ->type_name("X,Y,W,H")
      ->option_text("X,Y,W,H");
  app->add_option("--mask", options->mask, "image as large as REFERENCE, black outside the object")
      ->type_name("FILE");
  app->add_option(
         "--out,-o", options->out,
         "draw the mesh over each frame and the flattened object beside it: a video (.mp4, "
         ".m4v, .mov, .mkv, .avi) or a folder for images")
      ->type_name("OUT.mp4|DIR");
  app->add_option("--sheet", options->sheet, "draw a contact sheet of twelve frames")
      ->type_name("OUT.png");
  AddTrackingFlags(*app, options->frames.every, options->tracker.locate);
  AddExtractionFlags(*app, options->engine);
  AddJobsFlag(*app, options->tracker.threads, "threads that describe a frame");
  app->add_flag("--json", options->json, "print one line of JSON per frame, then a summary");
  app->footer("Example:  pliant track POSTER.jpg VIDEO.mp4 --out tracked.mp4");
  app->callback([options, &status] { status = Run(*options); });
}

}  // namespace pliant::cli
