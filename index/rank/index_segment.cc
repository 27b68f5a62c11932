// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/rank/index_segment.h"

#include <algorithm>

#include "descriptor/base/error.h"

namespace pliant {
namespace {

double SumOfSquares(const Bow& bow) {
  double sum = 0;
  for (const WordCount& entry : bow.words) sum += static_cast<double>(entry.count) * entry.count;
  return sum;
}

}  // namespace

std::shared_ptr<const IndexSegment> IndexSegment::Build(std::span<const IndexedImage> images,
                                                        std::size_t vocabulary_size,
                                                        const ResidualCoder& coder) {
  if (images.size() > kMaxImages) {
    throw Error(ErrorCode::kInternal, "segment_too_large", "an index segment got too many images");
  }
  auto segment = std::make_shared<IndexSegment>();
  segment->Reserve(images.size());
  for (const IndexedImage& image : images) {
    const Bow& bow = image.bow;
    if (!bow.words.empty() && bow.words.back().word >= vocabulary_size) {
      throw Error(ErrorCode::kInternal, "word_out_of_range", "a word is outside the vocabulary");
    }
    segment->AddImage(image.key, image.object, image.id, bow.total, SumOfSquares(bow));
  }
  segment->codes_ = CodeLists::Build(images, vocabulary_size, coder);
  return segment;
}

std::shared_ptr<const IndexSegment> IndexSegment::Merge(std::span<const Source> sources) {
  struct Place {
    std::int64_t key;
    std::uint32_t source;
    std::uint32_t image;
  };
  std::vector<Place> places;
  for (std::uint32_t s = 0; s < sources.size(); ++s) {
    const Source& source = sources[s];
    for (std::uint32_t p = 0; p < source.segment->size(); ++p) {
      if (source.dead == nullptr || !(*source.dead)[p]) {
        places.push_back({source.segment->key(p), s, p});
      }
    }
  }
  std::sort(places.begin(), places.end(),
            [](const Place& a, const Place& b) { return a.key < b.key; });
  std::vector<std::vector<std::uint32_t>> positions;
  for (const Source& source : sources) {
    positions.emplace_back(source.segment->size(), CodeLists::kGone);
  }
  auto merged = std::make_shared<IndexSegment>();
  merged->Reserve(places.size());
  for (const Place& place : places) {
    const IndexSegment& from = *sources[place.source].segment;
    positions[place.source][place.image] = static_cast<std::uint32_t>(merged->size());
    merged->AddImage(place.key, from.object(place.image), from.id(place.image),
                     from.total(place.image), from.sum_of_squares(place.image));
  }
  std::vector<CodeLists::Source> codes;
  for (std::size_t s = 0; s < sources.size(); ++s) {
    codes.push_back({&sources[s].segment->codes_, &positions[s]});
  }
  merged->codes_ = CodeLists::Merge(codes);
  return merged;
}

void IndexSegment::Reserve(std::size_t images) {
  keys_.reserve(images);
  objects_.reserve(images);
  id_offsets_.reserve(images + 1);
  totals_.reserve(images);
  squares_.reserve(images);
}

void IndexSegment::AddImage(std::int64_t key, std::int64_t object, std::string_view id,
                            double total, double squares) {
  keys_.push_back(key);
  objects_.push_back(object);
  id_text_ += id;
  id_offsets_.push_back(static_cast<std::uint32_t>(id_text_.size()));
  totals_.push_back(total);
  squares_.push_back(squares);
}

std::size_t IndexSegment::Find(std::int64_t key) const {
  const auto found = std::lower_bound(keys_.begin(), keys_.end(), key);
  if (found == keys_.end() || *found != key) return size();
  return static_cast<std::size_t>(found - keys_.begin());
}

std::size_t IndexSegment::memory_bytes() const {
  const auto bytes = [](const auto& v) { return v.capacity() * sizeof(v[0]); };
  return sizeof(*this) - sizeof(codes_) + bytes(keys_) + bytes(objects_) + bytes(id_offsets_) +
         bytes(id_text_) + bytes(totals_) + bytes(squares_) + codes_.memory_bytes();
}

}  // namespace pliant
