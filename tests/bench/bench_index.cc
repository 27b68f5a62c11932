// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The inverted index at 10 000 and 100 000 synthetic images of 512 descriptors each: ranking by
// histogram (median_ms a query), memory (bytes_per_image), adding one image. Arguments: images,
// size of the vocabulary. Words and codes are drawn uniformly. For ranking by nearest neighbours
// see bench_neighbours.
#include <algorithm>
#include <chrono>
#include <map>
#include <memory>
#include <random>

#include <benchmark/benchmark.h>

#include "descriptor/base/hex.h"
#include "index/rank/inverted_index.h"
#include "index/rank/ranking.h"

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
  bow.biases.resize(kDescriptorsAnImage);
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
  const auto quantizer =
      std::make_shared<const Quantizer>(std::make_shared<const Vocabulary>(RandomVocabulary(1)));
  options.keep = 10;
  options.threads = static_cast<int>(state.range(2));
  std::mt19937_64 random(2);
  std::vector<double> times;
  for (auto _ : state) {
    const Bow query = RandomBow(random, vocabulary);
    const auto start = std::chrono::steady_clock::now();
    benchmark::DoNotOptimize(
        Rank(*snapshot, *quantizer, {.method = RankMethod::kHistogram, .bow = query}, options));
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

BENCHMARK(BM_RankHistogram)->Apply(Sizes);
BENCHMARK(BM_AddOne)
    ->ArgNames({"images", "words"})
    ->Args({100'000, 1000})
    ->Args({100'000, 65'536})
    ->UseManualTime()
    ->Iterations(500)
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace pliant

BENCHMARK_MAIN();
