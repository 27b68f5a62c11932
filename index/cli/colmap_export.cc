// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/cli/colmap_export.h"

#include <fstream>
#include <map>
#include <mutex>
#include <set>
#include <sstream>
#include <string>
#include <utility>

#include "descriptor/base/parallel.h"
#include "index/cli/folder_features.h"
#include "index/cli/interrupt.h"
#include "index/cli/output.h"
#include "index/cli/progress.h"
#include "index/files/text.h"
#include "index/store/colmap_database.h"
#include "index/verify/verification.h"

namespace pliant::cli {
namespace {

using Pair = std::pair<std::size_t, std::size_t>;

// A point of the upright image in the pixels as they are stored (EXIF 2.3, tag 0x0112), which is
// what COLMAP reads. `width`, `height`: of the upright image.
Vec2 AsStored(Vec2 p, int orientation, int width, int height) {
  const double right = width - 1.0 - p.x;
  const double below = height - 1.0 - p.y;
  switch (orientation) {
    case 2:
      return {right, p.y};
    case 3:
      return {right, below};
    case 4:
      return {p.x, below};
    case 5:
      return {p.y, p.x};
    case 6:
      return {p.y, right};
    case 7:
      return {below, right};
    case 8:
      return {below, p.x};
    default:
      return p;
  }
}

class Export {
 public:
  Export(const EngineOptions& engine, const ColmapExportOptions& options)
      : engine_(engine), options_(options) {}

  ExitStatus Run() {
    const std::unique_ptr<ColmapDatabase> database =
        CreateColmapDatabase(options_.database, options_.one_camera);
    folder_ = FindFolderImages(options_.inputs);
    RequireTwo(" found");
    if (!options_.pairs.empty()) ReadPairs();
    DescribeFolder(folder_, engine_, options_.match.threads, interrupt_);
    if (!Stopped()) {
      RequireTwo(" that can be described");
      Store(*database);
      MatchAll(*database);
    }
    if (Stopped()) {
      Message("stopped on request; nothing was written");
      return ExitStatus::kFailed;
    }
    database->Publish();
    Report();
    return folder_.skipped.empty() ? ExitStatus::kDone : ExitStatus::kSomeSkipped;
  }

 private:
  bool Stopped() const { return interrupt_.requested(); }

  void RequireTwo(const std::string& which) const {
    const std::size_t count = folder_.images.size();
    if (count >= 2) return;
    ReportSkipped(folder_.skipped);
    throw Error(ErrorCode::kInvalidArgument, "too_few_images",
                std::to_string(count) + (count == 1 ? " image" : " images") + which +
                    "; two or more are matched with each other");
  }

  void Store(ColmapDatabase& database) {
    for (const FolderImage& image : folder_.images) {
      CheckDescriptors(image.features.descriptors, "the image's descriptors");
      packed_.emplace_back(image.features.descriptors);
      const Features& features = image.features;
      std::vector<Vec2> points;
      for (const Keypoint& k : features.keypoints) {
        points.push_back(
            AsStored({k.x, k.y}, image.exif_orientation, features.width, features.height));
      }
      const bool turned = image.exif_orientation >= 5;
      numbers_.push_back(database.AddImage({image.name, turned ? features.height : features.width,
                                            turned ? features.width : features.height, points}));
    }
  }

  // Pairs of images, each once, the one that comes first in the folder first.
  std::vector<Pair> Pairs() const {
    std::vector<Pair> pairs;
    if (options_.pairs.empty()) {
      for (std::size_t a = 0; a < folder_.images.size(); ++a) {
        for (std::size_t b = a + 1; b < folder_.images.size(); ++b) pairs.emplace_back(a, b);
      }
      return pairs;
    }
    std::map<std::string, std::size_t> at;
    for (std::size_t i = 0; i < folder_.images.size(); ++i) at[folder_.images[i].name] = i;
    for (const auto& [first, second] : listed_) {  // those of skipped images are left out
      if (at.contains(first) && at.contains(second)) pairs.emplace_back(at[first], at[second]);
    }
    return pairs;
  }

  // COLMAP's match list: two names a line.
  void ReadPairs() {
    std::ifstream file(options_.pairs);
    const std::string shown = ToDisplayText(options_.pairs.string());
    if (!file || std::filesystem::is_directory(options_.pairs)) {
      throw Error(ErrorCode::kNotFound, "cannot_read", shown + " cannot be read");
    }
    std::set<std::string> names;
    for (const FolderImage& image : folder_.images) names.insert(image.name);
    std::string line;
    for (int number = 1; std::getline(file, line); ++number) {
      std::istringstream words(line);
      std::string first, second, rest;
      if (!(words >> first) || first[0] == '#') continue;
      const bool two = (words >> second) && !(words >> rest);
      for (const std::string& name : {first, second}) {
        if (two && first != second && names.contains(name)) continue;
        throw Error(
            ErrorCode::kInvalidArgument, "pairs_invalid",
            shown + ":" + std::to_string(number) + ": " +
                (!two || first == second ? "a line names two different images"
                                         : "there is no image " + ToDisplayText(name) + " below " +
                                               ToDisplayText(folder_.root.string())));
      }
      listed_.insert(std::minmax(first, second));
    }
    if (!listed_.empty()) return;
    throw Error(ErrorCode::kInvalidArgument, "pairs_invalid", shown + " names no images");
  }

  std::vector<PointNumbers> MatchPair(std::size_t a, std::size_t b) const {
    std::vector<PointNumbers> found;
    const Features& first = folder_.images[a].features;
    if (options_.verify) {
      const Verifier verifier(folder_.images[b].features);
      for (const MatchedPair& pair : verifier.Verify(first).inliers) {
        found.emplace_back(pair.reference, pair.query);
      }
      return found;
    }
    MatchOptions match = options_.match;
    match.threads = 1;
    for (const Match& m : MatchDescriptors(packed_[b], first.descriptors, match)) {
      found.emplace_back(m.reference, m.query);
    }
    return found;
  }

  void MatchAll(ColmapDatabase& database) {
    const std::vector<Pair> pairs = Pairs();
    std::mutex mutex;  // guards the database and the counts
    Progress progress("pairs");
    ParallelFor(pairs.size(), options_.match.threads, [&](std::size_t i) {
      if (Stopped()) return;
      const auto& [a, b] = pairs[i];
      const std::vector<PointNumbers> found = MatchPair(a, b);
      const std::lock_guard lock(mutex);
      database.AddMatches(numbers_[a], numbers_[b], found);
      matches_ += found.size();
      progress.Count(++pairs_, pairs.size());
    });
  }

  void Report() const {
    const std::string root = ToDisplayText(folder_.root.string());
    const std::string file = ToDisplayText(options_.database.string());
    if (options_.json) {
      PrintJson({{"file", file},
                 {"image_path", root},
                 {"images", folder_.images.size()},
                 {"pairs", pairs_},
                 {"matches", matches_},
                 {"model_id", folder_.images[0].features.model_id},
                 {"skipped", SkippedJson(folder_.skipped)}});
      return;
    }
    ReportSkipped(folder_.skipped);
    Print("wrote " + file + ": " + std::to_string(folder_.images.size()) + " images below " + root +
          ", " + std::to_string(matches_) + " matches of " + std::to_string(pairs_) + " pairs");
  }

  const EngineOptions& engine_;
  const ColmapExportOptions& options_;
  const Interrupt interrupt_;
  FolderFeatures folder_;
  std::vector<PackedDescriptors> packed_;  // one an image
  std::vector<int> numbers_;               // in the database
  std::set<std::pair<std::string, std::string>> listed_;
  std::uint64_t pairs_ = 0;
  std::uint64_t matches_ = 0;
};

}  // namespace

ExitStatus ExportToColmap(const EngineOptions& engine, const ColmapExportOptions& options) {
  return Export(engine, options).Run();
}

}  // namespace pliant::cli
