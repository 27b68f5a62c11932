// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/rank/index_segment.h"

#include <algorithm>
#include <bit>

#include "index/rank/accumulate.h"

namespace pliant {

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
