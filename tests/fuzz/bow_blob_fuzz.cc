// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Bags of words as they are stored. The first byte of an input chooses the vocabulary's size.
#include "index/store/blob_codec.h"
#include "tests/fuzz/blob.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using pliant::fuzz::Accepts;
  using pliant::fuzz::Require;
  pliant::fuzz::Input input(data, size);
  const std::size_t words = std::size_t{1} << pliant::fuzz::TakeByte(input) % 17;
  const std::vector<std::uint8_t> blob = pliant::fuzz::WithChecksum(input);
  pliant::Bow bow;
  if (!Accepts([&] { bow = pliant::DecodeBow(blob, words); })) return 0;
  std::uint64_t total = 0;
  std::uint64_t next = 0;
  for (const pliant::WordCount& entry : bow.words) {
    Require(entry.word >= next && entry.word < words && entry.count > 0,
            "words are of the vocabulary, in order");
    next = std::uint64_t{entry.word} + 1;
    total += entry.count;
  }
  Require(total == bow.total, "the total is the sum of the counts");
  Require(total == 0 ? bow.codes.empty() : !bow.codes.empty() && bow.codes.size() % total == 0,
          "each descriptor has a code");
  const std::vector<std::uint8_t> again = pliant::EncodeBow(bow);
  const pliant::Bow read = pliant::DecodeBow(again, words);
  Require(read.words == bow.words && read.total == bow.total && read.codes == bow.codes,
          "what is read can be written and read again");
  Require(pliant::EncodeBow(read) == again, "what is written has one form");
  return 0;
}
