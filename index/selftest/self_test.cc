// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/selftest/self_test.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <functional>
#include <map>
#include <optional>
#include <utility>

#define XXH_INLINE_ALL
#include <xxhash.h>

#include "descriptor/base/error.h"
#include "descriptor/base/parallel.h"
#include "descriptor/base/stopwatch.h"
#include "index/selftest/photographer.h"

namespace pliant {
namespace {

constexpr int kMostPictures = 10'000;
constexpr std::array kStrengths = {0.3, 0.6, 0.9};  // in turn
constexpr std::size_t kShown = 3;                   // hits that "perhaps" names
constexpr int kPictureSide = 640;                   // of the photographed picture, pixels
constexpr int kThumbnailSide = 240;
// With fewer keypoints, an image is plain: most of their photos are missed.
constexpr std::uint32_t kPlain = 64;

void Require(bool condition, const std::string& message) {
  if (!condition) throw Error(ErrorCode::kInvalidArgument, "option_out_of_range", message);
}

std::uint64_t HashOf(const std::string& text, std::uint64_t seed) {
  return XXH3_64bits_withSeed(text.data(), text.size(), seed);
}

// An image that is photographed, for its object.
struct Subject {
  std::uint64_t order = 0;
  ImageRecord image;
};

// One image of each of `most` objects; images without an object are objects of their own. Which
// ones, and their order, is random.
std::vector<ImageRecord> DrawSubjects(Engine& engine, const SelfTestOptions& options,
                                      SelfTestReport* report) {
  std::map<std::uint64_t, Subject> chosen;  // by the hash of the object
  ImageListing list;
  list.which.collection = options.collection;
  list.limit = 1000;
  engine.ForEachPage(list, [&](const ImagePage& page) {
    for (const ImageRecord& image : page.records) {
      ++report->images;
      if (image.keypoints < kPlain) {
        report->plain.push_back({image.id, image.object, image.keypoints});
      }
      const std::uint64_t object =
          HashOf(image.object.empty() ? "id " + image.id : "object " + image.object, options.seed);
      const Subject subject{HashOf(image.id, options.seed), image};
      const auto [at, is_new] = chosen.try_emplace(object, subject);
      if (!is_new && subject.order < at->second.order) at->second = subject;
      if (std::cmp_greater(chosen.size(), options.pictures)) chosen.erase(std::prev(chosen.end()));
    }
  });
  std::vector<ImageRecord> images;
  for (auto& [hash, subject] : chosen) images.push_back(std::move(subject.image));
  return images;
}

class SelfTester {
 public:
  SelfTester(Engine& engine, const SelfTestOptions& options) : engine_(engine), options_(options) {}

  // nullopt: the image has no stored file.
  std::optional<SelfTestPhoto> Ask(const ImageRecord& image, int number) const {
    std::vector<std::uint8_t> file;
    try {
      file = engine_.GetContent(options_.collection, image.id);
    } catch (const Error& error) {
      if (error.code() == ErrorCode::kNotFound) return std::nullopt;
      throw;
    }
    SelfTestPhoto asked;
    asked.image_id = image.id;
    asked.object = image.object;
    asked.strength = kStrengths[static_cast<std::size_t>(number) % kStrengths.size()];
    const DecodedImage picture =
        options_.decode(file, {.max_side_px = kPictureSide, .colour = true});
    const SimulatedPhoto photo = photographer_.Take(
        picture.image, asked.strength, options_.seed + static_cast<std::uint64_t>(number));
    asked.share = photo.share;
    const ScaledSize size = ScaleToFit(photo.image.width, photo.image.height, kThumbnailSide);
    asked.thumbnail = EncodeJpeg(ResizeImage(photo.image, size.width, size.height), 75);
    const std::vector<std::uint8_t> query = EncodeJpeg(photo.image);
    SearchOptions search;
    search.collection = options_.collection;
    search.limit = kShown;
    search.threads = 1;
    AskWith(query, search, &asked);
    search.without = IdsOf(image);
    AskWithout(query, search, &asked);
    return asked;
  }

 private:
  std::vector<std::string> IdsOf(const ImageRecord& image) const {
    if (image.object.empty()) return {image.id};
    std::vector<std::string> ids;
    ImageListing list;
    list.which.collection = options_.collection;
    list.which.object = image.object;
    list.limit = static_cast<int>(kMaxExcluded);
    for (const ImageRecord& other : engine_.ListPage(list).records) ids.push_back(other.id);
    return ids;
  }

  static bool Shows(const Hit& hit, const SelfTestPhoto& asked) {
    return asked.object.empty() ? hit.image_id == asked.image_id : hit.object == asked.object;
  }

  void AskWith(Bytes query, const SearchOptions& search, SelfTestPhoto* asked) const {
    const std::optional<SearchResult> result = Search(query, search);
    if (!result) return;
    for (const Hit& hit : result->hits) {
      if (!Shows(hit, *asked)) continue;
      asked->probability = hit.probability.value_or(0);
      const bool first = &hit == &result->hits.front();
      if (result->found > std::size_t{0}) {
        asked->verdict = first ? SelfTestVerdict::kFound : SelfTestVerdict::kWrong;
      } else if (result->perhaps) {
        asked->verdict = SelfTestVerdict::kPerhaps;
      }
      return;
    }
    if (result->found > std::size_t{0}) asked->verdict = SelfTestVerdict::kWrong;
  }

  void AskWithout(Bytes query, const SearchOptions& search, SelfTestPhoto* asked) const {
    const std::optional<SearchResult> result = Search(query, search);
    if (!result || result->hits.empty()) return;
    const Hit& first = result->hits.front();
    asked->false_alarm = result->found > std::size_t{0};
    asked->absent_probability = first.probability.value_or(0);
    asked->other = first.object;
    asked->other_image = first.image_id;
  }

  // nullopt: too little is seen in the photo.
  std::optional<SearchResult> Search(Bytes query, const SearchOptions& search) const {
    try {
      return engine_.Search(query, search);
    } catch (const Error& error) {
      if (error.reason() == "too_few_features") return std::nullopt;
      throw;
    }
  }

  Engine& engine_;
  const SelfTestOptions& options_;
  const Photographer photographer_;
};

// The smallest probability t such that (1 + photos of absent objects with t or more) / (1 +
// photos) is at most the wanted rate. Then the expected rate is at most that for further
// photos of the same kind (conformal p-values: Bates et al., Annals of Statistics 2023).
void Calibrate(double rate, SelfTestReport* report) {
  const auto alarms = [&](double from) {
    return std::ranges::count_if(report->photos, [&](const SelfTestPhoto& asked) {
      return asked.absent_probability >= from;
    });
  };
  const double all = static_cast<double>(report->photos.size()) + 1;
  for (int percent = std::lround(100 * kLeastFoundFrom); percent < 100; ++percent) {
    report->found_from = percent / 100.0;
    report->reaches_rate = (1 + static_cast<double>(alarms(report->found_from))) / all <= rate;
    if (report->reaches_rate) return;
  }
}

void CollectSimilar(SelfTestReport* report) {
  std::map<std::pair<std::string, std::string>, SimilarObjects> pairs;
  const auto name = [](const std::string& object, const std::string& image) {
    return object.empty() ? "id " + image : "object " + object;
  };
  for (const SelfTestPhoto& asked : report->photos) {
    if (!asked.false_alarm) continue;
    const auto names =
        std::minmax({name(asked.object, asked.image_id), name(asked.other, asked.other_image)});
    SimilarObjects& pair = pairs
                               .try_emplace({names.first, names.second},
                                            SimilarObjects{asked.object, asked.image_id,
                                                           asked.other, asked.other_image})
                               .first->second;
    ++pair.confused;
  }
  for (auto& [names, pair] : pairs) report->similar.push_back(std::move(pair));
  std::ranges::stable_sort(report->similar, std::greater(), &SimilarObjects::confused);
}

}  // namespace

SelfTestReport RunSelfTest(Engine& engine, const SelfTestOptions& options) {
  const Stopwatch watch;
  Require(options.pictures >= 1 && options.pictures <= kMostPictures,
          "pictures must be 1 to " + std::to_string(kMostPictures));
  Require(options.false_alarms > 0 && options.false_alarms < 1,
          "false_alarms must be above 0 and below 1");
  SelfTestReport report;
  const std::vector<ImageRecord> subjects = DrawSubjects(engine, options, &report);
  if (subjects.empty()) {
    throw Error(ErrorCode::kConflict, "no_images",
                "The collection \"" + options.collection + "\" has no images. Add some first.");
  }
  std::ranges::stable_sort(report.plain, {}, &PlainImage::keypoints);
  const auto count = static_cast<std::size_t>(options.pictures);
  std::vector<std::optional<SelfTestPhoto>> asked(count);
  const SelfTester tester(engine, options);
  std::atomic<std::uint64_t> done = 0;
  ParallelFor(count, options.threads, [&](std::size_t i) {
    if (options.stop.stop_requested()) {
      throw Error(ErrorCode::kCancelled, "cancelled", "The self-test was stopped.");
    }
    asked[i] = tester.Ask(subjects[i % subjects.size()], static_cast<int>(i));
    if (options.progress) options.progress(++done, count);
  });
  for (auto& one : asked) {
    if (one) report.photos.push_back(*std::move(one));
  }
  if (report.photos.empty()) {
    throw Error(ErrorCode::kNotFound, "content_not_kept",
                "The collection \"" + options.collection +
                    "\" stores no image files, so none can be photographed. Keep the "
                    "originals of images when you add them.");
  }
  Calibrate(options.false_alarms, &report);
  CollectSimilar(&report);
  report.seconds = watch.seconds();
  return report;
}

}  // namespace pliant
