// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/evaluation/retrieval_gallery.h"

#include <algorithm>
#include <atomic>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "descriptor/base/error.h"
#include "descriptor/base/parallel.h"
#include "descriptor/base/replace_file.h"
#include "descriptor/base/sha256.h"
#include "index/files/image_files.h"
#include "index/files/text.h"
#include "index/store/blob_codec.h"

namespace pliant {
namespace fs = std::filesystem;

namespace {

constexpr const char* kSearched = "gallery";  // collections
constexpr const char* kQueries = "queries";
constexpr const char* kFeatures = "features";  // of all images ever, when they are kept

constexpr std::size_t kNamedHits = 10;  // of a query
constexpr std::size_t kTimedQueries = 20;
constexpr std::size_t kSizedImages = 100;
constexpr std::size_t kIdDigits = 32;

EngineOptions ToEngineOptions(const RetrievalGalleryOptions& options) {
  EngineOptions engine;
  engine.database = options.database;
  engine.custom_descriptor = options.descriptor;
  engine.extraction = options.extraction;
  engine.enlarge = options.enlarge;
  engine.keep_originals = false;
  return engine;
}

bool HasSeveralImagesOfAnObject(const RetrievalSet& set) {
  std::set<std::string> seen;
  return std::ranges::any_of(set.images, [&](const auto& image) {
    return image.is_searched && !image.object.empty() && !seen.insert(image.object).second;
  });
}

// The engine's own ids are the images' hashes; images with the same bytes get a number here.
void NumberRepeats(std::vector<std::string>* ids) {
  std::map<std::string, int> seen;
  for (std::string& id : *ids) {
    const int repeat = seen[id]++;
    if (repeat > 0) id += '-' + std::to_string(repeat);
  }
}

}  // namespace

RetrievalGallery::RetrievalGallery(RetrievalSet set, RetrievalGalleryOptions options)
    : set_(std::move(set)), options_(std::move(options)), engine_(ToEngineOptions(options_)) {
  for (const char* collection : {kSearched, kQueries}) {
    engine_.RemoveCollection(collection);
    engine_.CreateCollection(collection);
  }
  if (options_.keep_features) engine_.CreateCollection(kFeatures);
  Fill();
  possible_ = CountRightAnswers(set_);
  several_images_of_an_object_ = HasSeveralImagesOfAnObject(set_);
  for (std::size_t i = 0; i < set_.images.size(); ++i) {
    if (set_.images[i].is_query) queries_.push_back(i);
  }
}

void RetrievalGallery::Fill() {
  const std::size_t total = set_.images.size();
  std::vector<std::optional<SkippedFile>> failures(total);
  std::vector<std::string> ids(total);
  // Runs work(i, bytes) for each image without a failure; keeps the failures.
  const auto for_each = [&](const auto& work) {
    ParallelFor(total, options_.jobs, [&](std::size_t i) {
      ThrowIfStopped();
      if (failures[i]) return;
      const std::filesystem::path& path = set_.images[i].path;
      try {
        work(i, ReadFile(path, options_.extraction.decode.max_bytes));
      } catch (const Error& error) {
        if (error.reason() != "cannot_read" && !ConcernsOneImage(error.code())) throw;
        failures[i] = {ToDisplayText(path.string()), error.reason(), ToDisplayText(error.what())};
      }
    });
  };
  for_each([&](std::size_t i, Bytes bytes) { ids[i] = Sha256Hex(bytes).substr(0, kIdDigits); });
  NumberRepeats(&ids);
  std::atomic<std::size_t> done{0};
  for_each([&](std::size_t i, Bytes bytes) {
    Add(set_.images[i], ids[i], bytes);
    const std::size_t now = ++done;
    if (options_.progress) options_.progress(now, total);
  });
  bool searched = false;
  for (std::size_t i = 0; i < total; ++i) {
    if (failures[i]) {
      set_.skipped.push_back(*std::move(failures[i]));
      ids[i].clear();
    } else {
      searched = searched || set_.images[i].is_searched;
    }
  }
  if (!searched) {
    throw Error(ErrorCode::kUnprocessable, "nothing_to_search",
                "every image to search was refused; the first: " + set_.skipped.front().reason);
  }
  ids_ = std::move(ids);
}

void RetrievalGallery::Add(const RetrievalImage& image, const std::string& id, Bytes bytes) {
  AddRequest request;
  request.bytes = bytes;
  request.id = id;
  std::optional<Features> foreign;
  if (options_.features) {  // with the colours that images of Pliant's own descriptors have
    foreign = options_.features(image.path);
    DecodeOptions decode = options_.extraction.decode;
    decode.colour = true;
    foreign->colours = MakeColourGrid(DecodeImage(bytes, decode).image);
  }
  const auto add = [&](const char* collection) {
    request.collection = collection;
    if (foreign) {
      engine_.AddFeatures(request, *foreign);
    } else {
      engine_.Add(request);
    }
  };
  request.as_query = !image.is_searched;
  if (options_.keep_features) {  // the other collections find the features there, by the same bytes
    add(kFeatures);
  }
  request.object = image.object;
  if (image.is_searched) {
    add(kSearched);
  }
  if (image.is_query || image.is_absent) {
    add(kQueries);
  }
}

void RetrievalGallery::ThrowIfStopped() const {
  if (!options_.stop.stop_requested()) return;
  throw Error(ErrorCode::kCancelled, "evaluation_cancelled", "stopped on request");
}

std::size_t RetrievalGallery::UseNewVocabulary(int words, int sample, std::uint64_t seed) {
  TrainOptions train;
  train.collection = kSearched;
  train.words = words;
  if (sample > 0) train.sample = sample;
  train.seed = seed;
  train.stop = options_.stop;
  const VocabularyRecord vocabulary = engine_.TrainVocabulary(train);
  engine_.UseVocabulary(kSearched, vocabulary.id);
  return vocabulary.words;
}

// As Engine::Search does.
SearchResult RetrievalGallery::Search(std::size_t image, SearchOptions search) {
  ThrowIfStopped();
  search.collection = kSearched;
  const Features features = engine_.GetFeatures(kQueries, ids_[image]);
  if (options_.features) return engine_.SearchFeatures(features, search);
  return engine_.SearchFeatures(features, search,
                                [&](ExtractionTimings*) { return SecondPass(image, features); });
}

std::optional<Features> RetrievalGallery::SecondPass(std::size_t image, const Features& known) {
  const fs::path kept = fs::path(options_.database.string() + ".closer") / ids_[image];
  if (fs::exists(kept)) {
    Features features = DecodeFeatures(ReadFile(kept, std::numeric_limits<std::int64_t>::max()));
    features.model_id = known.model_id;
    return features;
  }
  const auto bytes = ReadFile(set_.images[image].path, options_.extraction.decode.max_bytes);
  std::optional<Features> features = engine_.DescribeFiner(bytes, known, /*threads=*/0);
  if (!features) return features;
  const std::vector<std::uint8_t> encoded = EncodeFeatures(*features);
  const std::string_view text(reinterpret_cast<const char*>(encoded.data()), encoded.size());
  std::error_code failed;
  fs::create_directories(kept.parent_path(), failed);
  if (!failed) failed = ReplaceFile(kept, {&text, 1});
  if (failed) {
    throw Error(ErrorCode::kNoSpace, "folder_unwritable",
                "cannot write " + ToDisplayText(kept.string()) +
                    "; give a writable folder on a disk with free space");
  }
  return features;
}

NamedAnswer RetrievalGallery::Named(std::size_t query, const std::vector<Hit>& hits) const {
  const RetrievalImage& asked = set_.images[query];
  NamedAnswer answer{.file = asked.path, .object = asked.object};
  for (const Hit& hit : hits) {
    if (answer.hits.size() == kNamedHits) break;
    if (!set_.counts_itself && hit.image_id == ids_[query]) continue;
    const auto at = std::find(ids_.begin(), ids_.end(), hit.image_id) - ids_.begin();
    answer.hits.push_back({hit.object, set_.images[static_cast<std::size_t>(at)].path, hit.score,
                           hit.probability, hit.inliers, hit.object == asked.object});
  }
  return answer;
}

std::vector<RetrievalAnswer> RetrievalGallery::Ask(SearchOptions search, RetrievalTimes* times,
                                                   std::vector<NamedAnswer>* named) {
  search.group_by = several_images_of_an_object_ ? GroupBy::kImage : GroupBy::kObject;
  search.limit = 0;
  std::vector<RetrievalAnswer> answers;
  const double share = 1.0 / static_cast<double>(queries_.size() - refused_queries());
  for (const std::size_t q : queries_) {
    RetrievalAnswer answer;
    answer.possible = possible_[q];
    SearchResult result;
    if (!ids_[q].empty()) {
      result = Search(q, search);
      for (const Hit& hit : result.hits) {
        if (!set_.counts_itself && hit.image_id == ids_[q]) continue;
        if (answer.right.empty()) answer.found = hit.probability.value_or(0) >= kFoundProbability;
        answer.right.push_back(hit.object == set_.images[q].object);
      }
      if (times != nullptr) {
        times->quantize += share * result.timings.quantize_ms;
        times->rank += share * result.timings.rank_ms;
        times->verify += share * result.timings.verify_ms;
      }
    }
    if (named != nullptr) named->push_back(Named(q, result.hits));
    answers.push_back(std::move(answer));
  }
  return answers;
}

ObjectAnswer RetrievalGallery::AskForObjects(SearchOptions search) {
  search.limit = 0;
  ObjectAnswer mean;
  const double share = 1.0 / static_cast<double>(queries_.size());
  for (const std::size_t q : queries_) {
    if (ids_[q].empty()) continue;
    for (const Hit& hit : Search(q, search).hits) {
      if (hit.object != set_.images[q].object) continue;
      mean.mrr += share / static_cast<double>(hit.rank);
      if (hit.rank == 1) mean.top1 += share;
      break;
    }
  }
  return mean;
}

AbsentAnswers RetrievalGallery::AskAbsent(SearchOptions search) {
  search.limit = 1;
  AbsentAnswers answers;
  for (std::size_t i = 0; i < set_.images.size(); ++i) {
    if (!set_.images[i].is_absent || ids_[i].empty()) continue;
    ++answers.asked;
    if (Search(i, search).found > 0) ++answers.alarms;
  }
  return answers;
}

AbsentAnswers RetrievalGallery::AskLeftOut(SearchOptions search, std::vector<NamedAnswer>* named) {
  search.limit = 1;
  AbsentAnswers answers;
  for (const std::size_t q : queries_) {
    if (ids_[q].empty()) continue;
    search.without.clear();
    for (std::size_t i = 0; i < ids_.size(); ++i) {
      const bool same = set_.images[i].object == set_.images[q].object;
      if (same && set_.images[i].is_searched && !ids_[i].empty()) search.without.push_back(ids_[i]);
    }
    if (search.without.size() > kMaxExcluded) continue;
    const SearchResult result = Search(q, search);
    if (!result.found) return {};
    ++answers.asked;
    if (*result.found > 0) ++answers.alarms;
    if (named != nullptr) {
      named->push_back(Named(q, result.hits));
      named->back().left_out = true;
    }
  }
  return answers;
}

std::size_t RetrievalGallery::refused_queries() const {
  return static_cast<std::size_t>(std::count_if(queries_.begin(), queries_.end(),
                                                [&](std::size_t q) { return ids_[q].empty(); }));
}

void RetrievalGallery::TimeExtraction(RetrievalTimes* times) {
  if (options_.features) return;
  const FeatureExtractor extractor(options_.descriptor, options_.extraction);
  std::vector<std::size_t> timed;
  for (const std::size_t q : queries_) {
    if (!ids_[q].empty() && timed.size() < kTimedQueries) timed.push_back(q);
  }
  const std::size_t count = timed.size();
  for (const std::size_t q : timed) {
    const auto bytes = ReadFile(set_.images[q].path, options_.extraction.decode.max_bytes);
    ExtractionTimings passed;
    extractor.Extract(bytes, 0, &passed);
    times->decode += passed.decode_ms / static_cast<double>(count);
    times->detect += passed.detect_ms / static_cast<double>(count);
    times->describe += passed.describe_ms / static_cast<double>(count);
  }
}

std::vector<std::string> RetrievalGallery::SearchedIds() const {
  std::vector<std::string> searched;
  for (std::size_t i = 0; i < ids_.size(); ++i) {
    if (set_.images[i].is_searched && !ids_[i].empty()) searched.push_back(ids_[i]);
  }
  return searched;
}

double RetrievalGallery::StoredBytesPerImage() {
  const std::vector<std::string> searched = SearchedIds();
  const std::size_t step = std::max<std::size_t>(1, searched.size() / kSizedImages);
  double bytes = 0;
  double images = 0;
  for (std::size_t i = 0; i < searched.size(); i += step) {
    bytes +=
        static_cast<double>(EncodeFeatures(engine_.GetFeatures(kSearched, searched[i])).size());
    ++images;
  }
  return bytes / images;
}

double RetrievalGallery::IndexBytesPerImage() {
  return static_cast<double>(engine_.Stats().index_bytes) /
         static_cast<double>(SearchedIds().size());
}

}  // namespace pliant
