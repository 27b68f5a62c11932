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

// Of vectors that are being filled.
struct CodeLists::Parts {
  std::vector<std::uint32_t> offsets{0};
  std::vector<ImageNumber> images;
  std::vector<std::int16_t> biases;
  std::vector<std::uint8_t> codes;

  void EndWord() {
    if (images.size() > std::numeric_limits<std::uint32_t>::max()) {
      throw Error(ErrorCode::kInternal, "segment_too_large",
                  "an index segment got too many descriptors");
    }
    offsets.push_back(static_cast<std::uint32_t>(images.size()));
  }
  CodeLists Finish(std::size_t bytes, bool binary) && {
    codes.resize(codes.size() + kCodePadding);
    CodeLists lists;
    lists.bytes_ = bytes;
    lists.binary_ = binary;
    lists.offsets_ = Shrunk(std::move(offsets));
    lists.images_ = Shrunk(std::move(images));
    lists.biases_ = Shrunk(std::move(biases));
    lists.codes_ = Shrunk(std::move(codes));
    return lists;
  }

 private:
  template <typename T>
  static Array<T> Shrunk(std::vector<T> values) {
    values.shrink_to_fit();
    return Array<T>(std::move(values));
  }
};

CodeLists CodeLists::Build(std::span<const IndexedImage> images, std::size_t vocabulary_size,
                           const ResidualCoder& coder) {
  const std::size_t bytes = coder.code_bytes();
  std::vector<std::size_t> next(vocabulary_size + 1, 0);  // after each word, then of each word
  for (const IndexedImage& image : images) {
    if (image.bow.codes.size() != image.bow.total * bytes ||
        image.bow.biases.size() != (coder.binary() ? 0 : image.bow.total)) {
      throw Error(ErrorCode::kCorrupt, "codes_missing",
                  "image \"" + image.id +
                      "\" has more or fewer codes than its vocabulary needs; train a new one");
    }
    for (const WordCount& entry : image.bow.words) next[entry.word + 1] += entry.count;
  }
  Parts parts;
  parts.offsets.reserve(vocabulary_size + 1);
  for (std::size_t w = 0; w < vocabulary_size; ++w) {
    next[w + 1] += next[w];
    parts.images.resize(next[w + 1]);
    parts.EndWord();
  }
  parts.biases.resize(coder.binary() ? 0 : next.back());
  parts.codes.reserve(next.back() * bytes + kCodePadding);
  // So many words at once that what is written to stays in the processor's cache.
  constexpr std::size_t kAtOnce = 4096;
  struct Place {
    std::size_t entry = 0;  // in the words of an image
    std::size_t descriptor = 0;
  };
  std::vector<Place> places(images.size());
  std::vector<std::uint8_t> rows;
  for (std::size_t first = 0; first < vocabulary_size; first += kAtOnce) {
    const std::size_t end = std::min(vocabulary_size, first + kAtOnce);
    const std::size_t begin = parts.offsets[first];
    rows.resize((parts.offsets[end] - begin) * bytes);
    for (std::size_t p = 0; p < images.size(); ++p) {
      const Bow& bow = images[p].bow;
      auto& [entry, descriptor] = places[p];
      for (; entry < bow.words.size() && bow.words[entry].word < end; ++entry) {
        for (std::uint32_t i = 0; i < bow.words[entry].count; ++i, ++descriptor) {
          const std::size_t at = next[bow.words[entry].word]++;
          parts.images[at] = static_cast<ImageNumber>(p);
          if (!coder.binary()) parts.biases[at] = bow.biases[descriptor];
          std::copy_n(bow.codes.data() + descriptor * bytes, bytes,
                      rows.data() + (at - begin) * bytes);
        }
      }
    }
    for (std::size_t w = first; w < end; ++w) {
      AppendCodes(rows.data() + (parts.offsets[w] - begin) * bytes,
                  parts.offsets[w + 1] - parts.offsets[w], bytes, &parts.codes);
    }
  }
  return std::move(parts).Finish(bytes, coder.binary());
}

CodeLists CodeLists::Merge(std::span<const Source> sources) {
  struct Entry {
    std::uint32_t image = 0;
    std::int16_t bias = 0;
    const CodeList* list = nullptr;
    std::size_t code = 0;  // in the list
  };
  std::size_t words = 0;
  for (const Source& source : sources) words = std::max(words, source.lists->vocabulary_size());
  const std::size_t bytes = sources.empty() ? 0 : sources.front().lists->bytes_;
  const bool binary = !sources.empty() && sources.front().lists->binary_;
  Parts merged;
  std::vector<CodeList> lists(sources.size());
  std::vector<Entry> entries;
  std::vector<std::uint8_t> rows;
  for (std::uint32_t w = 0; w < words; ++w) {
    entries.clear();
    for (std::size_t s = 0; s < sources.size(); ++s) {
      lists[s] = sources[s].lists->List(w);
      const std::span<const ImageNumber> images = sources[s].lists->Images(w);
      for (std::size_t i = 0; i < images.size(); ++i) {
        const std::uint32_t position = (*sources[s].position)[images[i]];
        if (position == kGone) continue;
        entries.push_back({position, binary ? std::int16_t{0} : lists[s].biases[i], &lists[s], i});
      }
    }
    std::ranges::stable_sort(entries, {}, &Entry::image);
    rows.resize(entries.size() * bytes);
    for (std::size_t i = 0; i < entries.size(); ++i) {
      merged.images.push_back(static_cast<ImageNumber>(entries[i].image));
      if (!binary) merged.biases.push_back(entries[i].bias);
      CopyCode(*entries[i].list, entries[i].code, rows.data() + i * bytes);
    }
    merged.EndWord();
    AppendCodes(rows.data(), entries.size(), bytes, &merged.codes);
  }
  return std::move(merged).Finish(bytes, binary);
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
