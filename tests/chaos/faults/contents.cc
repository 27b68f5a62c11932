// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "tests/chaos/faults/contents.h"

#include <cstdio>

#include "descriptor/base/error.h"
#include "descriptor/base/sha256.h"
#include "descriptor/features/descriptor.h"
#include "index/store/open_store.h"
#include "tests/unit/index_test_images.h"

namespace pliant::chaos {
namespace {

constexpr int kWidthPx = 64;
constexpr int kHeightPx = 48;
constexpr int kMostKeypoints = 48;

// Binary descriptors: the cheapest, and a vocabulary of them has codes, too.
std::shared_ptr<const Descriptor> TheDescriptor() {
  static const std::shared_ptr<const Descriptor> descriptor = MakeDescriptor("orb");
  return descriptor;
}

// What cannot be had says why.
template <typename Work>
std::string Said(Work&& work) {
  try {
    return work();
  } catch (const Error& error) {
    return "error " + error.reason();
  }
}

std::string HashOf(const Features& features) {
  std::string all;
  for (const Keypoint& point : features.keypoints) {
    all += std::to_string(point.x) + " " + std::to_string(point.y) + "\n";
  }
  const auto& bytes = features.descriptors.bytes;
  all.append(bytes.begin(), bytes.end());
  return Sha256Hex(all).substr(0, 16);
}

std::string Line(const ImageRecord& record) {
  return record.object + " " + record.sha256.substr(0, 16) + " " + record.media_type + " " +
         record.metadata + " " + record.source + " " + std::to_string(record.width) + "x" +
         std::to_string(record.height) + " " + std::to_string(record.keypoints) + " " +
         std::to_string(record.bytes);
}

std::string Line(const SearchResult& result) {
  std::string line = std::to_string(result.words) + " words:";
  for (const Hit& hit : result.hits) {
    char score[16];
    std::snprintf(score, sizeof score, "%.4f", hit.score);
    line += " " + hit.image_id + "=" + score;
  }
  return line;
}

}  // namespace

const std::vector<std::uint8_t>& ImageBytes(std::uint64_t seed) {
  static std::map<std::uint64_t, std::vector<std::uint8_t>> images;
  std::vector<std::uint8_t>& bytes = images[seed];
  if (bytes.empty()) bytes = EncodePng(testing::RandomImage(seed, kWidthPx, kHeightPx));
  return bytes;
}

EngineOptions OptionsFor(const std::filesystem::path& folder) {
  EngineOptions options;
  options.database = folder / "a.db";
  options.custom_descriptor = TheDescriptor();
  options.max_keypoints = kMostKeypoints;
  options.enlarge = false;
  options.busy_timeout_ms = 300;
  options.reserve_bytes = 0;
  return options;
}

Probes::Probes(int count) {
  ExtractionOptions options;
  options.keypoints.max_keypoints = kMostKeypoints;
  const FeatureExtractor extract(TheDescriptor(), options);
  for (int i = 1; i <= count; ++i) {
    features_.push_back(extract.Extract(ImageBytes(static_cast<std::uint64_t>(i)), 1));
  }
}

Contents Probes::Look(Engine& engine, const std::filesystem::path& database) const {
  Contents contents;
  for (const std::string& collection : engine.ListCollections()) {
    LookInto(engine, collection, &contents);
  }
  for (const AliasRecord& alias : engine.ListAliases()) {
    contents["alias " + alias.name] = alias.collection;
  }
  const auto service = OpenServiceStore(database);
  for (const ApiKeyRecord& key : service->Keys()) {
    contents["key " + key.id] = key.name + " " + key.scope + " " + key.hash.substr(0, 16) +
                                (key.revoked_ms != 0 ? " revoked" : "");
  }
  for (const JobRecord& job : service->Jobs()) {
    contents["job " + job.id] = job.kind + " " + job.state + " " + job.parameters;
  }
  return contents;
}

void Probes::LookInto(Engine& engine, const std::string& collection, Contents* contents) const {
  const CollectionRecord record = engine.GetCollection(collection);
  const std::string in = "collection " + collection;
  (*contents)[in] = std::to_string(record.images) + " images, " + std::to_string(record.objects) +
                    " objects, " + std::to_string(record.descriptors) + " descriptors" +
                    (record.automatic ? ", automatic" : "") + record.display_name;
  int number = 0;
  for (const VocabularyRecord& vocabulary : engine.ListVocabularies(collection)) {
    (*contents)[in + ", vocabulary " + std::to_string(++number)] =
        std::to_string(vocabulary.words) + " words, seed " +
        std::to_string(vocabulary.origin.seed) + ", loss " +
        std::to_string(vocabulary.origin.loss) + (vocabulary.active ? ", active" : "");
  }
  ImageListing list;
  list.which.collection = collection;
  list.limit = 1000;
  for (const ImageRecord& image : engine.ListPage(list).records) {
    const std::string name = in + ", image " + image.id;
    (*contents)[name] = Line(image);
    (*contents)[name + ", bytes"] =
        Said([&] { return Sha256Hex(engine.GetContent(collection, image.id)).substr(0, 16); });
    (*contents)[name + ", features"] =
        Said([&] { return HashOf(engine.GetFeatures(collection, image.id)); });
  }
  if (!record.vocabulary) return;
  SearchOptions search;
  search.collection = collection;
  search.group_by = GroupBy::kImage;
  search.verify = Verification::kNone;
  search.threads = 1;
  for (std::size_t i = 0; i < features_.size(); ++i) {
    (*contents)[in + ", search " + std::to_string(i + 1)] =
        Said([&] { return Line(engine.SearchFeatures(features_[i], search)); });
  }
}

std::string Difference(const Contents& expected, const Contents& found) {
  std::string text;
  for (const auto& [name, value] : expected) {
    const auto at = found.find(name);
    if (at == found.end()) {
      text += "\n  lost: " + name + ": " + value;
    } else if (at->second != value) {
      text += "\n  " + name + ": " + at->second + " instead of " + value;
    }
  }
  for (const auto& [name, value] : found) {
    if (!expected.contains(name)) text += "\n  not expected: " + name + ": " + value;
  }
  return text;
}

}  // namespace pliant::chaos
