// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The inverted index at 10 000 and 100 000 synthetic images of 512 descriptors each: ranking by
// histogram (median_ms a query), memory (bytes_per_image), adding one image, loading from the
// database and from files. Arguments: images, size of the vocabulary. Words and codes are drawn
// uniformly. For ranking by nearest neighbours see bench_neighbours.
#include <algorithm>
#include <chrono>
#include <filesystem>
#include <map>
#include <memory>
#include <random>

#include <benchmark/benchmark.h>
#include <unistd.h>

#include "descriptor/base/hex.h"
#include "index/rank/memory_ranker.h"
#include "index/rank/ranking.h"
#include "index/store/open_store.h"
#include "index/store/sql/rows.h"
#include "index/store/sqlite/database.h"

namespace pliant {
namespace {

constexpr std::uint32_t kDescriptorsAnImage = 512;
constexpr std::int64_t kImagesAnObject = 10;
constexpr int kDim = 64;
constexpr int kCodeBytes = 16;

Vocabulary RandomVocabulary(std::size_t size) {
  std::mt19937_64 random(4);
  Vocabulary vocabulary;
  vocabulary.model_id = "bench:1";
  vocabulary.words = Descriptors::Float(size, kDim);
  for (float& x : vocabulary.words.floats) x = static_cast<float>(random() % 1000) / 1000;
  Codebook& book = vocabulary.codebook;
  book.code_bytes = kCodeBytes;
  book.part_dim = kDim / (2 * kCodeBytes);
  book.rotation.assign(std::size_t{kDim} * kDim, 0);
  for (std::size_t d = 0; d < kDim; ++d) book.rotation[d * kDim + d] = 1;
  for (std::size_t i = 0; i < kDim * 16; ++i) {
    book.centroids.push_back(static_cast<float>(i % 16) / 16);
  }
  return vocabulary;
}

Bow RandomBow(std::mt19937_64& random, std::size_t vocabulary) {
  std::vector<std::uint32_t> words(kDescriptorsAnImage);
  for (std::uint32_t& word : words) word = static_cast<std::uint32_t>(random() % vocabulary);
  Bow bow = MakeBow(std::move(words));
  bow.codes.resize(std::size_t{kDescriptorsAnImage} * kCodeBytes);
  for (std::uint8_t& byte : bow.codes) byte = static_cast<std::uint8_t>(random());
  return bow;
}

IndexedImage RandomImage(std::mt19937_64& random, std::int64_t key, std::size_t vocabulary) {
  std::uint8_t id[16];
  for (std::uint8_t& byte : id) byte = static_cast<std::uint8_t>(random());
  return {key, 1 + key / kImagesAnObject, ToHex(id), RandomBow(random, vocabulary)};
}

// Made once for all benchmarks of the same size.
InvertedIndex& IndexOf(std::int64_t images, std::size_t vocabulary) {
  static std::pair<std::int64_t, std::size_t> made;
  static std::unique_ptr<InvertedIndex> index;  // one at a time is in memory
  if (index && made == std::pair(images, vocabulary)) return *index;
  index = std::make_unique<InvertedIndex>(std::make_shared<const Quantizer>(
      std::make_shared<const Vocabulary>(RandomVocabulary(vocabulary))));
  made = {images, vocabulary};
  std::mt19937_64 random(1);
  std::vector<IndexedImage> chunk;
  for (std::int64_t key = 1; key <= images; ++key) {
    chunk.push_back(RandomImage(random, key, vocabulary));
    if (chunk.size() == 10'000 || key == images) index->Append(std::exchange(chunk, {}));
  }
  return *index;
}

double Median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

void BM_RankHistogram(benchmark::State& state) {
  const auto vocabulary = static_cast<std::size_t>(state.range(1));
  const auto snapshot = IndexOf(state.range(0), vocabulary).snapshot();
  RankOptions options;
  options.method = RankMethod::kHistogram;
  options.keep = 10;
  options.threads = static_cast<int>(state.range(2));
  std::mt19937_64 random(2);
  std::vector<double> times;
  for (auto _ : state) {
    const Bow query = RandomBow(random, vocabulary);
    const auto start = std::chrono::steady_clock::now();
    benchmark::DoNotOptimize(RankByHistogram(*snapshot, query, options));
    const double ms =
        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
    times.push_back(ms);
    state.SetIterationTime(ms / 1000);
  }
  state.counters["median_ms"] = Median(times);
  state.counters["best_ms"] = *std::min_element(times.begin(), times.end());
  state.counters["bytes_per_image"] =
      static_cast<double>(snapshot->memory_bytes()) / static_cast<double>(state.range(0));
}

void Sizes(benchmark::internal::Benchmark* bench) {
  for (const std::int64_t vocabulary : {10, 4000, 65'536}) {
    for (const std::int64_t images : {10'000, 100'000}) {
      for (const std::int64_t threads : {1, 2}) bench->Args({images, vocabulary, threads});
    }
  }
  bench->ArgNames({"images", "words", "threads"})->UseManualTime()->Iterations(30);
  bench->Unit(benchmark::kMillisecond);
}

void BM_AddOne(benchmark::State& state) {
  const auto vocabulary = static_cast<std::size_t>(state.range(1));
  InvertedIndex& index = IndexOf(state.range(0), vocabulary);
  std::mt19937_64 random(3);
  std::int64_t key = 1'000'000;
  std::vector<double> times;
  for (auto _ : state) {
    std::vector<IndexedImage> one;
    one.push_back(RandomImage(random, ++key, vocabulary));
    const auto start = std::chrono::steady_clock::now();
    index.Apply(std::move(one), {});
    times.push_back(
        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start)
            .count());
    state.SetIterationTime(times.back() / 1000);
  }
  state.counters["median_ms"] = Median(times);
  state.counters["worst_ms"] = *std::max_element(times.begin(), times.end());
}

std::filesystem::path MakeDatabase(std::int64_t images, std::size_t vocabulary_size) {
  const auto path = std::filesystem::temp_directory_path() /
                    ("pliant-bench-" + std::to_string(::getpid()) + ".db");
  for (const char* suffix : {"", "-wal", "-shm"}) std::filesystem::remove(path.string() + suffix);
  CreateDatabase(path, {"bench", DescriptorKind::kFloat, kDim, "bench:1"});
  SqliteConnection db(path, SqliteConnection::Mode::kReadWrite, 1000);
  SQLite::Transaction transaction(db.database());
  const CollectionRow collection = RequireCollection(db, kDefaultCollection);
  const Key words =
      InsertVocabulary(db, collection.key, collection.model, RandomVocabulary(vocabulary_size));
  MarkVocabularyReady(db, words);
  SetActiveVocabulary(db, collection.key, words, false);
  std::mt19937_64 random(1);
  ImageRow row;
  row.record.sha256 = std::string(64, 'a');
  for (std::int64_t i = 1; i <= images; ++i) {
    const IndexedImage image = RandomImage(random, i, vocabulary_size);
    row.record.id = image.id;
    InsertImageWords(db, words, InsertImage(db, collection.key, row), image.bow);
  }
  transaction.commit();
  return path;
}

// Files are in the system's cache, as the database is.
void BM_Load(benchmark::State& state) {
  const auto path = MakeDatabase(state.range(0), static_cast<std::size_t>(state.range(1)));
  const std::filesystem::path folder = path.string() + ".index";
  MemoryRankerOptions options;
  if (state.range(2) != 0) options.files = std::make_shared<IndexFiles>(folder, 0);
  const auto load = [&](bool save) {
    const std::unique_ptr<Store> store =
        OpenStore({.database = path, .create = false, .model_of_new = {}});
    store->BeginWriting([] {});
    MemoryRanker ranker(store->OpenFeed(), options);
    ranker.Load();
    benchmark::DoNotOptimize(ranker.memory_bytes());
    if (!save) return;
    ranker.BeginSaving();
    ranker.Save();
  };
  if (options.files) load(true);
  for (auto _ : state) load(false);
  std::filesystem::remove_all(folder);
  state.counters["database_bytes_per_image"] =
      static_cast<double>(std::filesystem::file_size(path)) / static_cast<double>(state.range(0));
  for (const char* suffix : {"", "-wal", "-shm"}) std::filesystem::remove(path.string() + suffix);
}

BENCHMARK(BM_RankHistogram)->Apply(Sizes);
BENCHMARK(BM_AddOne)
    ->ArgNames({"images", "words"})
    ->Args({100'000, 1000})
    ->Args({100'000, 65'536})
    ->UseManualTime()
    ->Iterations(500)
    ->Unit(benchmark::kMillisecond);
BENCHMARK(BM_Load)
    ->ArgNames({"images", "words", "files"})
    ->Args({20'000, 65'536, 0})
    ->Args({100'000, 65'536, 0})
    ->Args({100'000, 65'536, 1})
    ->Iterations(1)
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace pliant

BENCHMARK_MAIN();
