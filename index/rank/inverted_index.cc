// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/rank/inverted_index.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace pliant {
namespace {

constexpr std::size_t kFanOut = 8;          // parts of a tier before they are merged
constexpr std::size_t kTiers = 5;           // 1.., 8.., 64.., 512.., 4096.. pictures
constexpr std::uint64_t kEpochShare = 256;  // see the header
using Part = IndexSnapshot::Part;

std::size_t Tier(std::size_t pictures) {
  std::size_t tier = 0;
  for (; pictures >= kFanOut && tier + 1 < kTiers; pictures /= kFanOut) ++tier;
  return tier;
}

std::shared_ptr<const std::vector<float>> InverseNorms(const IndexSegment& segment,
                                                       const std::vector<float>& idf) {
  std::vector<double> squares(segment.size(), 0.0);
  for (std::uint32_t w = 0; w < idf.size(); ++w) {
    segment.AccumulateSquares(w, idf[w], squares.data());
  }
  // |d| = sqrt(squares) / total, and the score divides by total once more (ranking.cc).
  std::vector<float> norms(segment.size(), 0.0F);
  for (std::size_t p = 0; p < norms.size(); ++p) {
    if (squares[p] > 0) norms[p] = static_cast<float>(1.0 / std::sqrt(squares[p]));
  }
  return std::make_shared<const std::vector<float>>(std::move(norms));
}

std::shared_ptr<const std::vector<float>> InverseAlikeNorms(const IndexSegment& segment,
                                                            const std::vector<float>& idf) {
  if (!segment.has_signatures()) return nullptr;
  std::vector<double> sums(segment.size(), 0.0);
  for (std::uint32_t w = 0; w < idf.size(); ++w) {
    segment.AccumulatePresence(w, idf[w], sums.data());
  }
  std::vector<float> norms(segment.size(), 0.0F);
  for (std::size_t p = 0; p < norms.size(); ++p) {
    if (sums[p] > 0) norms[p] = static_cast<float>(1.0 / std::sqrt(sums[p]));
  }
  return std::make_shared<const std::vector<float>>(std::move(norms));
}

void SetNorms(Part& part, const std::vector<float>& idf) {
  part.inverse_norms = InverseNorms(*part.segment, idf);
  part.inverse_alike_norms = InverseAlikeNorms(*part.segment, idf);
}

// Each source's positions in `merged`, for the codes.
std::shared_ptr<const CodeLists> MergedCodes(std::span<const Part> parts,
                                             const IndexSegment& merged) {
  std::vector<std::vector<std::uint32_t>> positions;
  std::vector<CodeLists::Source> sources;
  for (const Part& part : parts) {
    if (!part.codes) return nullptr;
    std::vector<std::uint32_t>& own =
        positions.emplace_back(part.segment->size(), CodeLists::kGone);
    for (std::size_t p = 0; p < own.size(); ++p) {
      if (part.IsDead(p)) continue;
      own[p] = static_cast<std::uint32_t>(merged.Find(part.segment->key(p)));
    }
  }
  for (std::size_t i = 0; i < parts.size(); ++i) {
    sources.push_back({parts[i].codes.get(), &positions[i]});
  }
  return CodeLists::Merge(sources);
}

Part MergedPart(std::span<const Part> parts, const std::vector<float>& idf) {
  std::vector<IndexSegment::Source> sources;
  for (const Part& part : parts) sources.push_back({part.segment.get(), part.dead.get()});
  Part merged;
  merged.segment = IndexSegment::Merge(sources);
  merged.codes = MergedCodes(parts, *merged.segment);
  SetNorms(merged, idf);
  return merged;
}

bool IsWasteful(const Part& part) { return part.dead_count * 4 > part.segment->size(); }

}  // namespace

bool IndexSnapshot::has_signatures() const {
  return !parts.empty() && std::all_of(parts.begin(), parts.end(), [](const Part& part) {
    return part.segment->has_signatures();
  });
}

bool IndexSnapshot::has_codes() const {
  return std::all_of(parts.begin(), parts.end(),
                     [](const Part& part) { return part.codes != nullptr; });
}

std::optional<Bow> IndexSnapshot::Find(std::int64_t key) const {
  for (const Part& part : parts) {
    const std::size_t picture = part.segment->Find(key);
    if (picture < part.segment->size() && !part.IsDead(picture))
      return part.segment->BowOf(picture);
  }
  return std::nullopt;
}

std::vector<std::int64_t> IndexSnapshot::Keys() const {
  std::vector<std::int64_t> keys;
  keys.reserve(pictures);
  for (const Part& part : parts) {
    for (std::size_t p = 0; p < part.segment->size(); ++p) {
      if (!part.IsDead(p)) keys.push_back(part.segment->key(p));
    }
  }
  std::sort(keys.begin(), keys.end());
  return keys;
}

std::size_t IndexSnapshot::memory_bytes() const {
  std::size_t bytes = sizeof(*this) + parts.capacity() * sizeof(Part) +
                      statistics->frequency.capacity() * sizeof(std::uint32_t) +
                      statistics->idf.capacity() * sizeof(float);
  for (const Part& part : parts) {
    bytes += part.segment->memory_bytes() + part.inverse_norms->capacity() * sizeof(float);
    if (part.inverse_alike_norms) {
      bytes += part.inverse_alike_norms->capacity() * sizeof(float);
    }
    if (part.codes) bytes += part.codes->memory_bytes();
    if (part.dead) bytes += part.dead->capacity() / 8;
  }
  return bytes;
}

InvertedIndex::InvertedIndex(std::size_t vocabulary_size,
                             std::shared_ptr<const Quantizer> quantizer)
    : vocabulary_size_(vocabulary_size),
      quantizer_(std::move(quantizer)),
      frequency_(vocabulary_size, 0) {
  auto empty = std::make_shared<IndexSnapshot>();
  empty->vocabulary_size = vocabulary_size;
  RenewStatistics(*empty);
  snapshot_ = std::move(empty);
}

std::shared_ptr<const IndexSnapshot> InvertedIndex::snapshot() const {
  const std::lock_guard lock(mutex_);
  return snapshot_;
}

void InvertedIndex::Publish(std::shared_ptr<const IndexSnapshot> next) {
  const std::lock_guard lock(mutex_);
  snapshot_.swap(next);  // the old one dies outside of the lock unless a search keeps it
}

void InvertedIndex::Apply(std::vector<IndexedPicture> added,
                          std::span<const std::int64_t> removed) {
  if (added.empty() && removed.empty() && !staged_) return;
  auto next =
      staged_ ? std::exchange(staged_, nullptr) : std::make_shared<IndexSnapshot>(*snapshot());
  is_changing_ = true;
  for (const std::int64_t key : removed) Remove(*next, key);
  AddParts(*next, std::move(added));
  const bool renew = changes_ * kEpochShare > next->pictures;
  if (!renew) {
    for (Part& part : next->parts) {
      if (!part.inverse_norms) SetNorms(part, next->statistics->idf);
    }
  }
  MergeParts(*next);
  if (renew) RenewStatistics(*next);
  Publish(std::move(next));
  is_changing_ = false;
}

void InvertedIndex::Stage(std::vector<IndexedPicture> added) {
  if (!staged_) staged_ = std::make_shared<IndexSnapshot>(*snapshot());
  is_changing_ = true;
  AddParts(*staged_, std::move(added));
}

void InvertedIndex::Append(std::vector<IndexedPicture> added) {
  auto next = std::make_shared<IndexSnapshot>(*snapshot());
  AddParts(*next, std::move(added));
  Publish(std::move(next));
}

void InvertedIndex::AddParts(IndexSnapshot& next, std::vector<IndexedPicture> added) {
  std::sort(added.begin(), added.end(),
            [](const IndexedPicture& a, const IndexedPicture& b) { return a.key < b.key; });
  for (const IndexedPicture& picture : added) {
    for (const WordCount& entry : picture.bow.words) ++frequency_.at(entry.word);
  }
  for (std::size_t begin = 0; begin < added.size(); begin += IndexSegment::kMaxPictures) {
    const std::size_t count = std::min(added.size() - begin, IndexSegment::kMaxPictures);
    Part part;
    const auto pictures = std::span<const IndexedPicture>(added).subspan(begin, count);
    part.segment = IndexSegment::Build(pictures, vocabulary_size_);
    if (quantizer_ && quantizer_->coder() != nullptr) {
      part.codes = CodeLists::Build(pictures, vocabulary_size_, *quantizer_->coder());
    }
    next.parts.push_back(std::move(part));
  }
  next.pictures += added.size();
  changes_ += added.size();
}

void InvertedIndex::Refresh() {
  auto next = std::make_shared<IndexSnapshot>(*snapshot());
  RenewStatistics(*next);
  Publish(std::move(next));
}

void InvertedIndex::Remove(IndexSnapshot& next, std::int64_t key) {
  for (Part& part : next.parts) {
    const std::size_t picture = part.segment->Find(key);
    if (picture >= part.segment->size() || part.IsDead(picture)) continue;
    for (const WordCount& entry : part.segment->BowOf(picture).words) --frequency_[entry.word];
    auto dead = part.dead ? std::make_shared<std::vector<bool>>(*part.dead)
                          : std::make_shared<std::vector<bool>>(part.segment->size(), false);
    (*dead)[picture] = true;
    part.dead = std::move(dead);
    ++part.dead_count;
    --next.pictures;
    ++changes_;
    return;
  }
}

void InvertedIndex::MergeParts(IndexSnapshot& next) const {
  std::erase_if(next.parts, [](const Part& part) { return part.alive() == 0; });
  const std::vector<float>& idf = next.statistics->idf;
  for (Part& part : next.parts) {
    if (IsWasteful(part)) part = MergedPart({&part, 1}, idf);
  }
  for (std::size_t tier = 0; tier < kTiers; ++tier) {
    std::vector<Part> group;
    std::size_t alive = 0;
    for (const Part& part : next.parts) {
      if (Tier(part.alive()) != tier || alive + part.alive() > IndexSegment::kMaxPictures) continue;
      group.push_back(part);
      alive += part.alive();
    }
    const bool top = tier + 1 == kTiers;  // merged as soon as a full segment comes of it
    const bool enough = top ? group.size() >= 2 && alive * 4 >= IndexSegment::kMaxPictures * 3
                            : group.size() >= kFanOut;
    if (!enough) continue;
    std::erase_if(next.parts, [&](const Part& part) {
      return std::any_of(group.begin(), group.end(),
                         [&](const Part& g) { return g.segment == part.segment; });
    });
    next.parts.push_back(MergedPart(group, idf));
  }
}

void InvertedIndex::RenewStatistics(IndexSnapshot& next) {
  auto statistics = std::make_shared<IndexStatistics>();
  statistics->pictures = next.pictures;
  statistics->frequency = frequency_;
  statistics->idf.reserve(vocabulary_size_);
  for (const std::uint32_t df : frequency_) {
    const double n = static_cast<double>(next.pictures) + 1;
    statistics->idf.push_back(static_cast<float>(std::log(n / std::max<double>(df, 1))));
  }
  for (Part& part : next.parts) SetNorms(part, statistics->idf);
  next.statistics = std::move(statistics);
  changes_ = 0;
}

}  // namespace pliant
