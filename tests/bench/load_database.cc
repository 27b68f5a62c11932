// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Fills a database, a file or a URL, with many images, and measures it: images of folders that
// are described, and copies of their features, each with some of the keypoints and noise on their
// descriptors. Prints how fast they were written, how long loading and ranking take,
// and how long it takes to fetch candidates.
//
//   load_database --db FILE --folder IMAGES --images 1000000 [--keypoints 100]
//                 [--collection NAME] [--descriptor deal]
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <future>
#include <memory>
#include <random>
#include <thread>

#include <CLI/CLI.hpp>

#include "descriptor/base/error.h"
#include "descriptor/base/parallel.h"
#include "descriptor/base/sha256.h"
#include "index/engine/engine.h"
#include "index/store/blob_codec.h"
#include "index/store/open_store.h"
#include "index/store/store.h"

namespace pliant {
namespace {

using Clock = std::chrono::steady_clock;

constexpr Load kAll = Load::kRecordsAndFeatures;
constexpr std::uint64_t kMostReal = 5000;  // images that are described
constexpr std::uint64_t kTogether = 1000;  // copies in one commit

struct Options {
  std::string database;
  std::string collection = kDefaultCollection;
  std::string descriptor = "rootsift";
  std::filesystem::path folder;
  std::uint64_t images = 100000;
  std::size_t keypoints = 100;  // of a copy
  int words = 4000;
  unsigned seed = 1;
};

double SecondsSince(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

EngineOptions OptionsOf(const Options& options) {
  EngineOptions engine;
  engine.database = options.database;
  engine.descriptor = options.descriptor;
  engine.keep_originals = false;
  return engine;
}

// Some of the rows, with noise of a tenth of their length.
Features Perturbed(const Features& original, std::size_t keypoints, std::mt19937& random) {
  Features copy;
  copy.width = original.width;
  copy.height = original.height;
  copy.model_id = original.model_id;
  std::vector<std::size_t> rows(original.keypoints.size());
  for (std::size_t i = 0; i < rows.size(); ++i) rows[i] = i;
  std::shuffle(rows.begin(), rows.end(), random);
  rows.resize(std::min(rows.size(), keypoints));
  const int dim = original.descriptors.dim;
  copy.descriptors = Descriptors::Float(rows.size(), dim);
  std::normal_distribution<float> noise(0.0F, 0.1F / std::sqrt(static_cast<float>(dim)));
  for (std::size_t i = 0; i < rows.size(); ++i) {
    copy.keypoints.push_back(original.keypoints[rows[i]]);
    const auto row = original.descriptors.float_row(rows[i]);
    float sum = 0;
    for (const float v : row) sum += v * v;
    const float length = std::sqrt(sum);
    float* to = copy.descriptors.floats.data() + i * static_cast<std::size_t>(dim);
    for (std::size_t d = 0; d < row.size(); ++d) to[d] = row[d] + noise(random) * length;
  }
  return copy;
}

struct Prepared {
  AddRequest request;
  std::vector<std::uint8_t> encoded;
  Features features;
  Bow bow;
};

class Filler {
 public:
  explicit Filler(const Options& options) : options_(options) {}

  void Run() {
    Describe();
    Copy();
    Measure();
  }

 private:
  void Describe() {
    Engine engine(OptionsOf(options_));
    if (IsDescribed(engine)) return;
    const auto start = Clock::now();
    std::uint64_t added = 0;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(options_.folder)) {
      if (!entry.is_regular_file() || added == kMostReal) continue;
      std::ifstream file(entry.path(), std::ios::binary);
      const std::vector<std::uint8_t> bytes{std::istreambuf_iterator<char>(file), {}};
      AddRequest request;
      request.collection = options_.collection;
      request.bytes = bytes;
      request.id = "real-" + std::to_string(added);
      try {
        engine.Add(request);
        ++added;
      } catch (const Error&) {  // no image, or too plain
      }
    }
    if (!engine.GetCollection(options_.collection).vocabulary) {
      TrainOptions train;
      train.collection = options_.collection;
      train.words = options_.words;
      engine.TrainVocabulary(train);
    }
    std::printf("described %llu images in %.0f s\n", static_cast<unsigned long long>(added),
                SecondsSince(start));
  }

  bool IsDescribed(Engine& engine) const {
    try {
      engine.Get(options_.collection, "real-0");
      return true;
    } catch (const Error& error) {
      if (error.code() != ErrorCode::kNotFound) throw;
      return false;
    }
  }

  void Copy() {
    const auto store =
        OpenStore({.database = options_.database, .create = false, .model_of_new = {}});
    store->BeginWriting([] {});
    const CollectionState in = store->catalogue().RequireCollection(options_.collection);
    const Quantizer quantizer(store->catalogue().ReadVocabulary(in.vocabulary));
    std::vector<ImageRef> refs;
    for (std::uint64_t i = 0; i < kMostReal; ++i)
      refs.push_back({in.key, "real-" + std::to_string(i)});
    std::vector<Features> real;
    for (const auto& image : store->catalogue().LoadImages(refs, kAll)) {
      if (image) real.push_back(DecodeFeatures(image->features));
    }
    real_ = real.size();
    const std::uint64_t there = store->catalogue().CountImages(in.key);
    const auto start = Clock::now();
    auto told = start;
    std::future<void> writing;
    for (std::uint64_t first = there; first < options_.images; first += kTogether) {
      const std::uint64_t end = std::min(first + kTogether, options_.images);
      auto copies = std::make_unique<std::vector<Prepared>>(end - first);
      ParallelFor(copies->size(), 0, [&](std::size_t i) {
        Prepare(quantizer, real[(first + i) % real.size()], first + i, (*copies)[i]);
      });
      if (writing.valid()) writing.get();
      writing = std::async(std::launch::async,
                           [&store, vocabulary = in.vocabulary, images = std::move(copies)] {
                             Write(*store, vocabulary, *images);
                           });
      if (SecondsSince(told) < 60) continue;
      told = Clock::now();
      std::printf("%llu images after %.0f s\n", static_cast<unsigned long long>(first),
                  SecondsSince(start));
    }
    if (writing.valid()) writing.get();
    const double seconds = SecondsSince(start);
    const double added = static_cast<double>(options_.images - std::min(there, options_.images));
    std::printf("wrote %.0f copies of %zu images in %.0f s: %.0f images/s, %llu together\n", added,
                real.size(), seconds, added / seconds, static_cast<unsigned long long>(kTogether));
  }

  void Prepare(const Quantizer& quantizer, const Features& original, std::uint64_t number,
               Prepared& copy) const {
    std::mt19937 random(options_.seed + static_cast<unsigned>(number));
    copy.request.collection = options_.collection;
    copy.request.id = "copy-" + std::to_string(number);
    copy.encoded = EncodeFeatures(Perturbed(original, options_.keypoints, random));
    copy.features = DecodeFeatures(copy.encoded);
    const Descriptors& descriptors = copy.features.descriptors;
    copy.bow = quantizer.BowOf(descriptors, 0, quantizer.Assign(descriptors, 1));
  }

  static void Write(Store& store, Key vocabulary, const std::vector<Prepared>& copies) {
    std::vector<ImagePut> puts;
    for (const Prepared& copy : copies) {
      ImagePut& put = puts.emplace_back(ImagePut{.request = copy.request});
      const std::string& id = *copy.request.id;
      put.encoded = copy.encoded;
      put.features = copy.features;
      put.record.id = id;
      put.record.collection = copy.request.collection;
      put.record.sha256 = Sha256Hex(id);
      put.record.media_type = "image/png";
      put.record.width = copy.features.width;
      put.record.height = copy.features.height;
      put.record.keypoints = static_cast<std::uint32_t>(copy.features.descriptors.rows);
      put.vocabulary = vocabulary;
      put.bow = copy.bow;
      put.keep_content = false;
    }
    for (int attempt = 0;; ++attempt) {
      try {
        store.writer().PutAll(puts);
        return;
      } catch (const Error& error) {
        if (error.code() != ErrorCode::kUnavailable || attempt == 20) throw;
        std::this_thread::sleep_for(std::chrono::milliseconds(500));
      }
    }
  }

  void Measure() {
    auto start = Clock::now();
    EngineOptions read = OptionsOf(options_);
    read.read_only = true;
    Engine engine(read);
    const double loaded_s = SecondsSince(start);
    const std::uint64_t all = engine.GetCollection(options_.collection).images;
    std::printf("loaded %llu images in %.1f s\n", static_cast<unsigned long long>(all), loaded_s);
    const std::uint64_t copies = std::max<std::uint64_t>(all - std::min(all, real_), 1);
    const auto store = OpenStore(
        {.database = options_.database, .create = false, .read_only = true, .model_of_new = {}});
    const Key in = store->catalogue().RequireCollection(options_.collection).key;
    std::mt19937 random(options_.seed);
    for (const std::size_t count : {100U, 1000U}) {
      std::vector<double> ms;
      for (int i = 0; i < 10; ++i) {
        std::vector<ImageRef> refs;
        for (std::size_t j = 0; j < count; ++j) {
          refs.push_back({in, "copy-" + std::to_string(real_ + random() % copies)});
        }
        start = Clock::now();
        store->catalogue().LoadImages(refs, kAll);
        ms.push_back(1e3 * SecondsSince(start));
      }
      std::sort(ms.begin(), ms.end());
      std::printf("fetched %zu candidates in %.0f ms (median of 10)\n", count, ms[5]);
    }
    std::vector<double> ranked;
    for (int i = 0; i < 20; ++i) {
      SearchOptions search;
      search.collection = options_.collection;
      search.verify = Verification::kNone;
      const SearchResult found = engine.SearchStored("real-" + std::to_string(i), search);
      ranked.push_back(found.timings.rank_ms);
    }
    std::sort(ranked.begin(), ranked.end());
    std::printf("ranked in %.1f ms (median of 20)\n", ranked[10]);
  }

  const Options& options_;
  std::uint64_t real_ = 0;  // images that were described; the copies' numbers go on from there
};

}  // namespace
}  // namespace pliant

int main(int argc, char** argv) {
  CLI::App app("Fills a database with many images, and measures it");
  pliant::Options options;
  app.add_option("--db", options.database)->required();
  app.add_option("--folder", options.folder, "images to describe")->required();
  app.add_option("--collection", options.collection)->capture_default_str();
  app.add_option("--descriptor", options.descriptor)->capture_default_str();
  app.add_option("--images", options.images)->capture_default_str();
  app.add_option("--keypoints", options.keypoints, "of a copy, at most")->capture_default_str();
  app.add_option("--words", options.words)->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  try {
    pliant::Filler(options).Run();
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
