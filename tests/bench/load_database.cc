// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Enlarges a collection with images made of its own, through the writer that imports use: each has
// a quarter of its keypoints from each of four images, with noise on their descriptors and at
// random places, and every four make an object. The noise of an image is one of three, whose words
// are found once: with 262 144 words that takes longer than all else.
//
//   load_database --db FILE --images 1000000 [--collection NAME]
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <future>
#include <memory>
#include <numeric>
#include <random>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>

#include "descriptor/base/parallel.h"
#include "descriptor/base/sha256.h"
#include "index/store/blob_codec.h"
#include "index/store/open_store.h"
#include "index/store/store.h"

namespace pliant {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::uint64_t kTogether = 1000;  // images in one commit
constexpr std::size_t kParts = 4;          // of an image
constexpr int kVersions = 3;               // of an image of the collection, with other noise
constexpr float kNoise = 0.4F;             // its length, of the descriptor's length

double SecondsSince(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

struct Made {
  AddRequest request;
  std::vector<std::uint8_t> encoded;
  Features features;
  std::vector<std::uint32_t> words;
};

class Maker {
 public:
  Maker(Catalogue& catalogue, const std::string& collection)
      : collection_(collection),
        vocabulary_(catalogue.RequireCollection(collection).vocabulary),
        quantizer_(catalogue.ReadVocabulary(vocabulary_)) {
    ImageListing list;
    list.which.collection = collection;
    catalogue.ForEachImageFeatures(
        list, [](const ImagePage&) {},
        [&](const ImageRecord& record, Bytes features) {
          if (record.id.starts_with("made-")) return;
          for (int i = 0; i < kVersions; ++i) sources_.push_back({DecodeFeatures(features), {}});
        });
    ParallelFor(sources_.size(), 0, [&](std::size_t i) {
      std::mt19937 random(static_cast<unsigned>(i));
      AddNoise(sources_[i].features.descriptors, random);
      sources_[i].words = quantizer_.Assign(sources_[i].features.descriptors);
    });
  }

  Made Make(std::uint64_t number) const {
    std::mt19937 random(static_cast<unsigned>(number));
    Made made;
    made.request.collection = collection_;
    made.request.id = "made-" + std::to_string(number);
    made.request.object = "made-" + std::to_string(number / 4);
    Features& features = made.features;
    for (std::size_t i = 0; i < kParts; ++i) {
      const Source& source = sources_[random() % sources_.size()];
      if (i == 0) {
        features = source.features;
        features.keypoints.clear();
        features.descriptors = Descriptors::Float(0, source.features.descriptors.dim);
      }
      AddSome(source, random, made);
    }
    made.encoded = EncodeFeatures(features);
    return made;
  }

  ImagePut PutOf(const Made& made) const {
    ImagePut put{.request = made.request};
    put.encoded = made.encoded;
    put.features = made.features;
    put.record.id = *made.request.id;
    put.record.collection = collection_;
    put.record.object = made.request.object;
    put.record.sha256 = Sha256Hex(put.record.id);
    put.record.media_type = "image/png";
    put.record.width = made.features.width;
    put.record.height = made.features.height;
    put.record.keypoints = static_cast<std::uint32_t>(made.features.descriptors.rows);
    put.vocabulary = vocabulary_;
    put.words = made.words;
    put.keep_content = false;
    return put;
  }

 private:
  struct Source {
    Features features;
    std::vector<std::uint32_t> words;  // of its descriptors
  };

  static void AddNoise(Descriptors& descriptors, std::mt19937& random) {
    const auto dim = static_cast<std::size_t>(descriptors.dim);
    std::normal_distribution<float> normal(0, kNoise / std::sqrt(static_cast<float>(dim)));
    for (std::size_t row = 0; row < descriptors.rows; ++row) {
      const std::span values = std::span(descriptors.floats).subspan(row * dim, dim);
      const float length =
          std::sqrt(std::inner_product(values.begin(), values.end(), values.begin(), 0.0F));
      for (float& value : values) value += length * normal(random);
    }
  }

  static void AddSome(const Source& from, std::mt19937& random, Made& made) {
    Features& to = made.features;
    std::vector<std::size_t> rows(from.words.size());
    std::iota(rows.begin(), rows.end(), 0U);
    std::shuffle(rows.begin(), rows.end(), random);
    rows.resize(rows.size() / kParts);
    std::uniform_real_distribution<float> place;
    for (const std::size_t row : rows) {
      Keypoint& keypoint = to.keypoints.emplace_back(from.features.keypoints[row]);
      keypoint.x = place(random) * static_cast<float>(to.width);
      keypoint.y = place(random) * static_cast<float>(to.height);
      const auto values = from.features.descriptors.float_row(row);
      to.descriptors.floats.insert(to.descriptors.floats.end(), values.begin(), values.end());
      ++to.descriptors.rows;
      made.words.push_back(from.words[row]);
    }
  }

  const std::string collection_;
  const Key vocabulary_;
  const Quantizer quantizer_;
  std::vector<Source> sources_;
};

void Run(const std::string& database, const std::string& collection, std::uint64_t images) {
  const auto store = OpenStore({.database = database, .create = false, .model_of_new = {}});
  store->BeginWriting([] {});
  const Maker maker(store->catalogue(), collection);
  const Key key = store->catalogue().RequireCollection(collection).key;
  const std::uint64_t there = store->catalogue().CountImages(key);
  const auto start = Clock::now();
  auto told = start;
  std::future<void> writing;
  for (std::uint64_t first = there; first < images; first += kTogether) {
    auto made = std::make_unique<std::vector<Made>>(std::min(kTogether, images - first));
    ParallelFor(made->size(), 0, [&](std::size_t i) { (*made)[i] = maker.Make(first + i); });
    if (writing.valid()) writing.get();
    writing = std::async(std::launch::async, [&store, &maker, batch = std::move(made)] {
      std::vector<ImagePut> puts;
      for (const Made& image : *batch) puts.push_back(maker.PutOf(image));
      store->writer().PutAll(puts);
    });
    if (SecondsSince(told) < 60) continue;
    told = Clock::now();
    std::printf("%llu images after %.0f s\n", static_cast<unsigned long long>(first),
                SecondsSince(start));
  }
  if (writing.valid()) writing.get();
  const double added = static_cast<double>(images - std::min(there, images));
  std::printf("wrote %.0f images in %.0f s: %.0f images/s\n", added, SecondsSince(start),
              added / SecondsSince(start));
}

}  // namespace
}  // namespace pliant

int main(int argc, char** argv) {
  CLI::App app("Enlarges a collection with images made of its own");
  std::string database;
  std::string collection = pliant::kDefaultCollection;
  std::uint64_t images = 100000;
  app.add_option("--db", database)->required();
  app.add_option("--collection", collection)->capture_default_str();
  app.add_option("--images", images, "that the collection then has")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  try {
    pliant::Run(database, collection, images);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
