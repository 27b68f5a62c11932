// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Making segments: from pictures, and from other segments.
#include <algorithm>

#include "descriptor/base/error.h"
#include "index/rank/index_segment.h"

namespace pliant {
namespace {

constexpr std::uint32_t kMaxCount = 255;          // that a posting can hold
constexpr std::size_t kMinPicturesForDense = 64;  // below, rows save nothing

bool AreSigned(std::span<const IndexedPicture> pictures) {
  std::size_t with = 0;
  std::size_t without = 0;
  for (const IndexedPicture& picture : pictures) {
    if (picture.bow.words.empty()) continue;
    ++(picture.bow.signatures.size() == picture.bow.words.size() ? with : without);
  }
  if (with > 0 && without > 0) {
    throw Error(ErrorCode::kCorrupt, "signatures_missing",
                "some pictures have words with signatures of the same vocabulary and some without; "
                "train a new vocabulary");
  }
  return with > 0;
}

struct Squares {
  double total = 0;
  double squares = 0;
};

Squares SquaresOf(const Bow& bow) {
  Squares result;
  for (const WordCount& entry : bow.words) {
    result.total += entry.count;
    result.squares += static_cast<double>(entry.count) * entry.count;
  }
  return result;
}

}  // namespace

std::shared_ptr<const IndexSegment> IndexSegment::Build(std::span<const IndexedPicture> pictures,
                                                        std::size_t vocabulary_size) {
  if (pictures.size() > kMaxPictures) {
    throw Error(ErrorCode::kInternal, "segment_too_large",
                "an index segment got too many pictures");
  }
  const bool is_signed = AreSigned(pictures);
  std::vector<std::size_t> starts(vocabulary_size + 1, 0);
  auto segment = std::make_shared<IndexSegment>();
  for (const IndexedPicture& picture : pictures) {
    const Squares sums = SquaresOf(picture.bow);
    segment->AddPicture(picture.key, picture.object, picture.id, sums.total, sums.squares);
    for (const WordCount& entry : picture.bow.words) {
      if (entry.word >= vocabulary_size) {
        throw Error(ErrorCode::kInternal, "word_out_of_range", "a word is outside the vocabulary");
      }
      ++starts[entry.word + 1];
    }
  }
  for (std::size_t w = 0; w < vocabulary_size; ++w) starts[w + 1] += starts[w];
  std::vector<Posting> postings(starts.back());
  std::vector<std::size_t> next(starts.begin(), starts.end() - 1);
  for (std::uint32_t p = 0; p < pictures.size(); ++p) {
    const Bow& bow = pictures[p].bow;
    for (std::size_t i = 0; i < bow.words.size(); ++i) {
      const std::uint64_t signature = is_signed ? bow.signatures[i] : 0;
      postings[next[bow.words[i].word]++] = {p, bow.words[i].count, signature};
    }
  }
  segment->offsets_.reserve(vocabulary_size + 1);
  if (is_signed) {
    segment->BeginSignatures();
    segment->signatures_.reserve(postings.size());
  }
  for (std::size_t w = 0; w < vocabulary_size; ++w) {
    segment->AddWord(std::span(postings).subspan(starts[w], starts[w + 1] - starts[w]));
  }
  return segment;
}

std::shared_ptr<const IndexSegment> IndexSegment::Merge(std::span<const Source> sources) {
  struct Place {
    std::int64_t key;
    std::uint32_t source;
    std::uint32_t picture;
  };
  std::vector<Place> places;
  std::size_t words = 0;
  for (std::uint32_t s = 0; s < sources.size(); ++s) {
    const Source& source = sources[s];
    words = std::max(words, source.segment->vocabulary_size());
    for (std::uint32_t p = 0; p < source.segment->size(); ++p) {
      if (source.dead == nullptr || !(*source.dead)[p]) {
        places.push_back({source.segment->key(p), s, p});
      }
    }
  }
  std::sort(places.begin(), places.end(),
            [](const Place& a, const Place& b) { return a.key < b.key; });
  auto merged = std::make_shared<IndexSegment>();
  const bool is_signed = std::any_of(sources.begin(), sources.end(), [](const Source& source) {
    return source.segment->has_signatures();
  });
  if (is_signed) merged->BeginSignatures();
  std::vector<std::vector<std::uint32_t>> new_position;  // kNoRow = dead
  for (const Source& source : sources) new_position.emplace_back(source.segment->size(), kNoRow);
  for (const Place& place : places) {
    const IndexSegment& from = *sources[place.source].segment;
    new_position[place.source][place.picture] = static_cast<std::uint32_t>(merged->size());
    merged->AddPicture(place.key, from.object(place.picture), from.id(place.picture),
                       from.total(place.picture), from.sum_of_squares(place.picture));
  }
  std::vector<Posting> postings;
  for (std::uint32_t w = 0; w < words; ++w) {
    postings.clear();
    for (std::size_t s = 0; s < sources.size(); ++s) {
      for (const Posting& posting : sources[s].segment->PostingsOf(w)) {
        const std::uint32_t position = new_position[s][posting.picture];
        if (position != kNoRow) postings.push_back({position, posting.count, posting.signature});
      }
    }
    const auto by_picture = [](const Posting& a, const Posting& b) {
      return a.picture < b.picture;
    };
    if (!std::is_sorted(postings.begin(), postings.end(), by_picture)) {
      std::sort(postings.begin(), postings.end(), by_picture);
    }
    merged->AddWord(postings);
  }
  merged->pictures_.shrink_to_fit();
  merged->counts_.shrink_to_fit();
  merged->dense_.shrink_to_fit();
  merged->signatures_.shrink_to_fit();
  return merged;
}

void IndexSegment::AddPicture(std::int64_t key, std::int64_t object, std::string_view id,
                              double total, double squares) {
  keys_.push_back(key);
  objects_.push_back(object);
  id_text_ += id;
  id_offsets_.push_back(static_cast<std::uint32_t>(id_text_.size()));
  totals_.push_back(total);
  squares_.push_back(squares);
}

void IndexSegment::AddWord(std::span<const Posting> postings) {
  const bool dense = size() >= kMinPicturesForDense && postings.size() * 3 >= size();
  std::uint8_t* row = nullptr;
  if (dense) {
    dense_rows_.resize(offsets_.size(), kNoRow);
    dense_rows_.back() = static_cast<std::uint32_t>(dense_.size() / size());
    dense_.resize(dense_.size() + size(), 0);
    row = dense_.data() + dense_.size() - size();
  }
  for (const Posting& posting : postings) {
    std::uint32_t left = posting.count;
    if (dense) {
      row[posting.picture] = static_cast<std::uint8_t>(std::min(left, kMaxCount));
      left -= row[posting.picture];
    }
    for (; left > 0; left -= counts_.back()) {
      pictures_.push_back(static_cast<std::uint16_t>(posting.picture));
      counts_.push_back(static_cast<std::uint8_t>(std::min(left, kMaxCount)));
    }
  }
  offsets_.push_back(static_cast<std::uint32_t>(counts_.size()));
  if (!has_signatures()) return;
  for (const Posting& posting : postings) signatures_.push_back(posting.signature);
  signature_offsets_.push_back(static_cast<std::uint32_t>(signatures_.size()));
}

}  // namespace pliant
