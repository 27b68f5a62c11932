// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "vocab/k_medoids.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <numeric>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "descriptor/base/error.h"
#include "descriptor/base/parallel.h"
#include "descriptor/match/distance.h"

namespace pliant {
namespace {

// The N x N distance matrix of a sample.
class DistanceMatrix {
 public:
  // `checkpoint` is called periodically with the fraction of the matrix that is done, from this
  // thread, and may throw to cancel.
  DistanceMatrix(const Descriptors& samples, int threads,
                 const std::function<void(double done)>& checkpoint)
      : size_(samples.rows), distances_(size_ * size_) {
    const PackedDescriptors packed(samples);
    constexpr std::size_t kRowsACheckpoint = 1024;
    constexpr std::size_t kRowsATask = 64;  // that share what they read of the samples
    for (std::size_t first = 0; first < size_; first += kRowsACheckpoint) {
      const std::size_t end = std::min(size_, first + kRowsACheckpoint);
      ParallelFor((end - first + kRowsATask - 1) / kRowsATask, threads, [&](std::size_t t) {
        const std::size_t begin = first + t * kRowsATask;
        packed.Distances(samples, begin, std::min(kRowsATask, end - begin),
                         distances_.data() + begin * size_);
      });
      checkpoint(static_cast<double>(end) / static_cast<double>(size_));
    }
  }

  std::size_t size() const { return size_; }
  const float* Row(std::size_t row) const { return distances_.data() + row * size_; }

 private:
  std::size_t size_;
  std::vector<float> distances_;  // size_ x size_
};

// The effect on the loss of exchanging a medoid for a candidate.
struct Swap {
  std::uint32_t position = 0;  // of the medoid to be removed
  double change = 0;           // of the loss; below 0 is better
};

// The state and the two steps of FasterPAM (Schubert and Rousseeuw 2021, Algorithm 3).
class FasterPam {
 public:
  // `medoids`: k >= 2 distinct rows.
  FasterPam(const DistanceMatrix& rows, std::vector<std::uint32_t> medoids)
      : rows_(rows),
        medoids_(std::move(medoids)),
        is_medoid_(rows.size(), 0),
        nearest_(rows.size()),
        second_(rows.size()),
        nearest_distance_(rows.size()),
        second_distance_(rows.size()),
        removal_loss_(medoids_.size()) {
    for (const std::uint32_t m : medoids_) is_medoid_[m] = 1;
    std::vector<std::uint32_t> all(rows.size());
    std::iota(all.begin(), all.end(), 0U);
    Search(all);
    UpdateSums();
  }

  const std::vector<std::uint32_t>& medoids() const { return medoids_; }
  bool is_medoid(std::size_t row) const { return is_medoid_[row] != 0; }
  double loss() const { return loss_; }

  // The best medoid to exchange for the candidate whose distances to all samples are `distances`:
  // O(N + k), since the cost of removing each medoid is maintained. `scratch` belongs to the
  // caller. Thread-safe.
  Swap Evaluate(const float* distances, std::vector<double>* scratch) const {
    // change[i]: of removing medoid i and adding the candidate, less what the candidate saves
    // whichever medoid goes (`saved`). With d the distance to the candidate, a sample's share is
    //   saved += min(d - nearest, 0),  change[its medoid] += min(max(d, nearest), second) - second,
    // written without branches, which would be mispredicted; but few samples have the candidate
    // nearer than their second medoid when k is large, so chunks without one are left out.
    std::vector<double>& change = *scratch;
    change.assign(removal_loss_.begin(), removal_loss_.end());
    constexpr std::size_t kChunk = 16;
    double saved[kChunk] = {};
    double less[kChunk];
    const std::size_t n = rows_.size();
    for (std::size_t first = 0; first < n; first += kChunk) {
      const std::size_t count = std::min(kChunk, n - first);
      const float* d = distances + first;
      const float* near = nearest_distance_.data() + first;
      const float* second = second_distance_.data() + first;
      const std::uint32_t* medoid = nearest_.data() + first;
      int any = 0;
      for (std::size_t j = 0; j < count; ++j) any |= static_cast<int>(d[j] < second[j]);
      if (any == 0) continue;
      for (std::size_t j = 0; j < count; ++j) {
        saved[j] += static_cast<double>(std::min(d[j], near[j])) - static_cast<double>(near[j]);
        less[j] = static_cast<double>(std::min(std::max(d[j], near[j]), second[j])) -
                  static_cast<double>(second[j]);
      }
      for (std::size_t j = 0; j < count; ++j) change[medoid[j]] += less[j];
    }
    const auto best = std::min_element(change.begin(), change.end());
    return {static_cast<std::uint32_t>(best - change.begin()),
            *best + std::accumulate(saved, saved + kChunk, 0.0)};
  }

  // Exchanges the medoid at `position` for `candidate`.
  void Apply(std::uint32_t position, std::uint32_t candidate, const float* distances) {
    is_medoid_[medoids_[position]] = 0;
    is_medoid_[candidate] = 1;
    medoids_[position] = candidate;
    orphans_.clear();
    for (std::size_t o = 0; o < rows_.size(); ++o) {
      const float d = distances[o];
      if (nearest_[o] == position || second_[o] == position) {
        // One of the two went away. Where the candidate takes its place or a better one, the other
        // of the two is still right; else the next nearest must be looked for.
        const bool was_nearest = nearest_[o] == position;
        const std::uint32_t kept = was_nearest ? second_[o] : nearest_[o];
        const float kept_distance = was_nearest ? second_distance_[o] : nearest_distance_[o];
        if (d > second_distance_[o]) {
          orphans_.push_back(static_cast<std::uint32_t>(o));
        } else if (d < kept_distance) {
          nearest_[o] = position;
          nearest_distance_[o] = d;
          second_[o] = kept;
          second_distance_[o] = kept_distance;
        } else {
          nearest_[o] = kept;
          nearest_distance_[o] = kept_distance;
          second_[o] = position;
          second_distance_[o] = d;
        }
      } else if (d < nearest_distance_[o]) {
        second_[o] = nearest_[o];
        second_distance_[o] = nearest_distance_[o];
        nearest_[o] = position;
        nearest_distance_[o] = d;
      } else if (d < second_distance_[o]) {
        second_[o] = position;
        second_distance_[o] = d;
      }
    }
    Search(orphans_);
    UpdateSums();
  }

 private:
  // Sets nearest and second nearest of the listed samples from the distances to all medoids.
  void Search(const std::vector<std::uint32_t>& samples) {
    for (const std::uint32_t o : samples) {
      const float* distances = rows_.Row(o);
      std::uint32_t best = 0;
      std::uint32_t second = 1;
      if (distances[medoids_[second]] < distances[medoids_[best]]) std::swap(best, second);
      for (std::uint32_t m = 2; m < medoids_.size(); ++m) {
        if (distances[medoids_[m]] >= distances[medoids_[second]]) continue;
        second = m;
        if (distances[medoids_[second]] < distances[medoids_[best]]) std::swap(best, second);
      }
      nearest_[o] = best;
      second_[o] = second;
      nearest_distance_[o] = distances[medoids_[best]];
      second_distance_[o] = distances[medoids_[second]];
    }
  }

  // removal_loss_: when a medoid goes, its samples move to their second nearest, and no others move
  // (the paper's Delta TD^-). Sums again instead of adding changes, so that no rounding error
  // gathers over the swaps.
  void UpdateSums() {
    std::fill(removal_loss_.begin(), removal_loss_.end(), 0.0);
    loss_ = 0;
    for (std::size_t o = 0; o < rows_.size(); ++o) {
      loss_ += nearest_distance_[o];
      removal_loss_[nearest_[o]] +=
          static_cast<double>(second_distance_[o]) - static_cast<double>(nearest_distance_[o]);
    }
  }

  const DistanceMatrix& rows_;
  std::vector<std::uint32_t> medoids_;
  std::vector<char> is_medoid_;
  std::vector<std::uint32_t> nearest_;   // N: position of the nearest medoid
  std::vector<std::uint32_t> second_;    // N: position of the second nearest
  std::vector<float> nearest_distance_;  // N
  std::vector<float> second_distance_;   // N
  std::vector<double> removal_loss_;     // k: increase of the loss when each medoid is removed
  double loss_ = 0;
  std::vector<std::uint32_t> orphans_;  // scratch of Apply
};

// A number in [0, 1) from the generator's upper 53 bits: the same on every standard library,
// which std::uniform_real_distribution does not promise.
double Uniform(std::mt19937_64* generator) {
  return static_cast<double>((*generator)() >> 11) * 0x1.0p-53;
}

// k distinct rows. Each is drawn with a probability proportional to its distance from the nearest
// row drawn before: k-means++ (Arthur and Vassilvitskii 2007) for a loss of plain distances. When
// all distances are 0, the lowest remaining rows are used. O(k N). `checkpoint` as in
// DistanceMatrix.
std::vector<std::uint32_t> SeedMedoids(const DistanceMatrix& rows, std::size_t k,
                                       std::uint64_t seed,
                                       const std::function<void(double done)>& checkpoint) {
  const std::size_t n = rows.size();
  std::mt19937_64 generator(seed);
  std::vector<float> nearest(n, std::numeric_limits<float>::infinity());
  std::vector<char> taken(n, 0);
  std::vector<std::uint32_t> medoids;
  const auto take = [&](std::size_t row) {
    medoids.push_back(static_cast<std::uint32_t>(row));
    taken[row] = 1;
    const float* distances = rows.Row(row);
    for (std::size_t i = 0; i < n; ++i) nearest[i] = std::min(nearest[i], distances[i]);
  };
  take(std::min(n - 1, static_cast<std::size_t>(Uniform(&generator) * static_cast<double>(n))));
  while (medoids.size() < k) {
    if (medoids.size() % 64 == 0) {
      checkpoint(static_cast<double>(medoids.size()) / static_cast<double>(k));
    }
    double total = 0;
    for (const float d : nearest) total += d;
    if (total <= 0) break;
    double left = Uniform(&generator) * total;
    std::size_t chosen = n;
    for (std::size_t i = 0; i < n && (chosen == n || left > 0); ++i) {
      if (nearest[i] <= 0) continue;
      chosen = i;
      left -= nearest[i];
    }
    take(chosen);
  }
  for (std::size_t i = 0; i < n && medoids.size() < k; ++i) {
    if (taken[i] == 0) medoids.push_back(static_cast<std::uint32_t>(i));
  }
  return medoids;
}

// Candidates between two reports of progress.
constexpr std::size_t kBlock = 256;
constexpr std::size_t kCandidatesATask = 16;
// Candidates are tried one by one until this many in a row were no good, then many at a time.
constexpr std::size_t kQuietBeforeParallel = 64;
// A swap must lower the loss by this share of it to count: far above the rounding of the sums,
// far below anything that matters.
constexpr double kTolerance = 1e-10;
// Shares of `progress` that the matrix and the seeding take.
constexpr double kMatrixShare = 0.15;
constexpr double kSeedingShare = 0.05;

void Validate(const Descriptors& samples, const KMedoidsOptions& options) {
  const auto refuse = [](const char* reason, const std::string& message) {
    throw Error(ErrorCode::kInvalidArgument, reason, message);
  };
  if (samples.rows > kMaxKMedoidsSamples) {
    refuse("too_many_samples", "k-medoids takes at most " + std::to_string(kMaxKMedoidsSamples) +
                                   " samples, not " + std::to_string(samples.rows) +
                                   "; draw fewer.");
  }
  if (options.k < 1 || static_cast<std::size_t>(options.k) > samples.rows) {
    refuse("bad_k", "k = " + std::to_string(options.k) + " is outside 1.." +
                        std::to_string(samples.rows) + ", the number of samples.");
  }
  if (options.max_passes < 0) {
    refuse("bad_max_passes", "max_passes must be 0 (until no swap improves) or more.");
  }
  CheckDescriptors(samples, "k-medoids samples");
  // Up to here the sum of dim squared differences stays below the largest float.
  const double limit = 0.5 * std::sqrt(std::numeric_limits<float>::max() / samples.dim);
  for (const float x : samples.floats) {
    if (std::abs(x) < limit) continue;
    refuse("descriptors_out_of_range",
           "k-medoids samples: components are so large that distances overflow; scale them down.");
  }
}

class Run {
 public:
  Run(const Descriptors& samples, const KMedoidsOptions& options)
      : options_(options),
        threads_(ResolveThreads(options.threads)),
        rows_(samples, threads_, [this](double done) { Checkpoint(kMatrixShare * done, 0); }) {}

  KMedoidsResult Go() {
    if (options_.k == 1) {
      FindCentre();
    } else {
      Optimise();
    }
    Assign();
    if (options_.progress) options_.progress(1.0, result_.loss);
    return std::move(result_);
  }

 private:
  void Checkpoint(double done, double loss) {
    if (options_.stop.stop_requested()) {
      throw Error(ErrorCode::kCancelled, "cancelled", "k-medoids was stopped on request.");
    }
    done_ = std::max(done_, done);
    if (options_.progress) options_.progress(done_, loss);
  }

  // k = 1: the sample with the smallest sum of distances is the exact answer.
  void FindCentre() {
    const std::size_t n = rows_.size();
    std::vector<double> sums(n, 0.0);
    for (std::size_t r = 0; r < n; ++r) {
      for (std::size_t o = 0; o < n; ++o) sums[r] += rows_.Row(r)[o];
    }
    const auto best = std::min_element(sums.begin(), sums.end());
    result_.medoids = {static_cast<std::uint32_t>(best - sums.begin())};
    result_.passes = 1;
    result_.converged = true;
  }

  void Optimise() {
    FasterPam pam(rows_, SeedMedoids(rows_, static_cast<std::size_t>(options_.k), options_.seed,
                                     [this](double done) {
                                       Checkpoint(kMatrixShare + kSeedingShare * done, 0);
                                     }));
    const std::size_t n = rows_.size();
    // n candidates in a row without a gain have all been tried against the same medoids: no single
    // exchange improves, which is PAM's local optimum, wherever in a pass that happens.
    quiet_ = 0;
    while (quiet_ < n && (options_.max_passes == 0 || result_.passes < options_.max_passes)) {
      for (std::size_t first = 0; first < n && quiet_ < n; first += kBlock) {
        TryBlock(&pam, first, std::min(kBlock, n - first));
        const double pass = 1.0 - std::pow(0.6, result_.passes + static_cast<double>(first) / n);
        const double quiet = static_cast<double>(quiet_) / static_cast<double>(n);
        Checkpoint(kMatrixShare + kSeedingShare +
                       (1 - kMatrixShare - kSeedingShare) * std::max(pass, quiet * quiet),
                   pam.loss());
      }
      ++result_.passes;
    }
    result_.converged = quiet_ >= n;
    result_.medoids = pam.medoids();
    std::sort(result_.medoids.begin(), result_.medoids.end());
  }

  // Tries the candidates of a block in order, and exchanges as soon as one improves ("eager").
  // Many threads look ahead together, but the first improvement in order is taken and the rest
  // tried again: the result is that of one thread.
  void TryBlock(FasterPam* pam, std::size_t first, std::size_t count) {
    const std::size_t n = rows_.size();
    std::vector<Swap> swaps(count);
    for (std::size_t next = 0; next < count && quiet_ < n;) {
      const bool look_ahead = threads_ > 1 && quiet_ >= kQuietBeforeParallel;
      const std::size_t end = look_ahead ? count : next + 1;
      const std::size_t tasks = (end - next + kCandidatesATask - 1) / kCandidatesATask;
      ParallelFor(tasks, threads_, [&](std::size_t t) {
        std::vector<double> scratch;
        const std::size_t begin = next + t * kCandidatesATask;
        for (std::size_t c = begin; c < std::min(begin + kCandidatesATask, end); ++c) {
          swaps[c] =
              pam->is_medoid(first + c) ? Swap{} : pam->Evaluate(rows_.Row(first + c), &scratch);
        }
      });
      const double threshold = -kTolerance * pam->loss();
      while (next < end) {
        const std::size_t c = next++;
        if (swaps[c].change >= threshold) {
          if (++quiet_ >= n) return;
          continue;
        }
        pam->Apply(swaps[c].position, static_cast<std::uint32_t>(first + c), rows_.Row(first + c));
        ++result_.swaps;
        quiet_ = 0;
        break;
      }
    }
  }

  // Of equally near medoids the one of the lowest row.
  void Assign() {
    for (std::size_t o = 0; o < rows_.size(); ++o) {
      const float* distances = rows_.Row(o);
      const auto best = std::min_element(
          result_.medoids.begin(), result_.medoids.end(),
          [&](std::uint32_t a, std::uint32_t b) { return distances[a] < distances[b]; });
      result_.assignment.push_back(static_cast<std::uint32_t>(best - result_.medoids.begin()));
      result_.loss += distances[*best];
    }
  }

  const KMedoidsOptions& options_;
  int threads_;
  double done_ = 0;
  DistanceMatrix rows_;
  std::size_t quiet_ = 0;  // candidates in a row that improved nothing
  KMedoidsResult result_;
};

}  // namespace

KMedoidsResult KMedoids(const Descriptors& samples, const KMedoidsOptions& options) {
  Validate(samples, options);
  return Run(samples, options).Go();
}

}  // namespace pliant
