// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Engine: searching, comparing and locating.
#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>

#include "descriptor/base/error.h"
#include "descriptor/base/parallel.h"
#include "descriptor/base/stopwatch.h"
#include "descriptor/features/enlarged_keypoints.h"
#include "descriptor/features/keypoints.h"
#include "index/engine/engine_core.h"
#include "index/engine/search_run.h"
#include "index/files/text.h"
#include "index/store/blob_codec.h"
#include "index/verify/appearance.h"
#include "index/verify/locate.h"
#include "index/verify/verification.h"

namespace pliant {
namespace {

void CheckVocabulary(const CollectionView& view, const SearchOptions& options) {
  if (view.has_vocabulary()) return;
  throw Error(ErrorCode::kConflict, "no_vocabulary",
              "collection \"" + options.collection + "\" has no vocabulary yet");
}

void CheckQuery(const Features& features, const std::optional<Region>& region) {
  if (features.keypoints.size() >= kMinKeypoints) return;
  if (region && LongerSide(*region, features.width, features.height) == 0) {
    throw Error(ErrorCode::kUnprocessable, "too_few_features",
                "The region lies outside the query image of " + std::to_string(features.width) +
                    " x " + std::to_string(features.height) + " pixels.");
  }
  throw Error(ErrorCode::kUnprocessable, "too_few_features",
              std::string(region ? "The region of the query image" : "The query image") + " has " +
                  std::to_string(features.keypoints.size()) + " keypoints; at least " +
                  std::to_string(kMinKeypoints) + " are needed.");
}

[[noreturn]] void ThrowInvalid(const std::string& field, const std::string& message) {
  throw Error(ErrorCode::kInvalidArgument, field + "_invalid", field + " " + message);
}

// Maximum number of an object's images that are compared: the best-ranked ones.
constexpr int kMostCompared = 24;

// Hits per example: images below this rank in every example are not among the best.
constexpr std::size_t kHitsAnExample = 1000;

void CheckExamples(const std::vector<std::string>& ids, const SearchOptions& options) {
  const auto refuse = [](const char* reason, const std::string& message) {
    throw Error(ErrorCode::kInvalidArgument, reason, message);
  };
  if (ids.empty() || ids.size() > kMaxExamples) {
    refuse("examples_invalid", "examples must have 1 to " + std::to_string(kMaxExamples) +
                                   " images, not " + std::to_string(ids.size()) + ".");
  }
  if (std::set<std::string>(ids.begin(), ids.end()).size() != ids.size()) {
    refuse("examples_invalid", "examples must not contain an image twice.");
  }
  if (options.region) {
    refuse("region_invalid", "region cannot be combined with several examples.");
  }
}

// Hits of all examples, by what they are of.
class Merger {
 public:
  Merger(GroupBy group_by, double min_score) : group_by_(group_by), min_score_(min_score) {}

  void Add(const std::string& example, std::vector<Hit> hits) {
    for (Hit& hit : hits) {
      const bool by_object = group_by_ == GroupBy::kObject && !hit.object.empty();
      const auto [at, is_new] =
          merged_.try_emplace({by_object, by_object ? hit.object : hit.image_id});
      Entry& entry = at->second;
      entry.missing *= 1 - hit.score;
      const auto probability = std::max(entry.hit.probability, hit.probability);  // absent: least
      if (is_new || hit.score > entry.best) {
        entry.best = hit.score;
        entry.hit = std::move(hit);
        entry.hit.example = example;
      }
      entry.hit.probability = probability;
    }
  }

  // Best first.
  std::vector<Hit> Take() {
    std::vector<Hit> hits;
    for (auto& [key, entry] : merged_) {
      entry.hit.score = 1 - entry.missing;
      if (entry.hit.score >= min_score_) hits.push_back(std::move(entry.hit));
    }
    std::sort(hits.begin(), hits.end(), [](const Hit& a, const Hit& b) {
      if (a.probability != b.probability) return a.probability > b.probability;
      return a.score != b.score ? a.score > b.score : a.image_id < b.image_id;
    });
    for (std::size_t i = 0; i < hits.size(); ++i) hits[i].rank = i + 1;
    return hits;
  }

 private:
  struct Entry {
    Hit hit;
    double best = 0;
    double missing = 1;  // the product of 1 - score
  };
  const GroupBy group_by_;
  const double min_score_;
  std::map<std::pair<bool, std::string>, Entry> merged_;
};

void AddUp(const ExtractionTimings& one, ExtractionTimings* sum) {
  sum->decode_ms += one.decode_ms;
  sum->detect_ms += one.detect_ms;
  sum->describe_ms += one.describe_ms;
}

void AddUp(const SearchTimings& one, SearchTimings* sum) {
  AddUp(one.extraction, &sum->extraction);
  sum->quantize_ms += one.quantize_ms;
  sum->rank_ms += one.rank_ms;
  sum->verify_ms += one.verify_ms;
  sum->database_ms += one.database_ms;
}

std::vector<Hit> PageOf(std::vector<Hit> hits, const SearchOptions& options) {
  const auto begin = std::min(options.offset, hits.size());
  const auto end = options.limit == 0 ? hits.size() : std::min(hits.size(), begin + options.limit);
  return {std::make_move_iterator(hits.begin() + static_cast<std::ptrdiff_t>(begin)),
          std::make_move_iterator(hits.begin() + static_cast<std::ptrdiff_t>(end))};
}

ComparedImage Checked(const Features& features, const char* which) {
  const std::size_t keypoints = features.keypoints.size();
  if (keypoints < kMinKeypoints) {
    throw Error(ErrorCode::kUnprocessable, "too_few_features",
                std::string("The ") + which + " image has " + std::to_string(keypoints) +
                    " keypoints; at least " + std::to_string(kMinKeypoints) + " are needed.");
  }
  return {features.width, features.height, static_cast<std::uint32_t>(keypoints)};
}

// What the features of both say; adds to verify_ms.
void Conclude(const Features& query, std::size_t usual_keypoints, const Features& reference,
              int threads, Comparison* comparison) {
  const Stopwatch watch;
  const VerificationResult result = Verifier(query, {.max_instances = SearchOptions().max_instances,
                                                     .threads = threads,
                                                     .usual_keypoints = usual_keypoints})
                                        .Verify(reference);
  comparison->verify_ms += watch.ms();
  comparison->explanation = ExplainInstances(query, reference, result).front();
  comparison->explanation.ranking_score = kVerify.most_of_ranking;
  comparison->outline.clear();
  for (const Vec2 p : result.outline) comparison->outline.push_back({p.x, p.y});
  const double evidence =
      Evidence(result.effective_inliers,
               InliersByChance(query.keypoints.size(), result.distinctness, result.agreeing));
  comparison->explanation.appearance = CompareAppearance(query, reference, result);
  comparison->probability = Rounded(Probability(kVerify.most_of_ranking, evidence));
}

// Throws kInvalidArgument that names the option.
void Validate(const SearchOptions& options) {
  if (!std::isfinite(options.min_score) || options.min_score < 0 || options.min_score > 1) {
    ThrowInvalid("min_score", "must be 0 to 1.");
  }
  if (options.threads < 0) ThrowInvalid("threads", "must not be negative.");
  if (options.max_instances < 1) ThrowInvalid("max_instances", "must be 1 or more.");
  if (options.without.size() > kMaxExcluded) {
    ThrowInvalid("without", "can have at most " + std::to_string(kMaxExcluded) + " images.");
  }
  CheckFilter(options.filter);
  if (!options.region) return;
  const Region& r = *options.region;
  for (const double value : {r.x, r.y, r.width, r.height}) {
    if (!std::isfinite(value)) ThrowInvalid("region", "must be four finite numbers.");
  }
  if (r.width <= 0 || r.height <= 0)
    ThrowInvalid("region", "must have a width and height above 0.");
}

// kConflict "no_vocabulary". Where nothing is found and `second` has more features, these verify
// the same ranking once more; the answer whose first hit has more evidence.
SearchResult Answer(EngineCore& core, const CollectionView& view, Features features,
                    const SearchOptions& options, const ExtractionTimings& timings,
                    const Engine::SecondPass& second = {}) {
  CheckVocabulary(view, options);
  const auto of_region = [&](Features all) {
    if (!options.region) return all;
    return Subset(all, [&](const Keypoint& k) { return Contains(*options.region, k.x, k.y); });
  };
  features = of_region(std::move(features));
  CheckQuery(features, options.region);
  SearchRun run(&core, view, features, options);
  SearchResult result = run.Run(features);
  std::size_t keypoints = features.keypoints.size();
  ExtractionTimings extraction = timings;
  const bool found_nothing = result.found == std::size_t{0} && !run.undecided();
  if (second && options.second_pass && found_nothing) {
    if (std::optional<Features> finer = second(&extraction)) {
      const Features verified = of_region(InStoredPrecision(*std::move(finer)));
      SearchResult again = run.Run(verified);
      // Without evidence the first order is the better one: fine keypoints resemble much by
      // chance.
      if (again.evidence > result.evidence) {
        result = std::move(again);
        keypoints = verified.keypoints.size();
      } else {
        result.timings = again.timings;
      }
      result.second_pass = true;
    }
  }
  result.timings.extraction = extraction;
  result.vocabulary = view.vocabulary;
  result.words = view.quantizer->vocabulary().size();
  result.keypoints = static_cast<std::uint32_t>(keypoints);
  result.query_width = features.width;
  result.query_height = features.height;
  return result;
}

// A print of letters or pictures matches its mirror image only where it is symmetric.
bool CanBeMirrored(const SearchResult& result, const SearchOptions& options) {
  constexpr double kUnmirrored = 15;  // most symmetric motifs have less evidence
  return options.second_pass && !options.region && result.found && result.evidence < kUnmirrored;
}

bool IsMirrored(const SearchResult& mirrored, const SearchResult& result) {
  constexpr double kClearly = 2;
  return mirrored.found > std::size_t{0} && mirrored.evidence > kClearly * result.evidence;
}

// Back to the pixels of the query.
void Unmirror(SearchResult* result) {
  const double last = result->query_width - 1.0;
  const auto unmirror = [&](auto& points) {
    for (auto& p : points) p.x = static_cast<decltype(p.x)>(last - p.x);
  };
  for (Hit& hit : result->hits) {
    unmirror(hit.polygon);
    for (Instance& instance : hit.instances) unmirror(instance.polygon);
    if (!hit.explanation) continue;
    for (PointPair& pair : hit.explanation->inliers) pair.query.x = last - pair.query.x;
    if (hit.explanation->mesh) unmirror(hit.explanation->mesh->points);
  }
}

// All of the object's images, or one more than are compared.
std::vector<ImageRef> ImagesOf(EngineCore& core, const std::string& collection,
                               const std::string& object) {
  ImageListing list;
  list.which.collection = collection;
  list.which.object = object;
  list.limit = kMostCompared + 1;
  const Key key = core.catalogue().RequireCollection(collection).key;
  std::vector<ImageRef> refs;
  for (const ImageRecord& image : core.catalogue().ListImagePage(list).records)
    refs.push_back({key, image.id});
  return refs;
}

// Those of the object's images that rank best for the query; `some` where there is no vocabulary.
std::vector<ImageRef> MostSimilar(EngineCore& core, const Features& query,
                                  const std::string& collection, const std::string& object,
                                  int threads, std::vector<ImageRef> some) {
  const CollectionView view = core.View(collection);
  if (!view.has_vocabulary() || query.keypoints.size() < kMinKeypoints) return some;
  RankOptions options;
  options.keep = kMostCompared;
  options.threads = threads;
  options.admission = core.catalogue().Admit(view.collection, object, {}, {});
  const Ranking ranking = core.Rank(
      view,
      NeighboursOf(query.descriptors, ContrastWeights(query.keypoints), *view.quantizer, threads),
      options);
  if (ranking.best.empty()) return some;
  some.clear();
  for (const RankedImage& image : ranking.best) some.push_back(image.ref);
  return some;
}

}  // namespace

SearchResult Engine::Search(Bytes encoded, const SearchOptions& options) {
  Validate(options);
  const CollectionView view = core_->View(options.collection);
  CheckVocabulary(view, options);  // before any work
  ExtractionTimings timings;
  const FeatureExtractor& extractor = core_->query_extractor();
  const Features features =
      options.region ? extractor.ExtractPart(encoded, *options.region, options.threads, &timings)
                     : extractor.Extract(encoded, options.threads, &timings);
  SearchResult result = Answer(*core_, view, InStoredPrecision(features), options, timings,
                               [&](ExtractionTimings* more) {
                                 return extractor.ExtractSecondPass(
                                     encoded, features, options.region, options.threads, more);
                               });
  if (!CanBeMirrored(result, options)) return result;
  const Features flipped = extractor.ExtractMirrored(encoded, options.threads, &timings);
  SearchResult mirrored = Answer(*core_, view, InStoredPrecision(flipped), options, timings);
  const bool is_mirrored = IsMirrored(mirrored, result);
  SearchResult& answer = is_mirrored ? mirrored : result;
  SearchResult& other = is_mirrored ? result : mirrored;
  AddUp(other.timings, &answer.timings);
  answer.second_pass |= other.second_pass;
  if (is_mirrored) Unmirror(&answer);
  answer.mirrored = is_mirrored;
  return std::move(answer);
}

SearchResult Engine::SearchStored(const std::string& image_id, const SearchOptions& options) {
  Validate(options);
  const CollectionView view = core_->View(options.collection);
  return Answer(*core_, view, core_->GetFeatures({view.collection, image_id}, options.collection),
                options, {});
}

SearchResult Engine::SearchFeatures(const Features& features, const SearchOptions& options,
                                    const SecondPass& second) {
  Validate(options);
  core_->CheckFeatures(features);
  return Answer(*core_, core_->View(options.collection), InStoredPrecision(features), options, {},
                second);
}

ObjectLocation Engine::Locate(Bytes encoded, const std::string& collection,
                              const std::string& object, int threads) {
  std::vector<ImageRef> refs = ImagesOf(*core_, collection, object);
  if (refs.empty()) {
    throw Error(ErrorCode::kNotFound, "object_not_found",
                "No image shows the object '" + Shown(object) + "'.");
  }
  ObjectLocation result;
  result.object = object;
  const Features query =
      InStoredPrecision(core_->extractor().Extract(encoded, threads, &result.timings));
  result.query_width = query.width;
  result.query_height = query.height;

  const Stopwatch watch;
  if (refs.size() > static_cast<std::size_t>(kMostCompared)) {
    refs.pop_back();
    refs = MostSimilar(*core_, query, collection, object, threads, std::move(refs));
  }
  std::vector<std::optional<StoredImage>> images =
      core_->catalogue().LoadImages(refs, Load::kRecordsAndFeatures);
  std::erase_if(images, [](const auto& image) { return !image; });  // removed just now
  const LocateOptions options;
  const Verifier verifier(query, options.verification);
  std::vector<Location> locations(images.size());
  ParallelFor(images.size(), threads, [&](std::size_t i) {
    Features features = DecodeFeatures(images[i]->features);
    features.model_id = query.model_id;
    locations[i] = pliant::Locate(verifier, query, features, options);
  });
  const auto better = [](const Location& a, const Location& b) {
    return a.found != b.found ? a.found : a.inliers.size() > b.inliers.size();
  };
  result.compared = images.size();
  for (std::size_t i = 0; i < images.size(); ++i) {
    if (i > 0 && !better(locations[i], result.location)) continue;
    result.image_id = images[i]->record.id;
    result.location = std::move(locations[i]);
  }
  result.locate_ms = watch.ms();
  return result;
}

std::optional<Features> Engine::DescribeFiner(Bytes encoded, const Features& known, int threads) {
  return core_->query_extractor().ExtractSecondPass(encoded, known, {}, threads);
}

SearchResult Engine::SearchExamples(const std::vector<std::string>& image_ids,
                                    const SearchOptions& options) {
  Validate(options);
  CheckExamples(image_ids, options);
  SearchOptions single = options;
  single.limit = kHitsAnExample;
  single.offset = 0;
  single.min_score = 0;
  single.without.insert(single.without.end(), image_ids.begin(), image_ids.end());
  const CollectionView view = core_->View(options.collection);
  std::vector<Features> examples;  // all, before any search
  for (const std::string& id : image_ids) {
    examples.push_back(core_->GetFeatures({view.collection, id}, options.collection));
  }
  SearchResult result;
  Merger merger(options.group_by, options.min_score);
  for (std::size_t i = 0; i < image_ids.size(); ++i) {
    const std::string& id = image_ids[i];
    SearchResult one = Answer(*core_, view, std::move(examples[i]), single, {});
    result.examples.push_back({id, one.keypoints, one.query_width, one.query_height});
    AddUp(one.timings, &result.timings);
    result.rank = one.rank;
    result.vocabulary = one.vocabulary;
    result.words = one.words;
    result.keypoints += one.keypoints;
    if (one.found) result.found = 0;
    result.searched = std::min(result.searched, one.searched);
    result.found_from = one.found_from;
    merger.Add(id, std::move(one.hits));
  }
  std::vector<Hit> hits = merger.Take();
  result.total = hits.size();
  if (result.found) Judge(hits, &result);
  result.hits = PageOf(std::move(hits), options);
  return result;
}

Comparison Engine::Compare(Bytes first, Bytes second, int threads) {
  Comparison comparison;
  // Each as a search would have it: the first as what is stored, the second as what is asked.
  const auto describe = [&](const FeatureExtractor& extract, Bytes bytes, const char* which,
                            ComparedImage* image) {
    ExtractionTimings timings;
    Features features = extract.Extract(bytes, threads, &timings);
    *image = Checked(features, which);
    AddUp(timings, &comparison.timings);
    return features;
  };
  const Features reference =
      InStoredPrecision(describe(core_->extractor(), first, "first", &comparison.first));
  const Features query = describe(core_->query_extractor(), second, "second", &comparison.second);
  const std::size_t usual = query.keypoints.size();
  Conclude(InStoredPrecision(query), usual, reference, threads, &comparison);
  if (comparison.found()) return comparison;
  auto finer =
      core_->query_extractor().ExtractSecondPass(second, query, {}, threads, &comparison.timings);
  if (!finer) return comparison;
  Comparison at_second_sight = comparison;
  at_second_sight.second = Checked(*finer, "second");
  Conclude(InStoredPrecision(*std::move(finer)), usual, reference, threads, &at_second_sight);
  comparison.verify_ms = at_second_sight.verify_ms;
  return at_second_sight.probability > comparison.probability ? at_second_sight : comparison;
}

}  // namespace pliant
