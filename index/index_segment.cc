// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/index_segment.h"

#include <algorithm>
#include <bit>

#include "descriptor/error.h"
#include "index/accumulate.h"

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

template <typename Visit>
void IndexSegment::ForEachPicture(std::uint32_t word, Visit&& visit) const {
  if (word < dense_rows_.size() && dense_rows_[word] != kNoRow) {
    const std::uint8_t* counts = dense_.data() + dense_rows_[word] * size();
    for (std::uint32_t p = 0; p < size(); ++p) {
      if (counts[p] != 0) visit(p);
    }
    return;
  }
  const std::uint32_t end = offsets_[word + 1];
  for (std::uint32_t i = offsets_[word]; i < end; ++i) {
    // A count above 255 takes several postings.
    if (i > offsets_[word] && pictures_[i] == pictures_[i - 1]) continue;
    visit(std::uint32_t{pictures_[i]});
  }
}

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

void IndexSegment::AccumulateAlike(std::uint32_t word, std::uint64_t signature,
                                   const BitWeights& weights, float* sums) const {
  const std::uint64_t* own = signatures_.data() + signature_offsets_[word];
  const SignedPostings postings{own, signature, weights.data()};
  if (word < dense_rows_.size() && dense_rows_[word] != kNoRow) {
    AccumulateAlikeDense(postings, dense_.data() + dense_rows_[word] * size(), size(), sums);
    return;
  }
  const std::size_t pictures = signature_offsets_[word + 1] - signature_offsets_[word];
  if (offsets_[word + 1] - offsets_[word] == pictures) {  // no count above 255
    pliant::AccumulateAlike(postings, pictures_.data() + offsets_[word], pictures, sums);
    return;
  }
  ForEachPicture(word, [&](std::uint32_t picture) {
    sums[picture] += weights[static_cast<std::size_t>(std::popcount(*own++ ^ signature))];
  });
}

void IndexSegment::AccumulatePresence(std::uint32_t word, double weight, double* sums) const {
  ForEachPicture(word, [&](std::uint32_t picture) { sums[picture] += weight; });
}

std::size_t IndexSegment::Find(std::int64_t key) const {
  const auto found = std::lower_bound(keys_.begin(), keys_.end(), key);
  if (found == keys_.end() || *found != key) return size();
  return static_cast<std::size_t>(found - keys_.begin());
}

std::vector<Posting> IndexSegment::PostingsOf(std::uint32_t word) const {
  std::vector<Posting> postings;
  if (word >= vocabulary_size()) return postings;
  const std::uint32_t row = word < dense_rows_.size() ? dense_rows_[word] : kNoRow;
  std::uint32_t i = offsets_[word];
  const std::uint32_t end = offsets_[word + 1];
  if (row != kNoRow) {
    const std::uint8_t* counts = dense_.data() + row * size();
    for (std::uint32_t p = 0; p < size(); ++p) {
      if (counts[p] == 0) continue;
      postings.push_back({p, counts[p], 0});
      for (; i < end && pictures_[i] == p; ++i) postings.back().count += counts_[i];
    }
    AddSignatures(word, &postings);
    return postings;
  }
  postings.reserve(end - i);
  for (; i < end; ++i) {
    if (!postings.empty() && postings.back().picture == pictures_[i]) {
      postings.back().count += counts_[i];
    } else {
      postings.push_back({pictures_[i], counts_[i], 0});
    }
  }
  AddSignatures(word, &postings);
  return postings;
}

void IndexSegment::AddSignatures(std::uint32_t word, std::vector<Posting>* postings) const {
  if (!has_signatures()) return;
  const std::uint64_t* own = signatures_.data() + signature_offsets_[word];
  for (Posting& posting : *postings) posting.signature = *own++;
}

Bow IndexSegment::BowOf(std::size_t picture) const {
  Bow bow;
  for (std::uint32_t w = 0; w < vocabulary_size(); ++w) {
    std::uint32_t count = 0;
    const bool dense = w < dense_rows_.size() && dense_rows_[w] != kNoRow;
    if (dense) count += dense_[dense_rows_[w] * size() + picture];
    const auto begin = pictures_.begin() + offsets_[w];
    const auto end = pictures_.begin() + offsets_[w + 1];
    const auto [first, last] = std::equal_range(begin, end, static_cast<std::uint16_t>(picture));
    for (auto it = first; it != last; ++it) count += counts_[it - pictures_.begin()];
    if (count == 0) continue;
    bow.words.push_back({w, count});
    bow.total += count;
    if (has_signatures()) bow.signatures.push_back(SignatureOf(w, picture));
  }
  return bow;
}

std::uint64_t IndexSegment::SignatureOf(std::uint32_t word, std::size_t picture) const {
  const std::uint64_t* own = signatures_.data() + signature_offsets_[word];
  std::uint64_t found = 0;
  ForEachPicture(word, [&](std::uint32_t p) {
    if (p == picture) found = *own;
    ++own;
  });
  return found;
}

void IndexSegment::Accumulate(std::uint32_t word, float weight, float* sums) const {
  if (word < dense_rows_.size() && dense_rows_[word] != kNoRow) {
    AccumulateDense({dense_.data() + dense_rows_[word] * size(), size()}, weight, sums);
  }
  const std::uint32_t begin = offsets_[word];
  const std::uint32_t end = offsets_[word + 1];
  for (std::uint32_t i = begin; i < end; ++i) {
    sums[pictures_[i]] += weight * static_cast<float>(counts_[i]);
  }
}

void IndexSegment::AccumulateSquares(std::uint32_t word, double weight, double* sums) const {
  const double squared_weight = weight * weight;
  const std::uint32_t begin = offsets_[word];
  const std::uint32_t end = offsets_[word + 1];
  const bool dense = word < dense_rows_.size() && dense_rows_[word] != kNoRow;
  if (dense && begin != end) {  // counts above 255 lie in two places
    for (const Posting& posting : PostingsOf(word)) {
      sums[posting.picture] += squared_weight * posting.count * posting.count;
    }
    return;
  }
  if (dense) {
    const std::uint8_t* counts = dense_.data() + dense_rows_[word] * size();
    for (std::size_t p = 0; p < size(); ++p) {
      sums[p] += squared_weight * (static_cast<int>(counts[p]) * counts[p]);
    }
    return;
  }
  for (std::uint32_t i = begin; i < end;) {
    const std::uint16_t picture = pictures_[i];
    double count = 0;
    for (; i < end && pictures_[i] == picture; ++i) count += counts_[i];
    sums[picture] += squared_weight * count * count;
  }
}

std::size_t IndexSegment::memory_bytes() const {
  const auto bytes = [](const auto& v) { return v.capacity() * sizeof(v[0]); };
  return sizeof(*this) + bytes(keys_) + bytes(objects_) + bytes(id_offsets_) + bytes(id_text_) +
         bytes(totals_) + bytes(squares_) + bytes(offsets_) + bytes(pictures_) + bytes(counts_) +
         bytes(dense_rows_) + bytes(dense_) + bytes(signature_offsets_) + bytes(signatures_);
}

}  // namespace pliant
