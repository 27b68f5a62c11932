// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The rankings at any number of images: accuracy, memory, and milliseconds of a query by stage,
// for several sizes of the vocabulary.
//
//   bench_neighbours --images 10000,100000 --words 4000,16000,65536
//   bench_neighbours --set CACHE/packages/deal-X.db --distractors CACHE/worn-shirts/deal-X.db
//
// Images are synthetic, or real ones from databases that `pliant eval retrieval --cache` left.
// Where there are fewer than asked for, distractors are repeated with noise in their codes. Times
// are processor time, or, with more than one thread, time.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <ctime>
#include <memory>
#include <numeric>
#include <optional>

#include <CLI/CLI.hpp>

#include "descriptor/match/distance.h"
#include "index/rank/neighbour_votes.h"
#include "index/rank/ranking.h"
#include "tests/bench/ranking_sets.h"

namespace pliant::bench {
namespace {

struct Options {
  std::filesystem::path set;
  std::vector<std::filesystem::path> distractors;
  std::vector<std::size_t> images = {10'000, 100'000};
  std::vector<int> words = {4000, 16'000, 65'536};
  std::vector<float> reach = {NeighbourOptions().reach};
  std::vector<int> cells = {NeighbourOptions().cells};
  std::size_t descriptors = 700;
  std::size_t queries = 50;
  std::size_t samples_a_word = 5;
  std::vector<int> threads = {1};
};

class Stopwatch {
 public:
  explicit Stopwatch(int threads) : threads_(threads), start_(Now()) {}
  // Milliseconds since the last call.
  double Lap() {
    const double before = std::exchange(start_, Now());
    return start_ - before;
  }

 private:
  double Now() const {
    if (threads_ == 1) return 1e3 * static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
    return std::chrono::duration<double, std::milli>(
               std::chrono::steady_clock::now().time_since_epoch())
        .count();
  }
  int threads_;
  double start_;
};

struct Figures {
  double assign = 0, tables = 0, scan = 0, sum = 0;  // ms of all queries
  double codes = 0, votes = 0;
  std::size_t right = 0;
};

struct Collection {
  RankingSet set;
  std::vector<LabelledImage> distractors;
};

Collection Load(const Options& options) {
  Collection all;
  std::mt19937_64 random(3);
  if (options.set.empty()) {
    constexpr std::size_t kSynthetic = 3000;
    all.set = MakeSet(kSynthetic, options.queries, options.descriptors);
    const std::size_t kept = kSynthetic / 2;
    for (std::size_t p = kept; p < kSynthetic; ++p) {
      all.distractors.push_back(std::move(all.set.gallery[p]));
    }
    all.set.gallery.resize(kept);
    return all;
  }
  all.set = ReadSet(options.set);
  std::shuffle(all.set.queries.begin(), all.set.queries.end(), random);
  all.set.queries.resize(std::min(all.set.queries.size(), options.queries));
  for (const auto& database : options.distractors) {
    RankingSet other = ReadSet(database);
    for (auto* images : {&other.gallery, &other.queries}) {
      for (LabelledImage& image : *images) {
        all.distractors.push_back({"", DrawRows(image.descriptors, options.descriptors, random)});
      }
    }
  }
  for (LabelledImage& query : all.set.queries) {
    query.descriptors = DrawRows(query.descriptors, options.descriptors, random);
  }
  std::shuffle(all.distractors.begin(), all.distractors.end(), random);
  return all;
}

std::shared_ptr<const Vocabulary> Train(const Collection& all, int words,
                                        std::size_t samples_a_word) {
  Descriptors pool = Descriptors::Float(0, all.set.gallery.front().descriptors.dim);
  for (const auto* images : {&all.set.gallery, &all.distractors}) {
    for (const LabelledImage& image : *images) {
      pool.floats.insert(pool.floats.end(), image.descriptors.floats.begin(),
                         image.descriptors.floats.end());
      pool.rows += image.descriptors.rows;
    }
  }
  const std::size_t available = pool.rows;
  std::mt19937_64 random(4);
  const std::size_t wanted =
      std::max<std::size_t>(40'000, samples_a_word * static_cast<std::size_t>(words));
  KMedoidsOptions options;
  options.k = words;
  options.threads = 1;
  const Descriptors samples = DrawRows(pool, wanted, random);
  return std::make_shared<const Vocabulary>(TrainVocabulary(samples, "bench", available, options));
}

bool IsRight(const Collection& all, const LabelledImage& query, std::int64_t key) {
  return key > 0 && static_cast<std::size_t>(key) <= all.set.gallery.size() &&
         all.set.gallery[static_cast<std::size_t>(key) - 1].object == query.object;
}

Figures AskNeighbours(const Collection& all, const IndexSnapshot& snapshot,
                      const Quantizer& quantizer, const NeighbourOptions& options) {
  Figures figures;
  for (const LabelledImage& image : all.set.queries) {
    Stopwatch watch(options.threads);
    const auto cells = quantizer.NearestWords(image.descriptors, options.cells, options.threads);
    const double assign = watch.Lap();
    const NeighbourQuery query(*quantizer.coder(), {image.descriptors}, cells, options);
    figures.assign += assign;
    figures.tables += watch.Lap();
    std::vector<std::vector<Vote>> votes = CollectVotes(query, snapshot, options.threads);
    figures.scan += watch.Lap();
    std::vector<std::uint32_t> voted(image.descriptors.rows);
    for (const auto& list : votes) {
      for (const Vote& vote : list) ++voted[vote.row];
    }
    for (auto& list : votes) query.Weigh(voted, &list);
    double best = 0;
    std::int64_t first = 0;
    for (std::size_t i = 0; i < votes.size(); ++i) {
      figures.votes += static_cast<double>(votes[i].size());
      const IndexSegment& segment = *snapshot.parts[i].segment;
      std::vector<float> sums(segment.size(), 0.0F);
      SumVotes(&votes[i], &sums);
      for (std::uint32_t p = 0; p < sums.size(); ++p) {
        const double score = query.Score(sums[p], segment[p].keypoints);
        if (score > best) {
          best = score;
          first = segment[p].key;
        }
      }
    }
    figures.sum += watch.Lap();
    for (const NearWord& cell : cells) {
      for (const auto& part : snapshot.parts) {
        figures.codes += static_cast<double>(part.segment->codes().List(cell.word).size);
      }
    }
    figures.right += IsRight(all, image, first) ? 1U : 0U;
  }
  return figures;
}

Figures AskHistograms(const Collection& all, const IndexSnapshot& snapshot,
                      const Quantizer& quantizer, int threads) {
  Figures figures;
  RankOptions options;
  options.keep = 10;
  options.threads = threads;
  for (const LabelledImage& image : all.set.queries) {
    Stopwatch watch(threads);
    const auto words = quantizer.Assign(image.descriptors, threads);
    figures.assign += watch.Lap();
    const Ranking ranking = Rank(
        snapshot, quantizer, {.method = RankMethod::kHistogram, .bow = MakeBow(words)}, options);
    figures.scan += watch.Lap();
    figures.right +=
        !ranking.best.empty() && IsRight(all, image, ranking.best.front().ref.version) ? 1U : 0U;
  }
  return figures;
}

void Print(const std::string& name, std::size_t words, const IndexSnapshot& snapshot, int threads,
           const Figures& figures, std::size_t queries) {
  const auto n = static_cast<double>(queries);
  const double bytes =
      static_cast<double>(snapshot.memory_bytes()) / static_cast<double>(snapshot.images);
  std::printf(
      "| %s | %zu | %zu | %d | %.3f | %.1f | %.1f | %.1f | %.1f | %.1f | %.1f | %.1f | %.1f |\n",
      name.c_str(), words, snapshot.images, threads, static_cast<double>(figures.right) / n,
      figures.assign / n, figures.tables / n, figures.scan / n, figures.sum / n,
      (figures.assign + figures.tables + figures.scan + figures.sum) / n, figures.codes / n / 1e6,
      figures.votes / n / 1e3, bytes / 1e3);
  std::fflush(stdout);
}

// Which share of the nearest words of the queries' descriptors the quantizer finds.
void PrintRecall(const Collection& all, const Quantizer& quantizer) {
  constexpr int kWanted = 16;
  const std::size_t words = quantizer.vocabulary().size();
  const PackedDescriptors packed(quantizer.vocabulary().words);
  std::vector<float> distances(words);
  double nearest = 0;
  double several = 0;
  double rows = 0;
  for (std::size_t q = 0; q < std::min<std::size_t>(all.set.queries.size(), 10); ++q) {
    const Descriptors& descriptors = all.set.queries[q].descriptors;
    const auto found = quantizer.NearestWords(descriptors, kWanted);
    for (std::size_t i = 0; i < descriptors.rows; ++i, ++rows) {
      packed.Distances(descriptors, i, 1, distances.data());
      std::nth_element(distances.begin(), distances.begin() + kWanted - 1, distances.end());
      const float farthest = distances[kWanted - 1] * 1.000001F;
      const float first = *std::min_element(distances.begin(), distances.begin() + kWanted);
      nearest += found[i * kWanted].distance <= first * 1.000001F ? 1 : 0;
      for (int k = 0; k < kWanted; ++k) {
        several += found[i * kWanted + k].distance <= farthest ? 1.0 / kWanted : 0;
      }
    }
  }
  std::fprintf(stderr, "%zu words: recall of the nearest %.4f, of %d %.4f\n", words, nearest / rows,
               kWanted, several / rows);
}

void MeasureRankings(const Collection& all, const Options& options, int threads,
                     const IndexSnapshot& snapshot, const Quantizer& quantizer) {
  const auto print = [&](const std::string& name, const Figures& figures) {
    Print(name, quantizer.vocabulary().size(), snapshot, threads, figures, all.set.queries.size());
  };
  for (const int cells : options.cells) {
    for (const float reach : options.reach) {
      char name[64];
      std::snprintf(name, sizeof(name), "neighbours, %d cells, reach %.2f", cells, reach);
      print(name, AskNeighbours(all, snapshot, quantizer, {cells, reach, threads}));
    }
  }
  print("histogram", AskHistograms(all, snapshot, quantizer, threads));
}

void Measure(const Collection& all, const Options& options, int words) {
  Stopwatch watch(1);
  const auto vocabulary = Train(all, words, options.samples_a_word);
  const double trained = watch.Lap();
  const auto quantizer = std::make_shared<const Quantizer>(vocabulary);
  const double made = watch.Lap();
  PrintRecall(all, *quantizer);
  watch.Lap();
  GrowingIndex index(all.set.gallery, all.distractors, quantizer);
  std::fprintf(stderr, "%d words: training %.1f s, quantizer %.2f s, quantising %.1f s\n", words,
               trained / 1e3, made / 1e3, watch.Lap() / 1e3);
  for (const std::size_t images : options.images) {
    const auto snapshot = index.Grow(images);
    for (const int threads : options.threads) {
      MeasureRankings(all, options, threads, *snapshot, *quantizer);
    }
  }
}

}  // namespace
}  // namespace pliant::bench

int main(int argc, char** argv) {
  pliant::bench::Options options;
  CLI::App app("Measures the rankings at any number of images.");
  app.add_option("--set", options.set, "database with queries and a gallery; default: synthetic");
  app.add_option("--distractors", options.distractors, "databases")->delimiter(',');
  app.add_option("--images", options.images, "sizes of the collection")->delimiter(',');
  app.add_option("--words", options.words, "sizes of the vocabulary")->delimiter(',');
  app.add_option("--reach", options.reach, "of neighbours")->delimiter(',');
  app.add_option("--cells", options.cells, "of neighbours")->delimiter(',');
  app.add_option("--descriptors", options.descriptors, "of a distractor and a query, at most");
  app.add_option("--queries", options.queries, "at most");
  app.add_option("--samples-a-word", options.samples_a_word, "of the training");
  app.add_option("--threads", options.threads, "of a query")->delimiter(',');
  CLI11_PARSE(app, argc, argv);
  const pliant::bench::Collection all = pliant::bench::Load(options);
  std::printf(
      "| rank | words | images | threads | top-1 | assign ms | tables ms | scan ms | sum ms | "
      "all ms "
      "| million codes | thousand votes | kB an image in memory |\n"
      "|---|---|---|---|---|---|---|---|---|---|---|---|---|\n");
  for (const int words : options.words) pliant::bench::Measure(all, options, words);
  return 0;
}
