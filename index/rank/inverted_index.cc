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
constexpr std::size_t kMostAtOnce = InvertedIndex::kMostAtOnce;
using Part = IndexSnapshot::Part;

std::size_t Tier(std::size_t images) {
  std::size_t tier = 0;
  for (; images >= kFanOut && tier + 1 < kTiers; images /= kFanOut) ++tier;
  return tier;
}

// Larger segments are in files: saving rewrites them.
bool IsWasteful(const Part& part) {
  return part.dead_count * 4 > part.segment->size() && part.segment->size() <= kMostAtOnce;
}

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
    if (IsWasteful(part)) part = Part::Merged({&part, 1});
  }
  for (std::size_t tier = 0; tier < kTiers; ++tier) {
    std::vector<Part> group;
    std::size_t alive = 0;
    for (const Part& part : next->parts) {
      if (Tier(part.alive()) != tier || alive + part.alive() > kMostAtOnce) continue;
      group.push_back(part);
      alive += part.alive();
    }
    const bool top = tier + 1 == kTiers;  // merged as soon as a full segment comes of it
    const bool enough =
        top ? group.size() >= 2 && alive * 4 >= kMostAtOnce * 3 : group.size() >= kFanOut;
    if (!enough) continue;
    std::erase_if(next->parts, [&](const Part& part) {
      return std::ranges::find(group, part.segment, &Part::segment) != group.end();
    });
    next->parts.push_back(Part::Merged(group));
  }
}

}  // namespace

class IndexSegment::Builder {
 public:
  explicit Builder(std::size_t images) { images_.reserve(images); }

  std::size_t size() const { return images_.size(); }
  void Add(Image image, std::string_view id) {
    ids_.insert(ids_.end(), id.begin(), id.end());
    image.id_end = static_cast<std::uint32_t>(ids_.size());
    images_.push_back(image);
  }
  std::shared_ptr<const IndexSegment> Finish(CodeLists codes) && {
    auto segment = std::make_shared<IndexSegment>();
    segment->images_ = Array(std::move(images_));
    segment->ids_ = Array(std::move(ids_));
    segment->codes_ = std::move(codes);
    return segment;
  }

 private:
  std::vector<Image> images_;
  std::vector<char> ids_;
};

std::shared_ptr<const IndexSegment> IndexSegment::Build(std::span<const IndexedImage> images,
                                                        std::size_t vocabulary_size,
                                                        const ResidualCoder& coder) {
  if (images.size() > kMaxImages) {
    throw Error(ErrorCode::kInternal, "segment_too_large", "an index segment got too many images");
  }
  Builder segment(images.size());
  for (const IndexedImage& image : images) {
    const Bow& bow = image.bow;
    if (!bow.words.empty() && bow.words.back().word >= vocabulary_size) {
      throw Error(ErrorCode::kInternal, "word_out_of_range", "a word is outside the vocabulary");
    }
    double squares = 0;
    for (const WordCount& entry : bow.words) {
      squares += static_cast<double>(entry.count) * entry.count;
    }
    segment.Add({image.key, image.object, squares, bow.total}, image.id);
  }
  return std::move(segment).Finish(CodeLists::Build(images, vocabulary_size, coder));
}

std::shared_ptr<const IndexSegment> IndexSegment::Merge(std::span<const Source> sources) {
  struct Place {
    std::int64_t key;
    std::uint32_t source;
    std::uint32_t image;
  };
  std::vector<Place> places;
  std::vector<std::vector<std::uint32_t>> positions;
  for (std::uint32_t s = 0; s < sources.size(); ++s) {
    const auto& [segment, dead] = sources[s];
    positions.emplace_back(segment->size(), CodeLists::kGone);
    for (std::uint32_t p = 0; p < segment->size(); ++p) {
      if (dead == nullptr || !(*dead)[p]) places.push_back({(*segment)[p].key, s, p});
    }
  }
  std::ranges::sort(places, {}, &Place::key);
  Builder merged(places.size());
  for (const Place& place : places) {
    const IndexSegment& from = *sources[place.source].segment;
    positions[place.source][place.image] = static_cast<std::uint32_t>(merged.size());
    merged.Add(from[place.image], from.id(place.image));
  }
  std::vector<CodeLists::Source> codes;
  for (std::size_t s = 0; s < sources.size(); ++s) {
    codes.push_back({&sources[s].segment->codes_, &positions[s]});
  }
  return std::move(merged).Finish(CodeLists::Merge(codes));
}

std::size_t IndexSegment::Find(std::int64_t key) const {
  const auto found = std::ranges::lower_bound(images_, key, {}, &Image::key);
  if (found == images_.end() || found->key != key) return size();
  return static_cast<std::size_t>(found - images_.begin());
}

std::size_t IndexSegment::memory_bytes() const {
  return sizeof(*this) - sizeof(codes_) + images_.memory_bytes() + ids_.memory_bytes() +
         codes_.memory_bytes();
}

Part Part::Merged(std::span<const Part> parts) {
  std::vector<IndexSegment::Source> sources;
  for (const Part& part : parts) sources.push_back({part.segment.get(), part.dead.get()});
  Part merged;
  merged.segment = IndexSegment::Merge(sources);
  return merged;
}

std::optional<Bow> IndexSnapshot::Find(std::int64_t key) const {
  for (const Part& part : parts) {
    const std::size_t image = part.segment->Find(key);
    if (image < part.segment->size() && !part.IsDead(image)) {
      return part.segment->codes().BowOf(image);
    }
  }
  return std::nullopt;
}

std::size_t IndexSnapshot::memory_bytes() const {
  std::size_t bytes = sizeof(*this) + parts.capacity() * sizeof(Part);
  for (const Part& part : parts) {
    bytes += part.segment->memory_bytes();
    if (part.dead) bytes += part.dead->capacity() / 8;
  }
  return bytes;
}

InvertedIndex::InvertedIndex(std::shared_ptr<const Quantizer> quantizer, IndexSnapshot snapshot)
    : quantizer_(std::move(quantizer)),
      snapshot_(std::make_shared<const IndexSnapshot>(std::move(snapshot))) {
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

void InvertedIndex::Exchange(std::span<const std::shared_ptr<const IndexSegment>> old,
                             std::shared_ptr<const IndexSegment> same) {
  auto next = std::make_shared<IndexSnapshot>(*snapshot());
  Part part;
  part.segment = std::move(same);
  std::size_t alive = 0;
  for (const auto& segment : old) {
    const auto found = std::ranges::find(next->parts, segment, &Part::segment);
    if (found == next->parts.end()) return;
    alive += found->alive();
    next->parts.erase(found);
  }
  if (alive < part.segment->size()) {  // some were removed meanwhile
    const std::shared_ptr<const IndexSnapshot> now = snapshot();
    std::vector<bool> dead(part.segment->size(), true);
    for (const Part& before : now->parts) {
      if (std::ranges::find(old, before.segment) == old.end()) continue;
      for (std::size_t image = 0; image < before.segment->size(); ++image) {
        if (before.IsDead(image)) continue;
        dead[part.segment->Find((*before.segment)[image].key)] = false;
      }
    }
    part.dead = std::make_shared<const std::vector<bool>>(std::move(dead));
    part.dead_count = part.segment->size() - alive;
  }
  next->parts.push_back(std::move(part));
  Publish(std::move(next));
}

void InvertedIndex::AddParts(IndexSnapshot& next, std::vector<IndexedImage> added) {
  std::ranges::sort(added, {}, &IndexedImage::key);
  for (std::size_t begin = 0; begin < added.size(); begin += kMostAtOnce) {
    const std::size_t count = std::min(added.size() - begin, kMostAtOnce);
    Part part;
    part.segment = IndexSegment::Build(std::span<const IndexedImage>(added).subspan(begin, count),
                                       quantizer_->vocabulary().size(), *quantizer_->coder());
    next.parts.push_back(std::move(part));
  }
  next.images += added.size();
}

}  // namespace pliant
