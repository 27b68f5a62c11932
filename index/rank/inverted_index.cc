// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/rank/inverted_index.h"

#include <algorithm>
#include <utility>

#include "descriptor/base/error.h"

namespace pliant {
namespace {

constexpr std::size_t kFanOut = 8;  // parts of a tier before they are merged
constexpr std::size_t kTiers = 5;   // 1.., 8.., 64.., 512.., 4096.. images
using Part = IndexSnapshot::Part;

std::size_t Tier(std::size_t images) {
  std::size_t tier = 0;
  for (; images >= kFanOut && tier + 1 < kTiers; images /= kFanOut) ++tier;
  return tier;
}

Part MergedPart(std::span<const Part> parts) {
  std::vector<IndexSegment::Source> sources;
  for (const Part& part : parts) sources.push_back({part.segment.get(), part.dead.get()});
  Part merged;
  merged.segment = IndexSegment::Merge(sources);
  return merged;
}

bool IsWasteful(const Part& part) { return part.dead_count * 4 > part.segment->size(); }

void Remove(IndexSnapshot* next, std::int64_t key) {
  for (Part& part : next->parts) {
    const std::size_t image = part.segment->Find(key);
    if (image >= part.segment->size() || part.IsDead(image)) continue;
    auto dead = part.dead ? std::make_shared<std::vector<bool>>(*part.dead)
                          : std::make_shared<std::vector<bool>>(part.segment->size(), false);
    (*dead)[image] = true;
    part.dead = std::move(dead);
    ++part.dead_count;
    --next->images;
    return;
  }
}

void MergeParts(IndexSnapshot* next) {
  std::erase_if(next->parts, [](const Part& part) { return part.alive() == 0; });
  for (Part& part : next->parts) {
    if (IsWasteful(part)) part = MergedPart({&part, 1});
  }
  for (std::size_t tier = 0; tier < kTiers; ++tier) {
    std::vector<Part> group;
    std::size_t alive = 0;
    for (const Part& part : next->parts) {
      if (Tier(part.alive()) != tier || alive + part.alive() > IndexSegment::kMaxImages) continue;
      group.push_back(part);
      alive += part.alive();
    }
    const bool top = tier + 1 == kTiers;  // merged as soon as a full segment comes of it
    const bool enough = top ? group.size() >= 2 && alive * 4 >= IndexSegment::kMaxImages * 3
                            : group.size() >= kFanOut;
    if (!enough) continue;
    std::erase_if(next->parts, [&](const Part& part) {
      return std::any_of(group.begin(), group.end(),
                         [&](const Part& g) { return g.segment == part.segment; });
    });
    next->parts.push_back(MergedPart(group));
  }
}

}  // namespace

std::optional<Bow> IndexSnapshot::Find(std::int64_t key) const {
  for (const Part& part : parts) {
    const std::size_t image = part.segment->Find(key);
    if (image < part.segment->size() && !part.IsDead(image)) return part.segment->BowOf(image);
  }
  return std::nullopt;
}

std::vector<std::int64_t> IndexSnapshot::Keys() const {
  std::vector<std::int64_t> keys;
  keys.reserve(images);
  for (const Part& part : parts) {
    for (std::size_t p = 0; p < part.segment->size(); ++p) {
      if (!part.IsDead(p)) keys.push_back(part.segment->key(p));
    }
  }
  std::sort(keys.begin(), keys.end());
  return keys;
}

std::size_t IndexSnapshot::memory_bytes() const {
  std::size_t bytes = sizeof(*this) + parts.capacity() * sizeof(Part);
  for (const Part& part : parts) {
    bytes += part.segment->memory_bytes();
    if (part.dead) bytes += part.dead->capacity() / 8;
  }
  return bytes;
}

InvertedIndex::InvertedIndex(std::shared_ptr<const Quantizer> quantizer)
    : quantizer_(std::move(quantizer)), snapshot_(std::make_shared<const IndexSnapshot>()) {
  if (quantizer_->coder() == nullptr) {
    throw Error(ErrorCode::kInvalidArgument, "codebook_malformed",
                "The vocabulary has no codebook; train a new vocabulary.");
  }
}

std::shared_ptr<const IndexSnapshot> InvertedIndex::snapshot() const {
  const std::lock_guard lock(mutex_);
  return snapshot_;
}

void InvertedIndex::Publish(std::shared_ptr<const IndexSnapshot> next) {
  const std::lock_guard lock(mutex_);
  snapshot_.swap(next);  // the old one dies outside of the lock unless a search keeps it
}

void InvertedIndex::Apply(std::vector<IndexedImage> added, std::span<const std::int64_t> removed) {
  if (added.empty() && removed.empty() && !staged_) return;
  auto next =
      staged_ ? std::exchange(staged_, nullptr) : std::make_shared<IndexSnapshot>(*snapshot());
  is_changing_ = true;
  for (const std::int64_t key : removed) Remove(next.get(), key);
  AddParts(*next, std::move(added));
  MergeParts(next.get());
  Publish(std::move(next));
  is_changing_ = false;
}

void InvertedIndex::Stage(std::vector<IndexedImage> added) {
  if (!staged_) staged_ = std::make_shared<IndexSnapshot>(*snapshot());
  is_changing_ = true;
  AddParts(*staged_, std::move(added));
}

void InvertedIndex::Append(std::vector<IndexedImage> added) {
  auto next = std::make_shared<IndexSnapshot>(*snapshot());
  AddParts(*next, std::move(added));
  Publish(std::move(next));
}

void InvertedIndex::AddParts(IndexSnapshot& next, std::vector<IndexedImage> added) {
  std::sort(added.begin(), added.end(),
            [](const IndexedImage& a, const IndexedImage& b) { return a.key < b.key; });
  for (std::size_t begin = 0; begin < added.size(); begin += IndexSegment::kMaxImages) {
    const std::size_t count = std::min(added.size() - begin, IndexSegment::kMaxImages);
    Part part;
    part.segment = IndexSegment::Build(std::span<const IndexedImage>(added).subspan(begin, count),
                                       quantizer_->vocabulary().size(), *quantizer_->coder());
    next.parts.push_back(std::move(part));
  }
  next.images += added.size();
}

}  // namespace pliant
