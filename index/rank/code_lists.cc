// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/rank/code_lists.h"

#include <algorithm>

#include "descriptor/base/error.h"

namespace pliant {

CodeLists CodeLists::Build(std::span<const IndexedImage> images, std::size_t vocabulary_size,
                           const ResidualCoder& coder) {
  CodeLists lists;
  lists.bytes_ = coder.code_bytes();
  lists.binary_ = coder.binary();
  std::vector<std::size_t> starts(vocabulary_size + 1, 0);
  std::vector<std::uint8_t> codes;
  for (const IndexedImage& image : images) {
    if (image.bow.codes.size() != image.bow.total * lists.bytes_) {
      throw Error(ErrorCode::kCorrupt, "codes_missing",
                  "image \"" + image.id +
                      "\" has more or fewer codes than its vocabulary needs; train a new one");
    }
    for (const WordCount& entry : image.bow.words) starts[entry.word + 1] += entry.count;
    codes.insert(codes.end(), image.bow.codes.begin(), image.bow.codes.end());
  }
  for (std::size_t w = 0; w < vocabulary_size; ++w) starts[w + 1] += starts[w];
  std::vector<Entry> entries(starts.back());
  std::vector<std::size_t> next(starts.begin(), starts.end() - 1);
  std::size_t at = 0;
  for (std::uint32_t p = 0; p < images.size(); ++p) {
    for (const WordCount& entry : images[p].bow.words) {
      for (std::uint32_t i = 0; i < entry.count; ++i, at += lists.bytes_) {
        entries[next[entry.word]++] = {p, coder.Bias(entry.word, codes.data() + at), at};
      }
    }
  }
  lists.codes_.reserve(codes.size() + kCodePadding);
  lists.images_.reserve(entries.size());
  if (!lists.binary_) lists.biases_.reserve(entries.size());
  lists.offsets_.reserve(vocabulary_size + 1);
  for (std::size_t w = 0; w < vocabulary_size; ++w) {
    lists.AddWord(std::span(entries).subspan(starts[w], starts[w + 1] - starts[w]), codes);
  }
  lists.Finish();
  return lists;
}

CodeLists CodeLists::Merge(std::span<const Source> sources) {
  CodeLists merged;
  std::size_t words = 0;
  for (const Source& source : sources) {
    merged.bytes_ = source.lists->bytes_;
    merged.binary_ = source.lists->binary_;
    words = std::max(words, source.lists->vocabulary_size());
  }
  merged.offsets_.reserve(words + 1);
  std::vector<Entry> entries;
  std::vector<std::uint8_t> codes;
  for (std::uint32_t w = 0; w < words; ++w) {
    entries.clear();
    codes.clear();
    for (const Source& source : sources) {
      const CodeList list = source.lists->List(w);
      std::size_t next = 0;
      source.lists->ForEachCount(w, [&](std::size_t image, std::size_t count) {
        const std::size_t begin = next;
        next += count;
        const std::uint32_t position = (*source.position)[image];
        if (position == kGone) return;
        for (std::size_t i = begin; i < next; ++i) {
          entries.push_back(
              {position, list.biases != nullptr ? list.biases[i] : std::int16_t{0}, codes.size()});
          codes.resize(codes.size() + list.bytes);
          CopyCode(list, i, codes.data() + codes.size() - list.bytes);
        }
      });
    }
    std::stable_sort(entries.begin(), entries.end(),
                     [](const Entry& a, const Entry& b) { return a.image < b.image; });
    merged.AddWord(entries, codes);
  }
  merged.Finish();
  return merged;
}

void CodeLists::AddWord(std::span<const Entry> entries, const std::vector<std::uint8_t>& codes) {
  if (images_.size() + entries.size() > std::numeric_limits<std::uint32_t>::max()) {
    throw Error(ErrorCode::kInternal, "segment_too_large",
                "an index segment got too many descriptors");
  }
  std::vector<std::uint8_t> rows;
  rows.reserve(entries.size() * bytes_);
  for (const Entry& entry : entries) {
    images_.push_back(static_cast<ImageNumber>(entry.image));
    if (!binary_) biases_.push_back(entry.bias);
    rows.insert(rows.end(), codes.begin() + static_cast<std::ptrdiff_t>(entry.code),
                codes.begin() + static_cast<std::ptrdiff_t>(entry.code + bytes_));
  }
  offsets_.push_back(static_cast<std::uint32_t>(images_.size()));
  AppendCodes(rows.data(), entries.size(), bytes_, &codes_);
}

void CodeLists::Finish() {
  codes_.resize(codes_.size() + kCodePadding);
  codes_.shrink_to_fit();
  images_.shrink_to_fit();
  biases_.shrink_to_fit();
}

CodeList CodeLists::List(std::uint32_t word) const {
  const std::size_t first = First(word);
  return {codes_.data() + first * bytes_, binary_ ? nullptr : biases_.data() + first,
          First(word + 1) - first, bytes_};
}

Bow CodeLists::BowOf(std::size_t image) const {
  Bow bow;
  for (std::uint32_t w = 0; w < vocabulary_size(); ++w) {
    const auto images = Images(w);
    const auto [first, last] = std::equal_range(images.begin(), images.end(), image);
    if (first == last) continue;
    const auto count = static_cast<std::uint32_t>(last - first);
    bow.words.push_back({w, count});
    bow.total += count;
    for (auto code = first; code != last; ++code) {
      bow.codes.resize(bow.codes.size() + bytes_);
      CopyCode(List(w), static_cast<std::size_t>(code - images.begin()),
               bow.codes.data() + bow.codes.size() - bytes_);
    }
  }
  return bow;
}

std::size_t CodeLists::memory_bytes() const {
  return sizeof(*this) + offsets_.capacity() * sizeof(offsets_[0]) +
         images_.capacity() * sizeof(images_[0]) + biases_.capacity() * sizeof(biases_[0]) +
         codes_.capacity();
}

}  // namespace pliant
