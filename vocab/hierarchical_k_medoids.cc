// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "vocab/hierarchical_k_medoids.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <mutex>
#include <numeric>
#include <random>
#include <span>
#include <string>
#include <unordered_set>
#include <utility>

#include "descriptor/base/error.h"
#include "descriptor/base/parallel.h"
#include "descriptor/match/distance.h"

namespace pliant {
namespace {

using Rows = std::vector<std::uint32_t>;

constexpr std::size_t kBranchSamples = 8192;
constexpr std::size_t kLeafSamples = 4096;
constexpr std::size_t kSamplesAMedoid = 4;
constexpr std::size_t kRowsATask = 1024;
// Distances that are computed to judge the result: seconds.
constexpr double kJudgedDistances = 2e9;
constexpr double kBranchShare = 0.2;  // of the progress
constexpr double kLeafShare = 0.6;

struct Branch {
  Rows members;
  double loss = 0;           // of the members, to the branch's medoid
  std::size_t distinct = 0;  // different members
  std::size_t medoids = 0;   // its share of the k
};

// Shares k out by loss (a branch that is badly described by one medoid needs more of them), by the
// method of largest remainders: at least one and at most `distinct` each.
void ShareOut(std::vector<Branch>& branches, std::size_t k) {
  double loss = 0;
  for (Branch& branch : branches) {
    branch.medoids = std::min<std::size_t>(1, branch.distinct);
    loss += branch.loss;
  }
  std::vector<std::pair<double, std::size_t>> remainders;
  std::size_t given = 0;
  for (std::size_t b = 0; b < branches.size(); ++b) {
    Branch& branch = branches[b];
    const double wanted = loss > 0 ? static_cast<double>(k) * branch.loss / loss : 0;
    const auto whole = static_cast<std::size_t>(wanted);
    branch.medoids = std::clamp(whole, branch.medoids, branch.distinct);
    given += branch.medoids;
    remainders.emplace_back(wanted - static_cast<double>(whole), b);
  }
  std::sort(remainders.begin(), remainders.end(), std::greater<>());
  while (given < k) {  // there are k different samples, so that some branch has room
    for (const auto& [remainder, b] : remainders) {
      if (given == k) break;
      if (branches[b].medoids == branches[b].distinct) continue;
      ++branches[b].medoids;
      ++given;
    }
  }
  while (given > k) {  // too many branches got their least one
    auto largest =
        std::max_element(branches.begin(), branches.end(),
                         [](const Branch& a, const Branch& b) { return a.medoids < b.medoids; });
    --largest->medoids;
    --given;
  }
}

class Hierarchy {
 public:
  Hierarchy(const Descriptors& samples, const KMedoidsOptions& options)
      : samples_(samples), options_(options), threads_(ResolveThreads(options.threads)) {}

  HierarchicalKMedoidsResult Go() {
    const auto k = static_cast<std::size_t>(options_.k);
    std::vector<Branch> branches = MakeBranches();
    ShareOut(branches, k);
    std::vector<Rows> leaves(branches.size());
    std::atomic<std::size_t> done{0};
    ParallelFor(branches.size(), threads_, [&](std::size_t b) {
      leaves[b] = Cluster(branches[b], b);
      Report(kBranchShare +
                 kLeafShare * static_cast<double>(++done) / static_cast<double>(branches.size()),
             0);
    });
    HierarchicalKMedoidsResult result;
    for (const Rows& leaf : leaves) {
      result.medoids.insert(result.medoids.end(), leaf.begin(), leaf.end());
    }
    std::sort(result.medoids.begin(), result.medoids.end());
    Judge(&result);
    Report(1, result.mean_loss);
    return result;
  }

 private:
  void ThrowIfStopped() const {
    if (options_.stop.stop_requested()) {
      throw Error(ErrorCode::kCancelled, "cancelled", "k-medoids was stopped on request.");
    }
  }

  void Report(double done, double loss) {
    ThrowIfStopped();
    if (!options_.progress) return;
    const std::lock_guard lock(progress_mutex_);
    done_ = std::max(done_, done);
    options_.progress(done_, loss);
  }

  KMedoidsOptions Part(int k, std::uint64_t seed, int threads) const {
    KMedoidsOptions part = options_;
    part.k = k;
    part.seed = seed;
    part.threads = threads;
    part.progress = nullptr;
    return part;
  }

  std::vector<Branch> MakeBranches() {
    const Rows drawn = DrawRows(AllRows(samples_.rows), kBranchSamples, options_.seed);
    // The work is about n (b + k / b) distances for b branches: least at b = sqrt(k).
    const auto wanted = static_cast<int>(std::ceil(std::sqrt(options_.k)));
    const Descriptors subset = SelectRows(samples_, drawn);
    KMedoidsOptions part =
        Part(std::min(wanted, static_cast<int>(drawn.size())), options_.seed, options_.threads);
    part.progress = [this](double done, double) { Report(kBranchShare / 2 * done, 0); };
    const KMedoidsResult top = KMedoids(subset, part);
    Rows centres;
    for (const std::uint32_t m : top.medoids) centres.push_back(drawn[m]);
    const std::vector<NearestTwo> nearest = NearestOf(AllRows(samples_.rows), centres);
    std::vector<Branch> branches(centres.size());
    for (std::uint32_t i = 0; i < samples_.rows; ++i) {
      branches[nearest[i].index].members.push_back(i);
      branches[nearest[i].index].loss += nearest[i].distance;
    }
    for (Branch& branch : branches) branch.distinct = DistinctRows(samples_, branch.members).size();
    return branches;
  }

  // The nearest of `centres` for each of `rows`.
  std::vector<NearestTwo> NearestOf(const Rows& rows, const Rows& centres) {
    const PackedDescriptors packed(SelectRows(samples_, centres));
    std::vector<NearestTwo> nearest(rows.size());
    ParallelFor((rows.size() + kRowsATask - 1) / kRowsATask, threads_, [&](std::size_t t) {
      ThrowIfStopped();
      const std::size_t first = t * kRowsATask;
      const std::size_t count = std::min(kRowsATask, rows.size() - first);
      const Descriptors block = SelectRows(samples_, std::span(rows).subspan(first, count));
      packed.FindNearest(block, 0, count, nearest.data() + first);
    });
    return nearest;
  }

  Rows Cluster(const Branch& branch, std::size_t number) const {
    if (branch.medoids == 0) return {};
    Rows distinct = DistinctRows(samples_, branch.members);
    if (distinct.size() == branch.medoids) return distinct;
    const std::uint64_t seed = options_.seed + 1 + number;
    const std::size_t enough = std::max(kLeafSamples, kSamplesAMedoid * branch.medoids);
    Rows drawn = DrawRows(branch.members, std::min(enough, kMaxKMedoidsSamples), seed);
    // The draw must leave as many different samples as there will be medoids.
    if (DistinctRows(samples_, drawn).size() < branch.medoids) {
      drawn = DrawRows(distinct, std::min(enough, kMaxKMedoidsSamples), seed);
    }
    const KMedoidsResult leaf =
        KMedoids(SelectRows(samples_, drawn), Part(static_cast<int>(branch.medoids), seed, 1));
    Rows medoids;
    for (const std::uint32_t m : leaf.medoids) medoids.push_back(drawn[m]);
    return medoids;
  }

  void Judge(HierarchicalKMedoidsResult* result) {
    const auto affordable =
        static_cast<std::size_t>(kJudgedDistances / static_cast<double>(result->medoids.size()));
    result->judged =
        DrawRows(AllRows(samples_.rows), std::max<std::size_t>(affordable, 1000), options_.seed);
    double loss = 0;
    for (const NearestTwo& nearest : NearestOf(result->judged, result->medoids)) {
      result->assignment.push_back(nearest.index);
      loss += nearest.distance;
    }
    result->mean_loss = loss / static_cast<double>(result->judged.size());
  }

  const Descriptors& samples_;
  const KMedoidsOptions& options_;
  int threads_;
  std::mutex progress_mutex_;  // guards done_ and calls of options_.progress
  double done_ = 0;
};

}  // namespace

Rows DrawRows(const Rows& rows, std::size_t count, std::uint64_t seed) {
  if (rows.size() <= count) return rows;
  std::mt19937_64 random(seed);
  Rows drawn = rows;
  for (std::size_t i = 0; i < count; ++i) {
    std::swap(drawn[i], drawn[i + random() % (drawn.size() - i)]);
  }
  drawn.resize(count);
  std::sort(drawn.begin(), drawn.end());
  return drawn;
}

Rows AllRows(std::size_t n) {
  Rows rows(n);
  std::iota(rows.begin(), rows.end(), 0U);
  return rows;
}

std::string_view RowBytes(const Descriptors& d, std::size_t row) {
  if (d.kind == DescriptorKind::kFloat) {
    return {reinterpret_cast<const char*>(d.float_row(row).data()), d.dim * sizeof(float)};
  }
  return {reinterpret_cast<const char*>(d.binary_row(row).data()), static_cast<std::size_t>(d.dim)};
}

std::vector<std::uint32_t> DistinctRows(const Descriptors& descriptors,
                                        std::span<const std::uint32_t> rows) {
  std::unordered_set<std::string_view> seen;
  seen.reserve(rows.size());
  std::vector<std::uint32_t> kept;
  for (const std::uint32_t row : rows) {
    if (seen.insert(RowBytes(descriptors, row)).second) kept.push_back(row);
  }
  return kept;
}

HierarchicalKMedoidsResult HierarchicalKMedoids(const Descriptors& samples,
                                                const KMedoidsOptions& options) {
  CheckDescriptors(samples, "k-medoids samples");
  const std::size_t different = DistinctRows(samples, AllRows(samples.rows)).size();
  if (options.k < 1 || static_cast<std::size_t>(options.k) > different) {
    throw Error(ErrorCode::kInvalidArgument, "bad_k",
                "k = " + std::to_string(options.k) + " is outside 1.." + std::to_string(different) +
                    ", the number of different samples.");
  }
  return Hierarchy(samples, options).Go();
}

}  // namespace pliant
