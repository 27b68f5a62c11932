// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/rank/code_lists.h"

#include <algorithm>

#include "descriptor/base/error.h"

namespace pliant {

std::shared_ptr<const CodeLists> CodeLists::Build(std::span<const IndexedPicture> pictures,
                                                  std::size_t vocabulary_size,
                                                  const ResidualCoder& coder) {
  auto lists = std::make_shared<CodeLists>();
  lists->bytes_ = coder.code_bytes();
  lists->binary_ = coder.binary();
  std::vector<std::size_t> starts(vocabulary_size + 1, 0);
  std::vector<std::uint8_t> codes;
  for (const IndexedPicture& picture : pictures) {
    if (picture.bow.codes.size() != picture.bow.total * lists->bytes_) {
      throw Error(ErrorCode::kCorrupt, "codes_missing",
                  "picture \"" + picture.id +
                      "\" has more or fewer codes than its vocabulary needs; train a new one");
    }
    for (const WordCount& entry : picture.bow.words) starts[entry.word + 1] += entry.count;
    codes.insert(codes.end(), picture.bow.codes.begin(), picture.bow.codes.end());
  }
  for (std::size_t w = 0; w < vocabulary_size; ++w) starts[w + 1] += starts[w];
  std::vector<Entry> entries(starts.back());
  std::vector<std::size_t> next(starts.begin(), starts.end() - 1);
  std::size_t at = 0;
  for (std::uint32_t p = 0; p < pictures.size(); ++p) {
    for (const WordCount& entry : pictures[p].bow.words) {
      for (std::uint32_t i = 0; i < entry.count; ++i, at += lists->bytes_) {
        entries[next[entry.word]++] = {p, coder.Bias(entry.word, codes.data() + at), at};
      }
    }
  }
  lists->codes_.reserve(codes.size() + kCodePadding);
  for (std::size_t w = 0; w < vocabulary_size; ++w) {
    lists->AddWord(std::span(entries).subspan(starts[w], starts[w + 1] - starts[w]), codes);
  }
  lists->Finish();
  return lists;
}

std::shared_ptr<const CodeLists> CodeLists::Merge(std::span<const Source> sources) {
  auto merged = std::make_shared<CodeLists>();
  std::size_t words = 0;
  for (const Source& source : sources) {
    merged->bytes_ = source.lists->bytes_;
    merged->binary_ = source.lists->binary_;
    words = std::max(words, source.lists->vocabulary_size());
  }
  std::vector<Entry> entries;
  std::vector<std::uint8_t> codes;
  for (std::uint32_t w = 0; w < words; ++w) {
    entries.clear();
    codes.clear();
    for (const Source& source : sources) {
      if (w >= source.lists->vocabulary_size()) continue;
      const CodeList list = source.lists->List(w);
      const std::uint16_t* pictures = source.lists->Pictures(w);
      for (std::size_t i = 0; i < list.size; ++i) {
        const std::uint32_t position = (*source.position)[pictures[i]];
        if (position == kGone) continue;
        entries.push_back(
            {position, list.biases != nullptr ? list.biases[i] : std::int16_t{0}, codes.size()});
        codes.resize(codes.size() + list.bytes);
        CopyCode(list, i, codes.data() + codes.size() - list.bytes);
      }
    }
    std::stable_sort(entries.begin(), entries.end(),
                     [](const Entry& a, const Entry& b) { return a.picture < b.picture; });
    merged->AddWord(entries, codes);
  }
  merged->Finish();
  return merged;
}

void CodeLists::AddWord(std::span<const Entry> entries, const std::vector<std::uint8_t>& codes) {
  std::vector<std::uint8_t> rows;
  rows.reserve(entries.size() * bytes_);
  for (const Entry& entry : entries) {
    pictures_.push_back(static_cast<std::uint16_t>(entry.picture));
    if (!binary_) biases_.push_back(entry.bias);
    rows.insert(rows.end(), codes.begin() + static_cast<std::ptrdiff_t>(entry.code),
                codes.begin() + static_cast<std::ptrdiff_t>(entry.code + bytes_));
  }
  AppendCodes(rows.data(), entries.size(), bytes_, &codes_);
  offsets_.push_back(pictures_.size());
}

void CodeLists::Finish() {
  codes_.resize(codes_.size() + kCodePadding);
  codes_.shrink_to_fit();
  pictures_.shrink_to_fit();
  biases_.shrink_to_fit();
}

CodeList CodeLists::List(std::uint32_t word) const {
  const std::uint64_t first = offsets_[word];
  return {codes_.data() + first * bytes_, binary_ ? nullptr : biases_.data() + first,
          static_cast<std::size_t>(offsets_[word + 1] - first), bytes_};
}

std::size_t CodeLists::memory_bytes() const {
  return sizeof(*this) + offsets_.capacity() * sizeof(offsets_[0]) +
         pictures_.capacity() * sizeof(pictures_[0]) + biases_.capacity() * sizeof(biases_[0]) +
         codes_.capacity();
}

}  // namespace pliant
