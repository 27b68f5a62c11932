// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/rank/code_lists.h"

#include <algorithm>

#define XXH_INLINE_ALL
#include <xxhash.h>

#include "descriptor/base/error.h"

namespace pliant {
namespace {

std::uint64_t DigestOf(std::uint32_t word, std::span<const std::uint8_t> code) {
  return XXH3_64bits_withSeed(code.data(), code.size(), word);
}

}  // namespace

// Takes the words in ascending order, each once.
class CodeLists::Builder {
 public:
  struct Entry {
    std::uint32_t image = 0;
    std::int16_t bias = 0;
    std::size_t code = 0;  // position in the bytes that go with the entries
  };

  Builder(std::size_t code_bytes, bool binary, std::size_t vocabulary_size)
      : bytes_(code_bytes), binary_(binary) {
    offsets_.reserve(vocabulary_size + 1);
  }

  void Reserve(std::size_t codes) {
    codes_.reserve(codes * bytes_ + kCodePadding);
    images_.reserve(codes);
    if (!binary_) biases_.reserve(codes);
  }

  // Entries ascending by image.
  void AddWord(std::span<const Entry> entries, const std::vector<std::uint8_t>& codes) {
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

  CodeLists Finish() && {
    codes_.resize(codes_.size() + kCodePadding);
    CodeLists lists;
    lists.bytes_ = bytes_;
    lists.binary_ = binary_;
    lists.offsets_ = Shrunk(std::move(offsets_));
    lists.images_ = Shrunk(std::move(images_));
    lists.biases_ = Shrunk(std::move(biases_));
    lists.codes_ = Shrunk(std::move(codes_));
    return lists;
  }

 private:
  template <typename T>
  static Array<T> Shrunk(std::vector<T> values) {
    values.shrink_to_fit();
    return Array<T>(std::move(values));
  }

  const std::size_t bytes_;
  const bool binary_;
  std::vector<std::uint32_t> offsets_{0};
  std::vector<ImageNumber> images_;
  std::vector<std::int16_t> biases_;
  std::vector<std::uint8_t> codes_;
};

CodeLists CodeLists::Build(std::span<const IndexedImage> images, std::size_t vocabulary_size,
                           const ResidualCoder& coder) {
  const std::size_t bytes = coder.code_bytes();
  std::vector<std::size_t> starts(vocabulary_size + 1, 0);
  const std::size_t biases_each = coder.binary() ? 0 : 1;
  std::vector<std::uint8_t> codes;
  for (const IndexedImage& image : images) {
    if (image.bow.codes.size() != image.bow.total * bytes ||
        image.bow.biases.size() != image.bow.total * biases_each) {
      throw Error(ErrorCode::kCorrupt, "codes_missing",
                  "image \"" + image.id +
                      "\" has more or fewer codes than its vocabulary needs; train a new one");
    }
    for (const WordCount& entry : image.bow.words) starts[entry.word + 1] += entry.count;
    codes.insert(codes.end(), image.bow.codes.begin(), image.bow.codes.end());
  }
  for (std::size_t w = 0; w < vocabulary_size; ++w) starts[w + 1] += starts[w];
  std::vector<Builder::Entry> entries(starts.back());
  std::vector<std::size_t> next(starts.begin(), starts.end() - 1);
  std::size_t at = 0;
  for (std::uint32_t p = 0; p < images.size(); ++p) {
    const Bow& bow = images[p].bow;
    std::size_t descriptor = 0;
    for (const WordCount& entry : bow.words) {
      for (std::uint32_t i = 0; i < entry.count; ++i, ++descriptor, at += bytes) {
        entries[next[entry.word]++] = {
            p, bow.biases.empty() ? std::int16_t{0} : bow.biases[descriptor], at};
      }
    }
  }
  Builder lists(bytes, coder.binary(), vocabulary_size);
  lists.Reserve(entries.size());
  for (std::size_t w = 0; w < vocabulary_size; ++w) {
    lists.AddWord(std::span(entries).subspan(starts[w], starts[w + 1] - starts[w]), codes);
  }
  return std::move(lists).Finish();
}

CodeLists CodeLists::Merge(std::span<const Source> sources) {
  std::size_t words = 0;
  std::size_t bytes = 0;
  bool binary = false;
  for (const Source& source : sources) {
    bytes = source.lists->bytes_;
    binary = source.lists->binary_;
    words = std::max(words, source.lists->vocabulary_size());
  }
  Builder merged(bytes, binary, words);
  std::vector<Builder::Entry> entries;
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
    std::ranges::stable_sort(entries, {}, &Builder::Entry::image);
    merged.AddWord(entries, codes);
  }
  return std::move(merged).Finish();
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

std::vector<std::uint64_t> CodeLists::Digests(std::size_t images) const {
  std::vector<std::uint64_t> digests(images, 0);
  std::vector<std::uint8_t> code(bytes_);
  for (std::uint32_t w = 0; w < vocabulary_size(); ++w) {
    const CodeList list = List(w);
    const auto image = Images(w);
    for (std::size_t i = 0; i < list.size; ++i) {
      CopyCode(list, i, code.data());
      digests[image[i]] += DigestOf(w, code);
    }
  }
  return digests;
}

std::uint64_t CodeLists::Digest(const Bow& bow) {
  std::uint64_t digest = 0;
  const std::size_t bytes = bow.total == 0 ? 0 : bow.codes.size() / bow.total;
  std::span<const std::uint8_t> codes = bow.codes;
  for (const WordCount& entry : bow.words) {
    for (std::uint32_t i = 0; i < entry.count; ++i, codes = codes.subspan(bytes)) {
      digest += DigestOf(entry.word, codes.first(bytes));
    }
  }
  return digest;
}

std::size_t CodeLists::memory_bytes() const {
  return sizeof(*this) + offsets_.memory_bytes() + images_.memory_bytes() + biases_.memory_bytes() +
         codes_.memory_bytes();
}

}  // namespace pliant
